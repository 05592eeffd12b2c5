"""Lemke's method on an MLCP: the free unknowns go into the basis for good, then complementary pivots on the pairs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from cpbench.factorization import Factorization
from cpbench.formulations.lcp import LCP
from cpbench.formulations.mlcp import MLCP
from cpbench.matrices import Vector, dense
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register, solvers
from cpbench.solvers.native.mlcp.mlcp_claims import ScaledMLCP, conclude, dense_obstacle, farkas, refined, scale
from cpbench.solvers.options import fixed, searched

SMALL = 48
"""Up to this many unknowns one compiled call does it all; beyond, A is factored by LAPACK or SuperLU."""
BY_VECTORS = 250
"""Up to this many pairs Lemke's method is one compiled call; beyond, it is `lemke` with its matrix products."""
REGULAR = 1e-9
"""Reciprocal condition number of A from which it is eliminated by its factors."""


@dataclass(frozen=True)
class LemkeMLCPOptions:
    """`max_pivots` : 0 stands for 50m + 1000. `rank_tolerance` : entries up to this, in data scaled to size one, are
    no pivots for free unknowns. `pivot_tolerance`, `tie_tolerance` : of the ratio test, as for lemke."""

    max_pivots: int = fixed(0)
    rank_tolerance: float = searched(1e-10, low=1e-13, high=1e-6, log=True)
    pivot_tolerance: float = searched(1e-11, low=1e-13, high=1e-8, log=True)
    tie_tolerance: float = searched(1e-13, low=1e-15, high=1e-9, log=True)


