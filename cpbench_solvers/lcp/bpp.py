"""Block principal pivoting on an LCP: all infeasible components change sides at once, one at a time when that fails."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from cpbench.formulations.linear import LCP, LCPPoint
from cpbench.foundation.matrices import Vector, max_abs
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register
from cpbench_solvers.lcp.changing_basis import ChangingBasis
from cpbench_solvers.lcp.claims import conclude, dense_obstacle, ended_in_basis, error_of, recorded, settled
from cpbench_solvers.lcp.first_basis import DenseLCP, dense_lcp, swept
from cpbench_solvers.lcp.lemke import Lemke
from cpbench_solvers.lcp.lemke_run import LemkeOptions

PATIENCE = 3
"""Block changes allowed without a new least number of infeasibilities (Júdice and Pires: p)."""


@dataclass(frozen=True)
class BPPOptions:
    """Options of bpp. `max_iterations` : sweeps and bases, 0 stands for 10n + 200. `feasibility_tolerance` : of z in
    units of max|q|/max|M|, of w in units of max|q|. `max_sweeps` : of projected Gauss-Seidel that guess the first
    active set, more where they end sooner than a factorization. `omega` : their relaxation where M is not symmetric
    and 1 does not do. `max_factorizations` : after so many, or in a singular basis, Lemke's method takes over; 0 :
    never."""

    max_iterations: int = 0
    feasibility_tolerance: float = 1e-12
    max_sweeps: int = 20
    omega: float = 0.6
    max_factorizations: int = 5


class _Exchange:
    """The rule by which components change sides (Júdice and Pires): all infeasible ones at once; the
    last alone, as Murty does, when PATIENCE such changes have not led to fewer than there ever were.

    least : the least number of infeasible components so far.
    """

    def __init__(self, n: int) -> None:
        self.least, self._patience = n + 1, PATIENCE
        self._seen: set[bytes] = set()

    def chosen(self, inside: NDArray[np.bool_], infeasible: NDArray[np.int64]) -> NDArray[np.int64] | None:
        """Return those that change sides; None where the active set was there before: M is no P-matrix."""
        if infeasible.size < self.least:
            self.least, self._patience = infeasible.size, PATIENCE
            self._seen.clear()
        elif self._patience > 0:
            self._patience -= 1
        else:
            key = inside.tobytes()
            if key in self._seen:
                return None
            self._seen.add(key)
            return infeasible[-1:]
        return infeasible


@register
class BlockPrincipalPivoting(Solver):
    """Active sets F with M_FF z_F = -q_F, the first from a few sweeps, the next from the signs of z and w.

    Murty's rule takes over while blocks do not help, which ends for P-matrices. A singular M_FF, an active set that
    comes back, or too many factorizations hand the problem over to Lemke's method, which decides semidefinite ones.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="bpp",
        node="lcp",
        summary="block principal pivoting from a few sweeps, Murty's rule and Lemke's method as safeguards",
        method="pivoting",
        citation="Kostreva 1978; Júdice and Pires 1994, Computers & OR 21:587; Robinson, Feng, Nocedal and Pang 2013",
        traits=frozenset({Trait.WARM_START, Trait.HISTORY, Trait.DETERMINISTIC}),
        options=BPPOptions,
    )

    def obstacle(self, problem: LCP) -> str | None:
        return dense_obstacle(problem)

    def setup(self, problem: LCP, budget: Budget, options: BPPOptions) -> DenseLCP:
        return dense_lcp(problem)

    def solve(
        self, prepared: DenseLCP, budget: Budget, options: BPPOptions, start: Any = None, record: Record | None = None
    ) -> SolverOutput:
        problem, n = prepared.problem, prepared.problem.q.size
        limit = budget.iterations or options.max_iterations or 10 * n + 200
        deadline = time.monotonic() + budget.seconds
        z, sweeps = np.zeros(n) if start is None else np.maximum(start.z, 0.0), 0
        if record is not None:
            record(0, error_of(problem, z), partial(LCPPoint, z))
        if start is None:
            z, sweeps = swept(prepared, min(limit, options.max_sweeps), options.omega, budget.tolerance, limit)
        counters = {"iterations": sweeps, "sweeps": sweeps, "factorizations": 0}
        if error_of(problem, z, budget.tolerance) <= budget.tolerance or sweeps >= limit:
            active = prepared.points_to(z, prepared.M @ z + problem.q)
            z, error = settled(problem, z, active, budget.tolerance, counters)
            if record is not None and sweeps:
                record(sweeps, error, partial(LCPPoint, z))
            message = f"error {error:.1e} after {sweeps} sweeps"
            output = conclude(problem, z, budget, counters, error=error, otherwise=Claim.MAX_ITER, message=message)
            return recorded(output, z, problem, record, sweeps + 1)
        return self._pivoted(prepared, budget, options, z, counters, limit, deadline, record)

    def _pivoted(
        self, prepared: DenseLCP, budget: Budget, options: BPPOptions, z: Vector, counters: dict[str, int],
        limit: int, deadline: float, record: Record | None,
    ) -> SolverOutput:  # fmt: skip
        """Exchange blocks, from the active set that z points to."""
        problem, sweeps = prepared.problem, counters["sweeps"]
        w_tolerance = options.feasibility_tolerance * max_abs(problem.q)
        basis = ChangingBasis(prepared.M, prepared.columns, problem.q, problem.symmetric)
        inside, exchange = prepared.points_to(z, prepared.M @ z + problem.q), _Exchange(problem.q.size)
        why, many = "", options.max_factorizations or math.inf
        for done in range(1, limit - sweeps + 1):
            counters["iterations"] = done + sweeps
            solved = basis.solve(inside)
            counters["factorizations"] = basis.factorizations
            if solved is None:
                why = f"M_FF of size {int(inside.sum())} is singular after {done} bases"
                break
            z, w = solved
            infeasible = np.flatnonzero(np.where(inside, z * prepared.size, w) < -w_tolerance)
            shown = np.maximum(z, 0.0)
            if infeasible.size == 0:
                output = ended_in_basis(problem, shown, np.flatnonzero(inside), budget, counters)
                if record is not None and isinstance(output.point, LCPPoint):
                    record(counters["iterations"], error_of(problem, output.point.z), partial(LCPPoint, output.point.z))
                return output
            if record is not None:
                record(counters["iterations"], error_of(problem, shown), partial(LCPPoint, shown))
            chosen = exchange.chosen(inside, infeasible)
            if chosen is None:
                why = f"an active set comes back after {done} bases, M is no P-matrix"
                break
            inside[chosen] = ~inside[chosen]
            if basis.factorizations >= many:
                why = f"{exchange.least} components infeasible at best after {basis.factorizations} factorizations"
                break
            if time.monotonic() > deadline:
                break
        counters["factorizations"] = basis.factorizations
        if why and options.max_factorizations and time.monotonic() <= deadline:
            return self._by_lemke(prepared, z, budget, deadline, counters, why, record)
        z = np.maximum(z, 0.0)
        claim, message = Claim.FAILED, f"{why}: use lemke"
        if not why:
            claim = Claim.MAX_ITER
            message = f"{exchange.least} components infeasible at best after {counters['iterations']} steps"
        output = conclude(problem, z, budget, counters, otherwise=claim, message=message)
        return recorded(output, z, problem, record, counters["iterations"] + 1)

    def _by_lemke(
        self,
        prepared: DenseLCP,
        z: Vector,
        budget: Budget,
        deadline: float,
        counters: dict[str, int],
        why: str,
        record: Record | None,
    ) -> SolverOutput:
        rest = Budget(tolerance=budget.tolerance, seconds=deadline - time.monotonic(), iterations=budget.iterations)
        problem = prepared.problem
        solution = Lemke().solve(prepared, rest, LemkeOptions(), LCPPoint(np.maximum(z, 0.0)))
        counters = {**counters, "pivots": solution.counters["pivots"]}
        if record is not None and isinstance(solution.point, LCPPoint):
            record(counters["iterations"] + 1, error_of(problem, solution.point.z), partial(LCPPoint, solution.point.z))
        message = f"{why}; Lemke's method: {solution.message or solution.claim}"
        return replace(solution, counters=counters, message=message)
