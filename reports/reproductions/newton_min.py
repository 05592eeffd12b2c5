"""Two forms of the Newton-min algorithm for LCPs, for the reproductions in this folder: plain, and with a line search.

Both solve min(z, Mz + q) = 0: the direction d solves the linear equation of the piece that holds at z. The plain
algorithm takes the whole step. Harker and Pang's line search (1990, Lectures in Applied Mathematics 26:265) keeps away
from points where the minimum is not differentiable: where it meets one on its way, it ends a small step behind the
first (Dussault, Frappier and Gilbert 2019, EURO J. Comput. Optim. 7:359).
"""

from __future__ import annotations

import time
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.linear import LCP, LCPPoint
from cpbench.foundation.matrices import Vector, dense
from cpbench.solvers import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register

BEHIND = 1e-3
"""How far behind a point without derivative a step ends at most, over the way to it."""
TRAITS = frozenset({Trait.DETERMINISTIC, Trait.WARM_START})


class NewtonMin(Solver):
    """The iteration that both forms share; they differ in the length of the step."""

    def solve(
        self, prepared: LCP, budget: Budget, options: Any, start: LCPPoint | None = None, record: Record | None = None
    ) -> SolverOutput:
        M, q = dense(prepared.M), prepared.q
        z = np.zeros(q.size) if start is None else start.z.copy()
        end, most, seen = time.monotonic() + budget.seconds, budget.iterations or 10_000, {}
        for k in range(most):
            w = M @ z + q
            if prepared.residuals(LCPPoint(z=z), budget.tolerance).error <= budget.tolerance:
                return SolverOutput(claim=Claim.SOLVED, point=LCPPoint(z=z), counters={"iterations": k})
            if (before := seen.setdefault(z.tobytes(), k)) < k:
                message = f"a cycle of {k - before} points"
                return SolverOutput(
                    claim=Claim.FAILED, point=LCPPoint(z=z), counters={"iterations": k, "period": k - before},
                    message=message,
                )  # fmt: skip
            if time.monotonic() > end:
                break
            piece = np.where((w < z)[:, None], M, np.eye(q.size))
            d = np.linalg.solve(piece, -np.minimum(z, w))
            z = z + self.length(z - w, d - M @ d) * d
        return SolverOutput(claim=Claim.MAX_ITER, point=LCPPoint(z=z), counters={"iterations": most})

    def length(self, difference: Vector, change: Vector) -> float:
        """Return the length of the step; z − w is `difference` at its start, and changes by `change` on a whole one."""
        raise NotImplementedError


@register
class Plain(NewtonMin):
    """Takes whole steps: a Newton method without globalization."""

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="newton-min-plain",
        node="lcp",
        summary="Newton-min with whole steps",
        method="nonsmooth Newton",
        citation="Ben Gharbia and Gilbert 2012, Math. Prog. 134:349",
        traits=TRAITS,
    )

    def length(self, difference: Vector, change: Vector) -> float:
        """Return 1."""
        return 1.0


@register
class HarkerPang(NewtonMin):
    """Ends a small step behind the first point of the way where the minimum has no derivative."""

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="newton-min-harker-pang",
        node="lcp",
        summary="Newton-min that crosses one kink of the minimum in a step",
        method="nonsmooth Newton",
        citation="Harker and Pang 1990, Lectures in Applied Mathematics 26:265; Dussault, Frappier and Gilbert 2019, "
        "EURO J. Comput. Optim. 7:359",
        traits=TRAITS,
    )

    def length(self, difference: Vector, change: Vector) -> float:
        """Return 1 where z − w changes no sign before, else a little more than where the first component does."""
        crossing = np.flatnonzero(difference * change < 0.0)
        kinks = np.sort(-difference[crossing] / change[crossing])
        if kinks.size == 0 or kinks[0] >= 1.0:
            return 1.0
        following = min(kinks[1], 1.0) if kinks.size > 1 else 1.0
        return float(kinks[0] + min(BEHIND * kinks[0], 0.5 * (following - kinks[0])))
