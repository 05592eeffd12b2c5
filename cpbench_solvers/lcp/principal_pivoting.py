"""Murty's principal pivoting on an LCP: w_i and z_i change places, the first pair that is negative, until none is."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.linear import LCP, LCPPoint
from cpbench.foundation.matrices import Vector, dense
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register
from cpbench.solvers.shared.progress import next_stop
from cpbench_solvers.kernels import principal_pivoting
from cpbench_solvers.lcp.claims import (
    ScaledLCP,
    conclude,
    dense_obstacle,
    ended_in_basis,
    error_of,
    guessed,
    scale,
    solve_linear,
)

CHUNK = 500
"""Pivots between two looks at the clock."""
RESTARTS = 2
"""Times that a tableau spoilt by rounding is computed afresh from M."""


@dataclass(frozen=True)
class MurtyOptions:
    """Options of murty. `max_pivots` : 0 stands for 50n + 1000. `pivot_tolerance` : entries of the tableau up to this
    are zero, and `feasibility_tolerance` : values above minus this are not negative, both in data scaled to size
    one."""

    max_pivots: int = 0
    pivot_tolerance: float = 1e-10
    feasibility_tolerance: float = 1e-12


class Tableau:
    """y = const + T x for the complementary basis of F: y_i is z_i in F, else w_i; x, the other of each pair, is 0.

    Attributes
    ----------
    swapped : (n,) whether y_i is z_i. state : pivots done, and the pair at which they ended.
    """

    def __init__(self, T: np.ndarray[Any, Any], y: Vector, F: np.ndarray[Any, Any]) -> None:
        self.T, self.y, self.swapped = T, y, np.zeros(y.size, dtype=bool)
        self.swapped[F] = True
        self.state = np.array([0, -1])

    @property
    def z(self) -> Vector:
        return np.where(self.swapped, np.maximum(self.y, 0.0), 0.0)

    def combination(self) -> Vector:
        """Return λ ≥ 0 that makes row r of the tableau, r the pair in hand, from the rows of w - Mz = q.

        The coefficients of that row, λ of w and -Mᵀλ of z, are 1, -T_rj and zeros; where all of them are nonnegative
        and the constant λᵀq is negative, there is no solution (Farkas).
        """
        r = int(self.state[1])
        certificate = np.where(self.swapped, -self.T[r], 0.0)
        if not self.swapped[r]:
            certificate[r] = 1.0
        return np.maximum(certificate, 0.0)


def transform(M: np.ndarray[Any, Any], q: Vector, F: np.ndarray[Any, Any]) -> Tableau | None:
    """Return the principal transform of (M, q) on F, by one factorization; None where M_FF is singular."""
    if F.size == 0:
        return Tableau(np.array(M), q.copy(), F)
    # one system for all three: M_FF⁻¹, −M_FF⁻¹M_FN and −M_FF⁻¹q_F
    N = np.setdiff1d(np.arange(q.size), F)
    right = np.hstack([np.eye(F.size), -M[np.ix_(F, N)], -q[F, None]])
    solved = solve_linear(M[np.ix_(F, F)], right)
    if solved is None:
        return None
    M_NF, inverse, y_F = M[np.ix_(N, F)], solved[:, : F.size], solved[:, -1]
    T, y = np.empty_like(M), np.empty_like(q)
    T[np.ix_(F, F)], T[np.ix_(F, N)] = inverse, solved[:, F.size : -1]
    T[np.ix_(N, F)], T[np.ix_(N, N)] = M_NF @ inverse, M[np.ix_(N, N)] + M_NF @ solved[:, F.size : -1]
    y[F], y[N] = y_F, q[N] + M_NF @ y_F
    return Tableau(T, y, F)


@register
class Murty(Solver):
    """Any complementary basis will do, feasible or not, so every start is a warm one.

    Finite for P-matrices, though 2ⁿ pivots are possible (Murty 1978). For others it meets a diagonal entry that is
    not positive, or comes back to a basis it has seen and runs into the limit of pivots.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="murty",
        node="lcp",
        summary="Murty's least-index principal pivoting, for P-matrices",
        method="pivoting",
        citation="Murty 1974, Linear Algebra Appl. 9:65; Cottle, Pang and Stone 2009, section 4.2",
        traits=frozenset({Trait.WARM_START, Trait.HISTORY, Trait.DETERMINISTIC}),
        options=MurtyOptions,
        by_default=False,
    )

    def obstacle(self, problem: LCP) -> str | None:
        return dense_obstacle(problem)

    def setup(self, problem: LCP, budget: Budget, options: MurtyOptions) -> ScaledLCP:
        return scale(problem)

    def solve(
        self,
        prepared: ScaledLCP,
        budget: Budget,
        options: MurtyOptions,
        start: Any = None,
        record: Record | None = None,
    ) -> SolverOutput:
        kernel, M, q = principal_pivoting, dense(prepared.M), prepared.q
        problem, n = prepared.problem, q.size
        tableau = None
        if start is not None:
            tableau = transform(M, q, np.flatnonzero(guessed(prepared, start.z / prepared.z_unit)))
        tableau = tableau or Tableau(np.array(M), q.copy(), np.empty(0, dtype=np.int64))
        limit = budget.iterations or options.max_pivots or 50 * n + 1000
        deadline = time.monotonic() + budget.seconds
        done = restarts = 0

        def show(z: Vector) -> None:
            if record is not None:
                record(done, error_of(problem, z), lambda: LCPPoint(z))

        while True:
            outcome = kernel.LIMIT
            # by chunks, since compiled code does not look at the clock
            while outcome == kernel.LIMIT and done < limit and time.monotonic() <= deadline:
                show(tableau.z * prepared.z_unit)
                before = int(tableau.state[0])
                until = next_stop(done, min(limit, done + CHUNK), record) - done + before
                tolerances = options.pivot_tolerance, options.feasibility_tolerance
                outcome = kernel.murty(tableau.T, tableau.y, tableau.swapped, tableau.state, until, *tolerances)
                done += int(tableau.state[0]) - before
            counters = {"iterations": done, "factorizations": restarts}
            if outcome != kernel.SOLVED:
                return _without_solution(kernel, outcome, prepared, tableau, budget, counters)
            F = np.flatnonzero(tableau.swapped)
            output = ended_in_basis(problem, tableau.z * prepared.z_unit, F, budget, counters)
            fresh = None
            # the basis may be right and the tableau spoilt: pivots add up rounding, one factorization does not
            if output.claim is not Claim.SOLVED and restarts < RESTARTS:
                fresh = transform(M, q, F)
            if fresh is None:
                if output.point is not None and done > 0:
                    show(output.point.z)
                return output
            restarts, tableau = restarts + 1, fresh


def _without_solution(
    kernel: Any, outcome: int, prepared: ScaledLCP, tableau: Tableau, budget: Budget, counters: dict[str, int]
) -> SolverOutput:
    """Claim infeasible where a row of the tableau proves it; else say why."""
    problem, pivots = prepared.problem, counters["iterations"]
    claim, message = Claim.FAILED, f"not finite after {pivots} pivots"
    if outcome == kernel.NOT_IN_CLASS:
        certificate, r = tableau.combination(), tableau.state[1]
        if problem.certifies_infeasibility(certificate):
            message = f"nothing blocks after {pivots} pivots; y ≥ 0, Mᵀy ≤ 0, qᵀy < 0 to rounding (Farkas)"
            return SolverOutput(claim=Claim.INFEASIBLE, counters=counters, certificate=certificate, message=message)
        message = f"M is not a P-matrix: diagonal entry {tableau.T[r, r]:.1e} after {pivots} pivots, use lemke"
    elif outcome == kernel.LIMIT:
        claim, lacking = Claim.MAX_ITER, int(np.sum(tableau.y < 0.0))
        message = f"{lacking} components negative after {pivots} pivots"
    return conclude(problem, tableau.z * prepared.z_unit, budget, counters, otherwise=claim, message=message)
