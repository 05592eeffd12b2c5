"""Lemke's method on an MLCP: the free unknowns go into the basis for good, then complementary pivots on the pairs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.linear import LCP, MLCP, MLCPPoint
from cpbench.foundation.factorization import Factorization
from cpbench.foundation.matrices import Vector, dense
from cpbench.solvers.base import (
    Budget,
    Claim,
    Record,
    Solver,
    SolverOutput,
    SolverSpec,
    Trait,
    register,
    solved,
    solvers,
)
from cpbench_solvers.kernels import mlcp_pivoting
from cpbench_solvers.lcp.claims import after_ray, principal
from cpbench_solvers.lcp.lemke_run import LemkeOptions
from cpbench_solvers.mlcp.claims import ScaledMLCP, conclude, dense_obstacle, farkas, refined, scale

SMALL = 64
"""Up to this many unknowns one compiled call does it all; beyond, A is factored by LAPACK or SuperLU."""
BY_VECTORS = 250
"""Up to this many pairs Lemke's method is one compiled call; beyond, it is `lemke` with its matrix products."""
REGULAR = 1e-9
"""Reciprocal condition number of A from which it is eliminated by its factors."""


@dataclass(frozen=True)
class LemkeMLCPOptions:
    """Options of lemke-mlcp. `max_pivots` : 0 stands for 50m + 1000. `rank_tolerance` : entries up to this, in data
    scaled to size one, are no pivots for free unknowns. `pivot_tolerance`, `tie_tolerance` : of the ratio test, as
    for lemke. `tableau` : of more than 64 unknowns, free ones are eliminated in dense storage where A is singular."""

    max_pivots: int = 0
    rank_tolerance: float = 1e-10
    pivot_tolerance: float = 1e-11
    tie_tolerance: float = 1e-13
    tableau: bool = True


@dataclass(frozen=True, eq=False)
class PivotingData:
    """Scaled problem and the most pivots; of small problems, the vector that one compiled call, `whole`, works on."""

    scaled: ScaledMLCP
    limit: int
    data: Vector | None
    kernel: Any
    whole: Any


