"""Principal pivoting on an LCP: w_i and z_i change places, one pair or two at a time, until nothing is negative.

The methods of Cottle and Dantzig and of Murty, and what they share: the tableau, a warm start from any complementary
basis, the proof in a row of the tableau.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.lcp import LCP, LCPPoint
from cpbench.foundation.kernel_cache import load
from cpbench.foundation.matrices import Vector, dense
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register
from cpbench.solvers.shared.progress import next_stop
from cpbench_solvers import linear_program
from cpbench_solvers.lcp.claims import (
    ScaledLCP,
    conclude,
    dense_obstacle,
    ended_in_basis,
    error_of,
    farkas,
    guessed,
    scale,
    solve_linear,
)

CHUNK = 500
"""Pivots between two looks at the clock."""
RESTARTS = 2
"""Times that a tableau spoilt by rounding is computed afresh from M."""
LOW = -2.0
"""Lower bound of what is negative, in data scaled to size one."""


@dataclass(frozen=True)
class PrincipalPivotingOptions:
    """Options of murty, cottle-dantzig. `max_pivots` : 0 stands for 50n + 1000. `pivot_tolerance` : entries
    of the tableau up to this are zero, and `feasibility_tolerance` : values above minus this are not negative, both
    in data scaled to size one."""

    max_pivots: int = 0
    pivot_tolerance: float = 1e-10
    feasibility_tolerance: float = 1e-12


class Tableau:
    """y = const + T x for the complementary basis of F: y_i is z_i in F, else w_i; x is 0."""

    def __init__(self, T: np.ndarray[Any, Any], y: Vector, F: np.ndarray[Any, Any]) -> None:
        n = y.size
        self.T, self.y, self.x = T, y, np.zeros(n)
        self.swapped = np.zeros(n, dtype=bool)
        self.swapped[F] = True
        self.state = np.array([0, -1, 0, -1])
        self.row = np.append(np.zeros(n), min(LOW, 2.0 * y.min(initial=0.0)))

    @property
    def z(self) -> Vector:
        return np.where(self.swapped, self.y, self.x)

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


class PrincipalPivoting(Solver):
    """Base of the pivoting methods, which differ by their loop in `kernels.principal_pivoting`."""

    loop: ClassVar[str]
    """Name of the compiled loop."""
    promise: ClassVar[str]
    """The matrices for which the method ends in a solution or in a proof that there is none."""

    def obstacle(self, problem: LCP) -> str | None:
        return dense_obstacle(problem)

    def setup(self, problem: LCP, budget: Budget, options: PrincipalPivotingOptions) -> ScaledLCP:
        return scale(problem)

    def warmup(self) -> None:
        linear_program.load()
        self.run(LCP(M=np.array([[2.0, 1.0], [1.0, 2.0]]), q=np.array([-1.0, -2.0])))

    def solve(
        self,
        prepared: ScaledLCP,
        budget: Budget,
        options: PrincipalPivotingOptions,
        start: Any = None,
        record: Record | None = None,
    ) -> SolverOutput:
        kernel = load("cpbench_solvers.kernels.principal_pivoting")
        problem, n, zero = prepared.problem, prepared.q.size, options.feasibility_tolerance
        empty = np.empty(0, dtype=np.int64)
        tableau = None
        if start is not None:
            active = np.flatnonzero(guessed(prepared, start.z / prepared.z_unit))
            tableau = transform(dense(prepared.M), prepared.q, active)
        tableau = tableau or transform(dense(prepared.M), prepared.q, empty)
        assert tableau is not None
        limit = budget.iterations or options.max_pivots or 50 * n + 1000
        deadline = time.monotonic() + budget.seconds
        done = cycles = restarts = 0

        def show(z: Vector) -> None:
            if record is not None:
                record(done, error_of(problem, z), lambda: LCPPoint(z))

        while True:
            pivoted, outcome = tableau.state[0], kernel.LIMIT
            # by chunks, since compiled code does not look at the clock
            while outcome == kernel.LIMIT and done < limit and time.monotonic() <= deadline:
                show(np.maximum(tableau.z, 0.0) * prepared.z_unit)
                until = next_stop(done, min(limit, done + CHUNK), record) - done + tableau.state[0]
                outcome = getattr(kernel, self.loop)(
                    *(tableau.T, tableau.y, tableau.x, tableau.swapped, tableau.state, tableau.row),
                    *(until, options.pivot_tolerance, zero),
                )
                done, pivoted = done + int(tableau.state[0] - pivoted), tableau.state[0]
            counters = {"iterations": done, "major_cycles": cycles + int(tableau.state[2]), "factorizations": restarts}
            if outcome != kernel.SOLVED:
                break
            F = np.flatnonzero(tableau.swapped)
            output = ended_in_basis(problem, np.maximum(tableau.z, 0.0) * prepared.z_unit, F, budget, counters)
            fresh = None
            # the basis may be right and the tableau spoilt: pivots add up rounding, one factorization does not
            if output.claim is not Claim.SOLVED and restarts < RESTARTS:
                fresh = transform(dense(prepared.M), prepared.q, F)
            if fresh is None:
                if output.point is not None and done > 0:
                    show(output.point.z)
                return output
            cycles, restarts, tableau = cycles + int(tableau.state[2]), restarts + 1, fresh
        return self._without_solution(kernel, outcome, prepared, tableau, budget, counters)

    def _without_solution(
        self, kernel: Any, outcome: int, prepared: ScaledLCP, tableau: Tableau, budget: Budget, counters: dict[str, int]
    ) -> SolverOutput:
        """Claim infeasible where a row of the tableau, or a linear program after a ray, proves it; else say why."""
        problem, pivots = prepared.problem, counters["iterations"]
        if outcome in (kernel.RAY, kernel.NOT_IN_CLASS):
            certificate = tableau.combination()
            if not problem.certifies_infeasibility(certificate):
                certificate = farkas(problem, budget) if outcome == kernel.RAY else None
            if certificate is not None:
                message = f"nothing blocks after {pivots} pivots; y ≥ 0, Mᵀy ≤ 0, qᵀy < 0 to rounding (Farkas)"
                return SolverOutput(claim=Claim.INFEASIBLE, counters=counters, certificate=certificate, message=message)
        claim = Claim.FAILED
        if outcome == kernel.RAY:
            message = f"nothing blocks after {pivots} pivots, and no certificate of infeasibility: not {self.promise}"
        elif outcome == kernel.NOT_IN_CLASS:
            entry = tableau.T[tableau.state[3], tableau.state[3]]
            message = f"M is not {self.promise}: diagonal entry {entry:.1e} after {pivots} pivots, use lemke"
        elif outcome == kernel.NOT_FINITE:
            message = f"not finite after {pivots} pivots"
        else:
            claim = Claim.MAX_ITER
            lacking = int(np.sum(np.minimum(tableau.y, tableau.x) < 0.0))
            message = f"{lacking} components negative after {pivots} pivots"
        z = np.maximum(tableau.z, 0.0) * prepared.z_unit
        return conclude(problem, z, budget, counters, otherwise=claim, message=message)


pivoting_spec = partial(
    SolverSpec,
    node="lcp",
    method="pivoting",
    traits=frozenset({Trait.WARM_START, Trait.HISTORY, Trait.DETERMINISTIC}),
    options=PrincipalPivotingOptions,
)
"""The spec of a `PrincipalPivoting`, with what all of them share."""


@register
class CottleDantzig(PrincipalPivoting):
    """A method that drives one z_r (or w_r) at a time up until its pair is complementary; what was nonnegative stays
    so.

    Ends for sufficient M, positive semidefinite ones and P-matrices among them: in a solution, or in a row of the
    tableau that proves that there is none. Ties go to the least index; degenerate problems could cycle all the same.
    """

    spec: ClassVar[SolverSpec] = pivoting_spec(
        name="cottle-dantzig",
        summary="principal pivoting method of Cottle and Dantzig, with 2x2 pivots",
        citation="Cottle and Dantzig 1968; Cottle, Pang and Stone 2009, section 4.3",
    )
    loop = "cottle_dantzig"
    promise = "sufficient"


@register
class Murty(PrincipalPivoting):
    """Any complementary basis will do, feasible or not, so every start is a warm one.

    Finite for P-matrices, though 2ⁿ pivots are possible (Murty 1978). For others it meets a diagonal entry that is
    not positive, or comes back to a basis it has seen and runs into the limit of pivots.
    """

    spec: ClassVar[SolverSpec] = pivoting_spec(
        name="murty",
        summary="Murty's least-index principal pivoting, for P-matrices",
        citation="Murty 1974, Linear Algebra Appl. 9:65; Cottle, Pang and Stone 2009, section 4.2",
        by_default=False,
    )
    loop = "murty"
    promise = "a P-matrix"
