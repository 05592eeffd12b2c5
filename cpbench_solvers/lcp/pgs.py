"""Projected Gauss–Seidel and (symmetric) SOR on an LCP: z_i ← max(0, z_i - ω w_i/M_ii), one after the other."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.linear import LCP, LCPPoint
from cpbench.foundation.matrices import Matrix, Vector
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, register
from cpbench.solvers.shared.progress import Progress, next_stop, reduced
from cpbench_solvers.kernels import splitting
from cpbench_solvers.lcp.claims import conclude, dense_obstacle, error_of, recorded
from cpbench_solvers.traits import ITERATIVE

CHUNK = 256
"""The most sweeps with one w, and without a look at the progress."""
FEW = 16
"""Sweeps before the first look at the clock; later there is one whenever their number has doubled."""


@dataclass(frozen=True)
class PGSOptions:
    """Options of pgs, pgs-mlcp. `max_iterations` : sweeps. `stall_window` : sweeps without gain that end a run."""

    max_iterations: int = 100_000
    stall_window: int = 5000


@dataclass(frozen=True)
class PSOROptions(PGSOptions):
    """Options of psor. `omega` : over-relaxation, in ]0, 2[. `symmetric` : every sweep goes forth and back, so that the
    order of the unknowns matters less."""

    omega: float = 1.3
    symmetric: bool = False


@dataclass(frozen=True)
class MatrixColumns:
    """M by columns, and its diagonal."""

    problem: LCP
    diagonal: Vector
    matrix: tuple[Any, ...]


def by_columns(M: Matrix) -> tuple[Any, ...]:
    """Return a square M as the kernels of splittings take it (`COLUMNS`)."""
    if not sp.issparse(M):
        return (np.ascontiguousarray(M.T),)
    csc = sp.csc_array(M)
    return csc.indptr.astype(np.int64), csc.indices.astype(np.int64), csc.data


def diagonal_obstacle(what: str, diagonal: Vector, instead: str) -> str | None:
    """Return why the matrix `what`, of one letter or with words behind it, cannot be swept over, else None."""
    bad = np.flatnonzero(~(diagonal > 0))
    if bad.size == 0:
        return None
    entry = f"{what[0]}[{bad[0]},{bad[0]}] = {diagonal[bad[0]]:g} ({bad.size} of {diagonal.size})"
    return f"needs a positive diagonal of {what}, {entry}: use {instead}"


class _Splitting(Solver):
    """Base of the splitting methods, which differ by their relaxation."""

    def obstacle(self, problem: LCP) -> str | None:
        if not sp.issparse(problem.M) and (why := dense_obstacle(problem)) is not None:
            return why
        return diagonal_obstacle("M", problem.M.diagonal(), "lemke or newton-min")

    def setup(self, problem: LCP, budget: Budget, options: Any) -> MatrixColumns:
        return MatrixColumns(problem, np.array(problem.M.diagonal()), by_columns(problem.M))

    def solve(
        self,
        prepared: MatrixColumns,
        budget: Budget,
        options: PGSOptions,
        start: Any = None,
        record: Record | None = None,
    ) -> SolverOutput:
        kernel, problem, q = splitting, prepared.problem, prepared.problem.q
        relaxed = options if isinstance(options, PSOROptions) else PSOROptions(omega=1.0)
        law, how = (prepared.matrix, prepared.diagonal, q), (problem.z_unit, relaxed.omega, relaxed.symmetric)
        z, w = np.zeros(q.size) if start is None else np.maximum(start.z, 0.0), np.empty(q.size)
        limit = budget.iterations or options.max_iterations
        deadline = time.monotonic() + budget.seconds
        progress = Progress(options.stall_window)
        sweeps, products, aim, known = 0, 0, budget.tolerance, None
        claim, message = Claim.MAX_ITER, f"{limit} sweeps"
        while True:
            # the kernel's w drifts by rounding, so it starts afresh in every chunk and an end is confirmed here
            error, products = kernel.afresh(prepared.matrix, q, z, problem.z_unit, w), products + 1
            if record is not None and not sweeps:
                record(0, error, lambda: LCPPoint(z))
            if error <= aim:
                error, products = error_of(problem, z, budget.tolerance), products + 1
                if error <= budget.tolerance:
                    known = error
                    break
                aim = reduced(aim, error, budget.tolerance)
            if sweeps >= limit:
                break
            until = min(limit, sweeps + CHUNK)
            while sweeps < until and error > aim and time.monotonic() <= deadline:
                errors = np.empty(next_stop(sweeps, min(until, 2 * sweeps + FEW), record) - sweeps)
                done = kernel.sweeps(*law, z, w, *how, aim, errors)
                sweeps, error = sweeps + done, float(errors[done - 1])
                if record is not None:
                    record(sweeps, error, lambda: LCPPoint(z))
            why = progress.trouble(sweeps, error)
            if why is None and sweeps < until and error > aim:
                why = f"out of time after {sweeps} sweeps"
            if why is not None:
                claim, message = Claim.FAILED, why
                break
        counters = {"iterations": sweeps, "matrix_vector_products": products}
        output = conclude(problem, z, budget, counters, error=known, otherwise=claim, message=message)
        return recorded(output, z, problem, record, sweeps + 1)


_spec = partial(SolverSpec, node="lcp", method="splitting", traits=ITERATIVE)


@register
class PGS(_Splitting):
    """A method that converges for symmetric positive definite and for H-matrices with positive diagonal."""

    spec: ClassVar[SolverSpec] = _spec(
        name="pgs",
        summary="projected Gauss-Seidel",
        citation="Cryer 1971; Cottle, Pang and Stone 1992, section 5.2",
        options=PGSOptions,
    )


@register
class PSOR(_Splitting):
    """Over-relaxed by ω: faster on some problems, divergent on others."""

    spec: ClassVar[SolverSpec] = _spec(
        name="psor",
        summary="projected successive over-relaxation",
        citation="Cryer 1971; Mangasarian 1977, J. Optim. Theory Appl. 22:465",
        options=PSOROptions,
    )