@register
class LemkeMLCP(Solver):
    """A may be singular: equalities and free unknowns without a pivot in A take pairs (v_i, w_i) with them, whose roles
    are exchanged. What remains is an LCP, monotone where the MLCP is, and independent of the order and the signs of
    the equalities. Lemke's method ends on it as it does on any LCP: in a solution, or in a ray that proves nothing by
    itself; a linear program then looks for a Farkas certificate.

    A start is the basis of its v that are positive beyond rounding. Where that is singular, or the pivots from there
    end elsewhere than in a solution, they begin again without it.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="lemke-mlcp",
        node="mlcp",
        summary="Lemke's complementary pivoting with free unknowns, singular A too",
        method="pivoting",
        citation="Lemke 1965; Cottle, Pang and Stone 1992, sections 2.3 and 4.4; Cao and Ferris 1996",
        traits=frozenset({Trait.WARM_START, Trait.DETERMINISTIC}),
        options=LemkeMLCPOptions,
    )

    def obstacle(self, problem: MLCP) -> str | None:
        return dense_obstacle(problem)

    def setup(self, problem: MLCP, budget: Budget, options: LemkeMLCPOptions) -> PivotingData:
        m, N = problem.b.size, problem.a.size + problem.b.size
        scaled = scale(problem, keep_sparse=N > SMALL)
        limit, data = options.max_pivots or 50 * m + 1000, None if N > SMALL else packed(scaled, options)
        kernel = mlcp_pivoting
        return PivotingData(scaled, limit, data, kernel, kernel.lemke_mixed)

    def solve(
        self,
        prepared: PivotingData,
        budget: Budget,
        options: LemkeMLCPOptions,
        start: Any = None,
        record: Record | None = None,
    ) -> SolverOutput:
        kernel, scaled, data = prepared.kernel, prepared.scaled, prepared.data
        if data is None:
            return _large(prepared, budget, options, start)
        answer = np.zeros(scaled.k.size) if start is None else np.concatenate([start.u, start.v])
        code: int = prepared.whole(data, answer, budget.iterations or prepared.limit, budget.tolerance)
        pivots, outcome = divmod(code, kernel.CODES)
        counters = {"iterations": pivots, "pivots": pivots, "factorizations": 0}
        x = answer / scaled.unit
        if outcome == kernel.RIGHT:  # a ray at the height of rounding errors, too
            if scaled.verdict(x) <= budget.tolerance:
                return solved(MLCPPoint(answer[: scaled.free], answer[scaled.free :]), counters)
            outcome = kernel.COMPLEMENTARY
        return _ended(scaled, x, outcome, budget, counters)


def packed(scaled: ScaledMLCP, options: LemkeMLCPOptions) -> Vector:
    """Return what the compiled call reads, and the room in which it works."""
    kernel, N = mlcp_pivoting, scaled.k.size
    numbers = [scaled.free, scaled.problem.v_unit, scaled.problem.equality_scale]
    numbers += [options.rank_tolerance, options.pivot_tolerance, options.tie_tolerance]
    room = np.empty(kernel.workspace(N, N - scaled.free))
    return np.concatenate([numbers, np.ravel(scaled.K), scaled.k, scaled.row_unit, scaled.unit, room])


def _large(prepared: PivotingData, budget: Budget, options: LemkeMLCPOptions, start: MLCPPoint | None) -> SolverOutput:
    """Start from the basis of the start, where it has one that ends in a solution, else from none."""
    kernel, scaled = prepared.kernel, prepared.scaled
    run = _Run(prepared, budget, options)
    v = np.zeros(0) if start is None else start.v / scaled.unit[scaled.free :]
    support = np.flatnonzero(v > kernel.IDLE * v.max(initial=0.0))
    outcome, x = run.of_basis(support) if support.size else (kernel.STUCK, np.zeros(scaled.k.size))
    error = scaled.error(x)
    if outcome != kernel.COMPLEMENTARY or not error <= budget.tolerance:
        outcome, x = run.of_basis(support[:0])
        if outcome == kernel.STUCK and options.tableau:
            outcome, x = run.by_tableau()
        error = scaled.error(x)
    counters = {"iterations": run.pivots, "pivots": run.pivots, "factorizations": run.factorizations}
    if error <= budget.tolerance:
        return conclude(scaled, x, budget, counters, error=error)
    return _ended(scaled, x, outcome, budget, counters)


def _ended(scaled: ScaledMLCP, x: Vector, outcome: int, budget: Budget, counters: dict[str, int]) -> SolverOutput:
    """Return the last word on an x that is not within the tolerance."""
    kernel = mlcp_pivoting
    if outcome in (kernel.RAY, kernel.INCONSISTENT):
        what = "ray" if outcome == kernel.RAY else "an equality without unknowns that is not zero,"
        proves = "y with Aᵀy + Dᵀz = 0, Cᵀy + Bᵀz ≤ 0, aᵀy + bᵀz < 0"
        output, message = after_ray(counters, farkas(scaled, budget), proves, what)
        return output or conclude(scaled, x, budget, counters, otherwise=Claim.FAILED, message=message)
    if outcome != kernel.COMPLEMENTARY:
        claim = Claim.MAX_ITER if outcome == kernel.LIMIT else Claim.FAILED
        message = {
            kernel.LIMIT: f"pivot limit after {counters['pivots']} pivots",
            kernel.STUCK: "free unknowns are left that no pivot brings into the basis: use newton-fb-mlcp",
        }.get(outcome, f"not finite after {counters['pivots']} pivots")
        return conclude(scaled, x, budget, counters, otherwise=claim, message=message)
    x, error = refined(scaled, x, scaled.error(x), budget.tolerance)
    counters["factorizations"] += 1
    return conclude(scaled, x, budget, counters, error=error)


class Reduction:
    """The free unknowns brought into the basis by pivots; the pairs that remain are an LCP of the scaled data.

    Attributes
    ----------
    M : (m, m). q : (m,). outcome : of `reduce` in the kernel.
    """

    def __init__(self, prepared: ScaledMLCP, rank_tolerance: float = LemkeMLCPOptions.rank_tolerance) -> None:
        self._kernel, self._free = mlcp_pivoting, prepared.free
        self._T = np.column_stack([dense(prepared.K), prepared.k])
        N = prepared.k.size
        m = N - prepared.free
        self._labels = (*np.empty((2, N), np.int64), *np.empty((2, m), np.int64))
        self.M, self.q = np.empty((m, m)), np.empty(m)
        self.outcome: int = self._kernel.reduce(self._T, prepared.free, *self._labels, rank_tolerance)
        self._kernel.remaining(self._T, *self._labels[2:], self.M, self.q)

    def recover(self, z: Vector) -> Vector:
        """Return x of the whole problem from z of the pairs."""
        x = np.empty(self._T.shape[0])
        self._kernel.recover(self._T, self._free, *self._labels, z, x)
        return x


class _Run:
    """Counters of a solve of a large problem: pivots, factorizations."""

    def __init__(self, prepared: PivotingData, budget: Budget, options: LemkeMLCPOptions) -> None:
        self._kernel, self._scaled = prepared.kernel, prepared.scaled
        self._budget, self._options = budget, options
        self._limit = budget.iterations or prepared.limit
        self.pivots = self.factorizations = 0

    def of_basis(self, support: Any) -> tuple[int, Vector]:
        """Return outcome and x, the free unknowns and the v of `support` being brought into the basis by a
        factorization.

        STUCK where the matrix of that basis is singular. With F these unknowns, R the other pairs and E the columns of
        the unit matrix of the support in F, x_F = −K_F⁻¹(k_F + K_FR v_R − E w_S): an LCP in (w_S, v_R).
        """
        K, k, n = self._scaled.K, self._scaled.k, self._scaled.free
        inside = np.zeros(k.size, np.bool_)
        inside[:n] = inside[n + support] = True
        F, R, s = np.flatnonzero(inside), np.flatnonzero(~inside), support.size
        factors = Factorization(K[:n, :n] if s == 0 else principal(K, F))
        self.factorizations += int(F.size > 0)
        if factors.rcond < REGULAR:
            return self._kernel.STUCK, np.zeros(k.size)
        across, rows = (K[:n, n:], K[n:, :n]) if s == 0 else (K[F][:, R], K[R][:, F])
        unit = np.zeros((F.size, s))
        unit[n:] = -np.eye(s)
        solved = factors.solve(np.column_stack([unit, dense(across), k[F]]))
        rest = (
            np.column_stack([np.zeros((R.size, s)), dense(K[n:, n:] if s == 0 else K[R][:, R])]) - rows @ solved[:, :-1]
        )
        M = np.ascontiguousarray(np.vstack([-solved[n:, :-1], rest]))
        q = np.concatenate([-solved[n:, -1], k[R] - rows @ solved[:, -1]])
        if F.size:
            self._kernel.without_rounding(M, q)
        outcome, z = self._pairs(M, q)
        x = np.empty(k.size)
        x[F], x[R] = -(solved[:, -1] + solved[:, :-1] @ z), z[s:]
        x[F[n:]] = np.where(z[:s] > 0.0, 0.0, np.maximum(x[F[n:]], 0.0))
        return outcome, x

    def by_tableau(self) -> tuple[int, Vector]:
        """Eliminate all free unknowns by pivots, the largest first."""
        reduction = Reduction(self._scaled, self._options.rank_tolerance)
        outcome, z = self._pairs(reduction.M, reduction.q)
        regular = reduction.outcome == self._kernel.COMPLEMENTARY
        return outcome if regular else reduction.outcome, reduction.recover(z)

    def _pairs(self, M: np.ndarray[Any, Any], q: Vector) -> tuple[int, Vector]:
        """Return outcome and z of the LCP that remains."""
        kernel, m, options = self._kernel, q.size, self._options
        if m <= BY_VECTORS:
            z = np.empty(m)
            code = kernel.lemke(M, q, z, self._limit, options.pivot_tolerance, options.tie_tolerance)
            self.pivots += code // kernel.CODES
            return code % kernel.CODES, z
        lemke_options = LemkeOptions(self._limit, options.pivot_tolerance, options.tie_tolerance)
        solution = solvers.get("lemke").run(LCP(M=M, q=q), self._budget, lemke_options)
        self.pivots += solution.counters["pivots"]
        codes = {Claim.MAX_ITER: kernel.LIMIT, Claim.FAILED: kernel.RAY, Claim.INFEASIBLE: kernel.RAY}
        z = np.zeros(m) if solution.point is None else solution.point.z
        return codes.get(solution.claim, kernel.COMPLEMENTARY), z
