"""Conjugate gradients on faces of a box (MPRGP), for LCPs with symmetric positive semidefinite M: the minimum of
½zᵀMz + qᵀz over z ≥ 0. What the solvers of box-constrained QPs share with them is here too.

Unknowns are scaled so that the diagonal is about 1; products with M are all that is asked of it.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.linear import LCP, LCPPoint
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Vector, max_abs
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, register
from cpbench.solvers.shared.progress import Progress, next_stop, reduced
from cpbench_solvers.kernels import mprgp
from cpbench_solvers.lcp.claims import CLOSE, conclude, dense_obstacle, error_of, farkas, recorded
from cpbench_solvers.traits import ITERATIVE

CHUNK = 256
"""The most steps between two measurements in full, and with one gradient."""


@dataclass(frozen=True)
class MPRGPOptions:
    """Options of mprgp, mprgp-qp. `projected` : a face is expanded by projecting the step of conjugate gradients.
    `gamma` : Γ, how much the chopped gradient may outweigh the free one before unknowns are released. `length` : of
    the step that expands a face otherwise, over 1/‖M‖, in ]0, 2]. `max_iterations` : steps of any kind.
    `stall_window` : steps without gain after which it gives up."""

    projected: bool = False
    gamma: float = 1.0
    length: float = 1.9
    max_iterations: int = 100_000
    stall_window: int = 5000


@dataclass(frozen=True)
class ScaledBox:
    """min ½xᵀAx + qᵀx, lower ≤ x ≤ upper, with z = unit·x of the problem.

    `matrix` : A by rows: start, columns and values; the first two are empty where A is dense. `size` : what a
    projected gradient of the problem is small against.
    """

    problem: Any
    matrix: tuple[Any, ...]
    q: Vector
    lower: Vector
    upper: Vector
    unit: Vector
    size: float


def scaled_box(problem: Any, A: Matrix, q: Vector, lower: Vector, upper: Vector, size: float) -> ScaledBox:
    """Return the data in units in which the diagonal of A is about 1 or 0: powers of 2, so that bounds stay exact."""
    diagonal = np.array(A.diagonal())
    unit = np.ldexp(1.0, -(np.frexp(np.where(diagonal > 0, diagonal, 1.0))[1] // 2))
    scaled = matrices.scaled_both(A, unit)
    if sp.issparse(scaled):
        matrix = scaled.indptr.astype(np.int64), scaled.indices.astype(np.int64), scaled.data
    else:
        matrix = np.zeros(0, np.int64), np.zeros(0, np.int64), np.ascontiguousarray(scaled).ravel()
    return ScaledBox(problem, matrix, q * unit, lower / unit, upper / unit, unit, size or 1.0)


def definite_obstacle(A: Matrix, symmetric: bool, instead: str) -> str | None:
    """Return why A cannot be symmetric and positive semidefinite, as far as that is cheap to tell."""
    if not symmetric:
        return f"needs a symmetric matrix, asymmetry = {matrices.asymmetry(A):.1e}: use {instead}"
    diagonal = A.diagonal()
    if diagonal.size and diagonal.min() < 0:
        i = int(diagonal.argmin())
        return f"needs a positive semidefinite matrix, entry ({i}, {i}) is {diagonal[i]:g}: use {instead}"
    return None


@dataclass(frozen=True)
class MinimizationResult:
    """Result of `minimize`: the best z that was measured, and where the objective may fall for ever."""

    z: Vector
    error: float
    claim: Claim
    message: str
    counters: dict[str, int]
    ray: Vector | None = None


def _begun(kernel: Any, box: ScaledBox, length: float, first: Vector) -> tuple[Vector, ...]:
    """Return x of a start within the bounds, and what steps write: state, workspace, gradient and direction."""
    n = box.q.size
    x = np.minimum(np.maximum(first / box.unit, box.lower), box.upper)
    state, work = np.zeros(kernel.STATES), np.zeros((3, n))
    state[kernel.LENGTH] = length
    # a fixed vector without structure: two runs find the same length of step
    kernel.power(*box.matrix, np.cos(np.arange(n)), work[0], state)
    return x, state, work, np.empty(n), np.empty(n)


def minimize(
    box: ScaledBox,
    options: MPRGPOptions,
    budget: Budget,
    first: Vector,
    error_of: Callable[[Vector], float],
    point: Callable[[Vector], Any],
    record: Record | None,
) -> MinimizationResult:
    """Take steps until the error, measured in every chunk and where the gradient is small, is within the tolerance."""
    kernel = mprgp
    x, state, work, g, p = _begun(kernel, box, options.length, first)
    matrix, law, weight = box.matrix, (box.q, box.lower, box.upper), 1.0 / box.unit
    limit, deadline = budget.iterations or options.max_iterations, time.monotonic() + budget.seconds
    progress, done, threshold = Progress(options.stall_window), 0, budget.tolerance * box.size
    best, error = x * box.unit, error_of(x * box.unit)
    least, ray, claim, message = error, None, Claim.MAX_ITER, f"{limit} steps"
    if record is not None:
        record(0, error, lambda: point(x * box.unit))
    while least > budget.tolerance and done < limit:
        kernel.multiply(*matrix, x, g, state)
        # afresh in every chunk: the gradient that steps update drifts from Ax + q
        g += box.q
        p[:] = np.where((box.lower < x) & (x < box.upper), g, 0.0)
        until, outcome, before = min(limit, done + CHUNK), kernel.LIMIT, done
        while done < until and outcome == kernel.LIMIT:
            most = next_stop(done, until, record) - done
            rest = (options.gamma, options.projected, threshold, most)
            code = kernel.run(*matrix, *law, weight, x, g, p, work, state, *rest)
            done, outcome = done + code // kernel.CODES, code % kernel.CODES
            if record is not None and done < until and outcome == kernel.LIMIT:
                record(done, np.nan, lambda: point(x * box.unit))
        error = error_of(x * box.unit)
        if record is not None and done > before:
            record(done, error, lambda: point(x * box.unit))
        if error < least:
            best, least = x * box.unit, error
        why = progress.trouble(done, error)
        # where it stands still far from a solution, x itself may show the way in which the objective falls for ever
        if why is not None and least > CLOSE * budget.tolerance:
            ray = x * box.unit
        if outcome == kernel.RAY:
            ray, why = -p * box.unit, f"a direction without curvature and bound after {done} steps"
        elif outcome == kernel.SETTLED:
            # the projected gradient said that it was done, and the measured error does not: by as much as that is too
            # large
            threshold = reduced(threshold, error, budget.tolerance)
            if threshold < 1e-18 * box.size and why is None:
                why = f"stalled at {least:.1e} after {done} steps: the gradient is lost in rounding"
        if why is None and time.monotonic() > deadline:
            why = f"out of time after {done} steps"
        if why is not None and least > budget.tolerance:
            claim, message = Claim.FAILED, why
            break
    counters = {
        "iterations": done,
        "matrix_vector_products": int(state[kernel.PRODUCTS]),
        "expansions": int(state[kernel.EXPANSIONS]),
        "releases": int(state[kernel.RELEASES]),
    }
    return MinimizationResult(best, least, claim, message, counters, ray)


@register
class MPRGP(Solver):
    """Faces are expanded by steps of fixed length along the free gradient, whose rate is that of the condition number,
    or by projecting the whole step of conjugate gradients, as long as that descends."""

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="mprgp",
        node="lcp",
        summary="modified proportioning with reduced gradient projections, M symmetric positive semidefinite",
        method="projection",
        citation="Dostál and Schöberl 2005, Comput. Optim. Appl. 30:23; Polyak 1969; "
        "Kružík, Horák, Čermák, Pospíšil and Pecha 2020, Adv. Eng. Softw. 149:102895",
        traits=ITERATIVE,
        options=MPRGPOptions,
    )

    def obstacle(self, problem: LCP) -> str | None:
        if not sp.issparse(problem.M) and (why := dense_obstacle(problem)) is not None:
            return why
        return definite_obstacle(problem.M, problem.symmetric, "lemke or newton-min")

    def setup(self, problem: LCP, budget: Budget, options: MPRGPOptions) -> ScaledBox:
        n = problem.q.size
        return scaled_box(problem, problem.M, problem.q, np.zeros(n), np.full(n, np.inf), max_abs(problem.q))

    def solve(
        self,
        prepared: ScaledBox,
        budget: Budget,
        options: MPRGPOptions,
        start: Any = None,
        record: Record | None = None,
    ) -> SolverOutput:
        problem: LCP = prepared.problem
        first = np.zeros(problem.q.size) if start is None else start.z
        measure = lambda z: error_of(problem, z, budget.tolerance)  # noqa: E731
        ended = minimize(prepared, options, budget, first, measure, LCPPoint, record)
        message = ended.message
        if ended.ray is not None:
            y = np.maximum(ended.ray, 0.0)
            certificate = y if problem.certifies_infeasibility(y) else farkas(problem, budget)
            if certificate is not None:
                return SolverOutput(
                    claim=Claim.INFEASIBLE,
                    counters=ended.counters,
                    certificate=certificate,
                    message=f"{message}; y ≥ 0, Mᵀy ≤ 0, qᵀy < 0 to rounding (Farkas)",
                )
            message += ", and no certificate that there is no solution"
        output = conclude(
            problem, ended.z, budget, ended.counters, error=ended.error, otherwise=ended.claim, message=message
        )
        return recorded(output, ended.z, problem, record, ended.counters["iterations"] + 1)
