"""Projected Gauss–Seidel on an MLCP: u_i ← u_i − ω r_i/A_ii, v_i ← max(0, v_i − ω w_i/B_ii), one after the other.

The order of the equalities means nothing, so that where A has zeros on its diagonal they are put into an order that
has as large entries there as can be.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp
from scipy.sparse import csgraph

from cpbench.formulations.linear import MLCP
from cpbench.foundation import matrices
from cpbench.foundation.factorization import has_full_structural_rank
from cpbench.foundation.matrices import Vector, sparse
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, register
from cpbench.solvers.shared.progress import Progress, next_stop, reduced
from cpbench_solvers.kernels import mlcp_splitting
from cpbench_solvers.lcp.pgs import PGSOptions, by_columns, diagonal_obstacle
from cpbench_solvers.mlcp.claims import ScaledMLCP, conclude, dense_obstacle, scale
from cpbench_solvers.traits import ITERATIVE

CHUNK = 256
"""The most sweeps with the same Kx, which drifts by rounding, and without a look at clock and progress."""


@dataclass(frozen=True)
class PGSMLCPOptions(PGSOptions):
    """Options of pgs-mlcp. `omega` : relaxation, in ]0, 2[, of which more than 1 is faster on some problems and
    diverges on others."""

    omega: float = 1.0


@dataclass(frozen=True)
class BasisColumns:
    """K by columns (`by_columns`) and its diagonal."""

    scaled: ScaledMLCP
    matrix: tuple[Any, ...]
    diagonal: Vector


@register
class PGSMLCP(Solver):
    """A method that converges for symmetric positive definite [[A, C], [D, B]], or H-matrices of positive diagonal."""

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="pgs-mlcp",
        node="mlcp",
        summary="projected Gauss-Seidel over equalities and pairs",
        method="splitting",
        citation="Cryer 1971; Mangasarian 1977; Cottle, Pang and Stone 1992, section 5.2",
        traits=ITERATIVE,
        options=PGSMLCPOptions,
    )

    def obstacle(self, problem: MLCP) -> str | None:
        stored = (problem.A, problem.B, problem.C, problem.D)
        if not any(matrices.is_sparse(M) for M in stored) and (why := dense_obstacle(problem)) is not None:
            return why
        if why := diagonal_obstacle("B", problem.B.diagonal(), "lemke-mlcp or newton-min-mlcp"):
            return why
        A = sparse(problem.A)
        if not A.data.all():
            A = A.copy()
            A.eliminate_zeros()
        if has_full_structural_rank(A):
            return None
        return "no order of the equalities has nonzero numbers on the diagonal of A: use lemke-mlcp or newton-min-mlcp"

    def setup(self, problem: MLCP, budget: Budget, options: PGSMLCPOptions) -> BasisColumns:
        scaled = _ordered(scale(problem, keep_sparse=True))
        return BasisColumns(scaled, by_columns(scaled.K), np.array(scaled.K.diagonal()))

    def solve(
        self,
        prepared: BasisColumns,
        budget: Budget,
        options: PGSMLCPOptions,
        start: Any = None,
        record: Record | None = None,
    ) -> SolverOutput:
        sweep = mlcp_splitting.sweeps
        scaled, n = prepared.scaled, prepared.scaled.free
        units = scaled.row_unit, scaled.unit, scaled.problem.v_unit, scaled.problem.equality_scale
        law = prepared.matrix, prepared.diagonal, scaled.k, n, *units
        x = scaled.start(start)
        best, least = x, scaled.error(x, budget.tolerance)
        limit = budget.iterations or options.max_iterations
        progress = Progress(options.stall_window, budget.seconds, "sweeps")
        sweeps, products, chunk = 0, 1, 4
        if record is not None:
            record(0, least, lambda: scaled.point(x))
        claim, message, aim = Claim.MAX_ITER, f"{limit} sweeps", budget.tolerance
        x = np.array(x)
        while not least <= budget.tolerance and sweeps < limit:
            until = min(limit, sweeps + chunk)
            of_u, of_v = scaled.K[:, :n] @ x[:n], scaled.K[:, n:] @ x[n:]
            error = np.inf
            while sweeps < until and error > aim:
                errors = np.empty(next_stop(sweeps, until, record) - sweeps)
                done = sweep(*law, x, of_u, of_v, options.omega, aim, errors)
                sweeps, error = sweeps + done, float(errors[done - 1])
                if record is not None:
                    record(sweeps, error, lambda: scaled.point(x))
            products, chunk = products + 1, min(2 * chunk, CHUNK)
            why = progress.trouble(sweeps, error)
            if error < least and (reached := scaled.error(x, budget.tolerance)) < least:
                best, least = np.array(x), reached
            if error <= aim:
                aim = reduced(aim, least, budget.tolerance)
            if why is not None:
                claim, message = Claim.FAILED, why
                break
        counters = {"iterations": sweeps, "matrix_vector_products": products}
        return conclude(scaled, best, budget, counters, error=least, otherwise=claim, message=message)


def _ordered(scaled: ScaledMLCP) -> ScaledMLCP:
    """Order the equalities by the largest product of diagonal entries of A, where it has a zero there."""
    n, K = scaled.free, scaled.K
    A = sparse(K[:n, :n])
    if A.diagonal().all():
        return scaled
    A = sp.csr_array(A, copy=True)
    A.eliminate_zeros()
    if not has_full_structural_rank(A):
        return scaled
    A.data = 1.0 - np.log(np.abs(A.data) / np.abs(A.data).max())
    row, column = csgraph.min_weight_full_bipartite_matching(A)
    order = np.arange(K.shape[0])
    order[column] = row
    return replace(scaled, K=K[order], k=scaled.k[order], row_unit=scaled.row_unit[order])
