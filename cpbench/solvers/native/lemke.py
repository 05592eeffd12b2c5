"""Lemke's method on an LCP: cover q by z_0, then follow complementary pivots until z_0 leaves or a ray appears."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from scipy.linalg import blas

from cpbench.formulations.lcp import LCP
from cpbench.matrices import Dense, Vector, dense, max_abs
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register
from cpbench.solvers.native.lcp_claims import ScaledLCP, conclude, dense_obstacle, error_of, refined, scale
from cpbench.solvers.options import fixed, searched

SMALL = 64
"""Up to this size every pivot updates the tableau at once; beyond it BLOCK pivots are applied as one GEMM."""
BLOCK = 32


@dataclass(frozen=True)
class LemkeOptions:
    """`max_pivots` : 0 stands for 50n + 1000. `pivot_tolerance` : entries up to this, in data scaled to size one,
    do not block. `tie_tolerance` : rows that a step would bring this close to zero count as tied."""

    max_pivots: int = fixed(0)
    pivot_tolerance: float = searched(1e-11, low=1e-13, high=1e-8, log=True)
    tie_tolerance: float = searched(1e-13, low=1e-15, high=1e-9, log=True)


@register
class Lemke(Solver):
    """Complementary pivoting with covering vector e and the lexicographic ratio test, which excludes cycling.

    Ends in a solution for copositive-plus M (so for PSD M) when there is a feasible point, and for P and other
    Q_0 classes; elsewhere it may end in a ray, which by itself proves nothing. A ray is then followed by a linear
    program for a Farkas certificate.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="lemke",
        node="lcp",
        summary="Lemke's complementary pivoting, lexicographic ratio test",
        method="pivoting",
        citation="Lemke 1965; Cottle, Pang and Stone 1992, algorithm 4.4.5 and section 4.9",
        traits=frozenset({Trait.DETERMINISTIC}),
        options=LemkeOptions,
    )

    def obstacle(self, problem: LCP) -> str | None:
        return dense_obstacle(problem)

    def setup(self, problem: LCP, budget: Budget, options: LemkeOptions) -> ScaledLCP:
        return scale(problem)

    def warmup(self) -> None:
        self.run(LCP(M=np.eye(2), q=np.array([-1.0, -2.0])))

    def solve(
        self,
        prepared: ScaledLCP,
        budget: Budget,
        options: LemkeOptions,
        start: Any | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        problem, q = prepared.problem, prepared.q
        n = q.size
        if n == 0 or q.min() >= 0.0:
            return conclude(problem, np.zeros(n), budget, {"pivots": 0})
        outcome, z, pivots = _pivot(prepared, budget, options)
        counters = {"pivots": pivots}
        if outcome == "ray":
            return _after_ray(problem, z, budget, counters)
        if outcome != "complementary":
            claim = Claim.FAILED if outcome == "not finite" else Claim.MAX_ITER
            return conclude(problem, z, budget, counters, otherwise=claim, message=f"{outcome} after {pivots} pivots")
        error = error_of(problem, z)
        if not error <= budget.tolerance:
            candidate = refined(dense(problem.M), problem.q, z, np.flatnonzero(z))
            if (better := error_of(problem, candidate)) < error:
                z, error = candidate, better
            counters["factorizations"] = 1
        return conclude(problem, z, budget, counters, error=error)


def _pivot(prepared: ScaledLCP, budget: Budget, options: LemkeOptions) -> tuple[str, Vector, int]:
    """Outcome in words, z of the basis it ended in (unscaled), number of pivots."""
    from cpbench.kernel_cache import load

    kernel = load("cpbench.solvers.kernels.pivoting")
    n = prepared.q.size
    block = 1 if n <= SMALL else BLOCK
    T = np.empty((n, n + 1))
    T[:, :n] = -prepared.M
    T[:, n] = -1.0
    rhs = prepared.q.copy()
    basic = np.arange(n)
    nonbasic = np.arange(n, 2 * n + 1)
    where = np.concatenate([-1 - np.arange(n), np.arange(n + 1)])
    U, V = np.zeros((n, block)), np.zeros((block, n + 1))
    state = np.array([0, n, 0, _first_row(prepared.M, prepared.q)])
    limit = budget.iterations or options.max_pivots or 50 * n + 1000
    deadline = time.monotonic() + budget.seconds
    while True:
        status = kernel.advance(
            T,
            rhs,
            basic,
            nonbasic,
            where,
            U,
            V,
            state,
            limit,
            options.pivot_tolerance,
            options.tie_tolerance,
            block == 1,
        )
        if status != kernel.FLUSH:
            break
        # T -= U V in place; BLAS wants columns, so on the transposes
        blas.dgemm(-1.0, V.T, U.T, 1.0, T.T, overwrite_c=True)
        state[0] = 0
        if time.monotonic() > deadline:
            return "out of time", np.zeros(n), int(state[2])
    z = np.zeros(n)
    in_basis = (basic >= n) & (basic < 2 * n)
    z[basic[in_basis] - n] = rhs[in_basis] * prepared.z_unit
    words = {kernel.COMPLEMENTARY: "complementary", kernel.RAY: "ray", kernel.LIMIT: "pivot limit"}
    return words.get(status, "not finite"), z, int(state[2])


def _first_row(M: Dense, q: Vector) -> int:
    """Where q is least; among ties the r whose z_r, raised until w_r = 0, lifts the other w most (Σ_j M_jr/M_rr).

    On the worst cases of Murty and Fathi every row ties, and the first or the last of them costs 2ⁿ pivots.
    """
    ties = np.flatnonzero(q == q.min())
    if ties.size == 1:
        return int(ties[0])
    diagonal, lift = M[ties, ties], M[:, ties].sum(axis=0)
    return int(ties[np.argmax(np.where(diagonal > 0, lift / np.where(diagonal > 0, diagonal, 1.0), lift))])


def _after_ray(problem: LCP, z: Vector, budget: Budget, counters: dict[str, int]) -> SolverOutput:
    """Infeasible when the certificate holds; otherwise failed, for a ray proves nothing by itself."""
    certificate = _farkas(problem, budget)
    if certificate is not None:
        return SolverOutput(
            claim=Claim.INFEASIBLE,
            counters=counters,
            certificate=certificate,
            message=f"ray after {counters['pivots']} pivots; y ≥ 0, Mᵀy ≤ 0, qᵀy < 0 proves that there is no solution",
        )
    return conclude(
        problem,
        z,
        budget,
        counters,
        otherwise=Claim.FAILED,
        message=f"ray after {counters['pivots']} pivots, and no certificate of infeasibility: undecided",
    )


def _farkas(problem: LCP, budget: Budget) -> Vector | None:
    """A checked y with y ≥ 0, Mᵀy ≤ 0, qᵀy < 0, from min qᵀy over 0 ≤ y ≤ 1; None where there is none."""
    from scipy.optimize import linprog  # slow to import, and rarely needed

    n = problem.q.size
    options: dict[str, Any] = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
    if np.isfinite(budget.seconds):
        options["time_limit"] = budget.seconds
    program = linprog(
        problem.q / (max_abs(problem.q) or 1.0),
        A_ub=problem.M.T / (max_abs(problem.M) or 1.0),
        b_ub=np.zeros(n),
        bounds=(0.0, 1.0),
        method="highs",
        options=options,
    )
    if program.x is None:
        return None
    y = np.maximum(program.x, 0.0)
    return y if problem.certifies_infeasibility(y) else None
