"""Automatic choice on QPs: active sets where matrices are small or dense, the interior point where they are not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.programs import QP, QPPoint
from cpbench.foundation.matrices import nnz
from cpbench.solvers.base import (
    Budget,
    Claim,
    Record,
    SolverOutput,
    SolverSpec,
    StackCall,
    register,
    solved,
    solvers,
)
from cpbench_solvers.automatic import AutomaticChoice, LastNumber, Plan, SolverPhase, automatic_spec
from cpbench_solvers.qp.apart import PartedQP, parted, solve_apart
from cpbench_solvers.qp.claims import ErrorMeasure
from cpbench_solvers.qp.kkt_system import FULL
from cpbench_solvers.qp.presolve import dense_problem, presolved, sparse_data
from cpbench_solvers.qp.proximal_active_set import ProximalActiveSetOptions, fits_one_call, record_ends
from cpbench_solvers.stacks import solve_qp

WHOLE = 0.5
"""Of unknowns and rows: a part with more of them is solved with the others, which make it no slower."""
STEPS = 5
"""Of conjugate gradients on faces, times √n, a product with Q each: on a grid in the plane one face takes about √n."""
FACTORS = 3
"""Dense factorizations that take as long as those steps may, where Q is full: half of what the interior point does."""
ON_SMALL = SolverPhase("proximal-active-set"), SolverPhase("interior-point-qp"), SolverPhase("augmented-lagrangian")
SMALL, SMALL_SPARSE = 100, 50
"""Unknowns up to which the active set is first whatever it takes, where matrices are full and where they are sparse: of
these the interior point takes advantage, once there is more to eliminate than to put in order. Sparse ones of up to
SMALL unknowns are for the active set where few sides count."""
TURNS, AHEAD = 16, 7.0
"""Iterations that the interior point takes where matrices are full, so that both together take at most twice as long as
the better one; and the time of an operation of the active set, over that of a factorization."""
CROWD, SPARSE_CROWD = 0.8, 0.25
"""Of n, the sides in the way of the minimum without them beyond which the interior point is first: it was ahead then on
drawn programs of more than `SMALL` unknowns with full matrices but one, and on five files where they are sparse."""
ACTIVE_SET = ProximalActiveSetOptions()
ACTIVE = SolverPhase("proximal-active-set"), SolverPhase("dual-active-set")
ENDED = (Claim.SOLVED, Claim.INFEASIBLE, Claim.UNBOUNDED)


@register
class AutoQP(AutomaticChoice):
    """Proximal steps over the dual active set in one compiled call for few unknowns, and for up to some hundreds where
    the data are dense, as long as the interior point would take; else the interior point.

    Conjugate gradients on faces before both where there are bounds alone and more than some dozens of unknowns.
    """

    spec: ClassVar[SolverSpec] = automatic_spec("qp", "auto-qp", "active set or interior point, by size")
    stack_call: ClassVar[StackCall | None] = StackCall(solve_qp)
    members: ClassVar[tuple[str, ...]] = (
        "dual-active-set",
        "proximal-active-set",
        "interior-point-qp",
        "mprgp-qp",
        "augmented-lagrangian",
    )

    def setup(self, problem: QP, budget: Budget, options: Any) -> Any:
        """Return a `Plan`, or a `PartedQP`."""
        if problem.p.size > SMALL and (parts := parted(problem, WHOLE)) is not None:
            return parts
        if 0 < problem.p.size <= _at_once(problem):
            # one compiled call, which finds out by itself whether Q is convex
            return Plan(problem, ON_SMALL, problem, ACTIVE_SET, solvers.get("proximal-active-set"))
        if problem.p.size and (phases := tuple(self.phases(problem)))[0].solver == "proximal-active-set":
            return Plan(problem, phases, problem, ProximalActiveSetOptions(**phases[0].options))
        return super().setup(problem, budget, options)

    def solve(
        self,
        prepared: Any,
        budget: Budget,
        options: Any,
        start: QPPoint | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        if isinstance(prepared, PartedQP):
            output = solve_apart(prepared, budget, start, self)
            if record is not None and isinstance(output.point, QPPoint):
                record_ends(prepared.problem, output.point, output.counters["iterations"], record)
            return output
        deadline, problem = budget.deadline(), prepared.problem
        last = None if record is None else LastNumber(record)
        output = super().solve(prepared, budget, options, start, last)
        if output.claim in ENDED or budget.iterations is not None:
            return output
        for other in (self._apart, self._presolved) if problem.p.size <= SMALL else (self._apart,):
            left = budget.left(deadline)
            found = other(problem, left) if left.seconds > 0.0 else None
            if found is not None and found.claim in ENDED:
                if last is not None and (point := found.point) is not None:
                    last(last.number + 1, self.error(problem, point, budget.tolerance), lambda: point)
                return found
        return output

    def _apart(self, problem: QP, budget: Budget) -> SolverOutput | None:
        parts = parted(problem)
        return None if parts is None else solve_apart(parts, budget, None, self)

    def _presolved(self, problem: QP, budget: Budget) -> SolverOutput | None:
        """Return the answer that what presolve leaves has: rows that are bounds are met exactly then."""
        found = presolved(sparse_data(problem))
        if found is None:
            return None
        left, lift = found
        none = np.zeros(0)
        output = solved(QPPoint(none, none, none, none), {"iterations": 0})
        if left.p.size:
            output = self.run(dense_problem(left), budget)
        if not isinstance(output.point, QPPoint):
            return None
        measure = ErrorMeasure(problem, tolerance=budget.tolerance)
        point = output.point
        measure.see(0, lift((point.z, point.lam, point.mu, point.nu)))
        return measure.conclude(budget, output.counters, message=f"presolved: {output.message}")

    def error(self, problem: QP, point: QPPoint, tolerance: float) -> float:
        return ErrorMeasure(problem, tolerance=tolerance).error((point.z, point.lam, point.mu, point.nu))

    def phases(self, problem: QP) -> Sequence[SolverPhase]:
        n, m, k, full = problem.p.size, problem.b.size, problem.d.size, _is_full(problem)
        if n <= _at_once(problem):
            return ON_SMALL
        options = {"crowd": CROWD if full else SPARSE_CROWD}
        if m + k:
            first = n <= SMALL or (full and fits_one_call(n, m + k))
            passes = [SolverPhase("proximal-active-set", _passes(n, m, k), options)] * first
            return [*passes, *ON_SMALL[1:], *ACTIVE]
        # each bound that is held takes the active set a pass, and these steps none
        passes = [SolverPhase("proximal-active-set", n // 2, options)] * (full and n <= SMALL)
        steps = max(STEPS * math.sqrt(n), FACTORS * n / 6.0 if full else 0.0)
        return [*passes, SolverPhase("mprgp-qp", int(steps), {"projected": True}), *ON_SMALL[1:], *ACTIVE]


def _at_once(problem: QP) -> int:
    """Return up to how many unknowns the active set goes on to its own end."""
    return SMALL if (problem.b.size or problem.d.size) and _is_full(problem) else SMALL_SPARSE


def _is_full(problem: QP) -> bool:
    """Return whether sparse factorizations would gain little."""
    n = problem.p.size
    return sum(map(nnz, (problem.Q, problem.A, problem.C))) >= FULL * n * (n + problem.b.size + problem.d.size)


def _passes(n: int, m: int, k: int) -> int:
    """Return how many passes of the active set take the time of `TURNS` iterations of the interior point.

    A factorization of the latter takes mn² + (n + k)³/3 operations of dense matrices; a pass of the former looks at all
    sides and bounds, solves with a factor, and adds a row to it.
    """
    return int(TURNS * (m * n * n + (n + k) ** 3 / 3.0) / (AHEAD * n * (3.0 * n + m + k))) + 1