@register
class LemkeMLCP(Solver):
    """A may be singular: equalities and free unknowns without a pivot in A take pairs (v_i, w_i) with them, whose roles
    are exchanged. What remains is an LCP, monotone where the MLCP is, and independent of the order and the signs of
    the equalities. Lemke's method ends on it as it does on any LCP: in a solution, or in a ray that proves nothing by
    itself; a linear program then looks for a Farkas certificate.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="lemke-mlcp",
        node="mlcp",
        summary="Lemke's complementary pivoting with free unknowns, singular A too",
        method="pivoting",
        citation="Lemke 1965; Cottle, Pang and Stone 1992, sections 2.3 and 4.4; Cao and Ferris 1996",
        traits=frozenset({Trait.DETERMINISTIC}),
        options=LemkeMLCPOptions,
    )

    def obstacle(self, problem: MLCP) -> str | None:
        return dense_obstacle(problem)

    def setup(self, problem: MLCP, budget: Budget, options: LemkeMLCPOptions) -> ScaledMLCP:
        return scale(problem, keep_sparse=problem.a.size + problem.b.size > SMALL)

    def warmup(self) -> None:
        one = np.eye(1)
        self.run(MLCP(A=one, B=one, C=one, D=-one, a=np.array([-1.0]), b=np.array([-1.0])))

    def solve(
        self,
        prepared: ScaledMLCP,
        budget: Budget,
        options: LemkeMLCPOptions,
        start: Any | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        run = _Run(prepared, budget, options)
        outcome, x, error = run.small() if prepared.k.size <= SMALL else run.large()
        counters = {"pivots": run.pivots, "factorizations": run.factorizations}
        if error <= budget.tolerance:  # a ray at the height of rounding errors, too
            return SolverOutput(claim=Claim.SOLVED, point=prepared.point(x), counters=counters)
        if outcome in (run.kernel.RAY, run.kernel.INCONSISTENT):
            what = "ray" if outcome == run.kernel.RAY else "an equality without unknowns that is not zero,"
            return _after_ray(prepared, x, budget, counters, what)
        if outcome != run.kernel.COMPLEMENTARY:
            claim = Claim.MAX_ITER if outcome == run.kernel.LIMIT else Claim.FAILED
            message = {
                run.kernel.LIMIT: f"pivot limit after {run.pivots} pivots",
                run.kernel.STUCK: "free unknowns are left that no pivot brings into the basis: use newton-fb-mlcp",
            }.get(outcome, f"not finite after {run.pivots} pivots")
            return conclude(prepared, x, budget, counters, otherwise=claim, message=message)
        x, error = refined(prepared, x, error, budget.tolerance)
        counters["factorizations"] += 1
        return conclude(prepared, x, budget, counters, error=error)


class Reduction:
    """The free unknowns brought into the basis by pivots; the pairs that remain are an LCP of the scaled data.

    Attributes
    ----------
    M : (m, m). q : (m,). outcome : of `reduce` in the kernel.
    """

    def __init__(self, prepared: ScaledMLCP, rank_tolerance: float = LemkeMLCPOptions.rank_tolerance) -> None:
        from cpbench.kernel_cache import load

        self._kernel, self._free = load("cpbench.solvers.kernels.mlcp_pivoting"), prepared.free
        self._T = np.column_stack([dense(prepared.K), prepared.k])
        N = prepared.k.size
        m = N - prepared.free
        self._labels = (*np.empty((2, N), np.int64), *np.empty((2, m), np.int64))
        self.M, self.q = np.empty((m, m)), np.empty(m)
        self.outcome: int = self._kernel.reduce(self._T, prepared.free, *self._labels, rank_tolerance)
        self._kernel.remaining(self._T, *self._labels[2:], self.M, self.q)

    def recover(self, z: Vector) -> Vector:
        """x of the whole problem from z of the pairs."""
        x = np.empty(self._T.shape[0])
        self._kernel.recover(self._T, self._free, *self._labels, z, x)
        return x


class _Run:
    """One solve: outcome, x and its error, and what it took."""

    def __init__(self, prepared: ScaledMLCP, budget: Budget, options: LemkeMLCPOptions) -> None:
        from cpbench.kernel_cache import load

        self.kernel = load("cpbench.solvers.kernels.mlcp_pivoting")
        self.prepared, self.budget, self.options = prepared, budget, options
        self.pivots = self.factorizations = 0
        m = prepared.k.size - prepared.free
        self._limit = budget.iterations or options.max_pivots or 50 * m + 1000
        self._tolerances = options.pivot_tolerance, options.tie_tolerance

    def small(self) -> tuple[int, Vector, float]:
        p, x, error = self.prepared, np.empty(self.prepared.k.size), np.empty(1)
        code = self.kernel.lemke_mixed(
            p.K,
            p.k,
            p.free,
            p.row_unit,
            p.unit,
            p.problem.v_unit,
            p.push,
            x,
            error,
            self._limit,
            self.options.rank_tolerance,
            *self._tolerances,
        )
        self.pivots = code // self.kernel.CODES
        return code % self.kernel.CODES, x, float(error[0])

    def large(self) -> tuple[int, Vector, float]:
        p, n = self.prepared, self.prepared.free
        factors = Factorization(p.K[:n, :n])
        self.factorizations = int(n > 0)
        outcome, x = self._by_tableau() if factors.rcond < REGULAR else self._by_factors(factors)
        return outcome, x, p.error(x)

    def _by_factors(self, factors: Factorization) -> tuple[int, Vector]:
        """B − D A⁻¹ C and b − D A⁻¹ a, A being regular."""
        K, k, n = self.prepared.K, self.prepared.k, self.prepared.free
        solved = factors.solve(np.column_stack([dense(K[:n, n:]), k[:n]]))
        D = K[n:, :n]
        M = np.ascontiguousarray(dense(K[n:, n:]) - D @ solved[:, :-1])
        q = k[n:] - D @ solved[:, -1]
        if n:
            self.kernel.without_rounding(M, q)
        outcome, v = self._pairs(M, q)
        return outcome, np.concatenate([-(solved[:, -1] + solved[:, :-1] @ v), v])

    def _by_tableau(self) -> tuple[int, Vector]:
        """All free unknowns by pivots, the largest first."""
        reduction = Reduction(self.prepared, self.options.rank_tolerance)
        outcome, z = self._pairs(reduction.M, reduction.q)
        regular = reduction.outcome == self.kernel.COMPLEMENTARY
        return outcome if regular else reduction.outcome, reduction.recover(z)

    def _pairs(self, M: np.ndarray[Any, Any], q: Vector) -> tuple[int, Vector]:
        """Outcome and z of the LCP that remains."""
        kernel, m = self.kernel, q.size
        if m <= BY_VECTORS:
            z = np.empty(m)
            code = kernel.lemke(M, q, z, self._limit, *self._tolerances)
            self.pivots = code // kernel.CODES
            return code % kernel.CODES, z
        lemke = solvers.get("lemke")
        names = {
            "max_pivots": self._limit,
            "pivot_tolerance": self._tolerances[0],
            "tie_tolerance": self._tolerances[1],
        }
        found = lemke.run(LCP(M=M, q=q), self.budget, lemke.spec.options(**names))
        self.pivots = found.counters["pivots"]
        codes = {Claim.MAX_ITER: kernel.LIMIT, Claim.FAILED: kernel.RAY, Claim.INFEASIBLE: kernel.RAY}
        z = np.zeros(m) if found.point is None else found.point.z
        return codes.get(found.claim, kernel.COMPLEMENTARY), z


def _after_ray(prepared: ScaledMLCP, x: Vector, budget: Budget, counters: dict[str, int], what: str) -> SolverOutput:
    """Infeasible when the certificate holds; otherwise failed, for a ray proves nothing by itself."""
    after = f"{what} after {counters['pivots']} pivots"
    certificate = farkas(prepared, budget)
    if certificate is not None:
        message = f"{after}; y with Aᵀy + Dᵀz = 0, Cᵀy + Bᵀz ≤ 0, aᵀy + bᵀz < 0 proves that there is no solution"
        return SolverOutput(claim=Claim.INFEASIBLE, counters=counters, certificate=certificate, message=message)
    message = f"{after}, and no certificate of infeasibility: undecided"
    return conclude(prepared, x, budget, counters, otherwise=Claim.FAILED, message=message)
