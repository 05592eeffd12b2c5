"""Nonsmooth Gauss–Seidel on frictional contact: one contact after the other is solved exactly, until all agree."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.contact import FCPoint
from cpbench.formulations.fc import FrictionContact
from cpbench.matrices import Dense, Vector
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register
from cpbench.solvers.native.progress import Progress
from cpbench.solvers.options import fixed, searched

SINGULAR = 1e-12
"""Relative to the block's largest entry: W_NN below it cannot carry the normal equation; S below it is regularised."""
BLOCKS_A_CALL = 4_000_000
"""About 20 ms of block products between two looks at the clock."""
FINE, MARGIN = 1e-11, 0.999
"""Two evaluations of the error in different order agree to this share of a tolerance that is not finer than this."""
LOG = 256
"""Error evaluations a call can log."""


@dataclass(frozen=True)
class NSGSOptions:
    """`omega` : relaxation of every contact's change. `shuffle` : a new random order for every sweep.
    `max_iterations` : sweeps. `stall_window` : sweeps without gain after which it gives up."""

    omega: float = searched(1.0, low=0.5, high=1.9)
    shuffle: bool = False
    max_iterations: int = fixed(100_000)
    stall_window: int = fixed(10_000)


@dataclass(frozen=True)
class BlockRows:
    """W by rows of blocks, the diagonal ones apart, and what the one-contact problem needs of these.

    Attributes
    ----------
    start, column, blocks : block-CSR without the diagonal. diagonal : (nc, d·d). local : (nc, 12).
    """

    problem: FrictionContact
    start: np.ndarray[Any, np.dtype[np.uint64]]
    column: np.ndarray[Any, np.dtype[np.uint32]]
    blocks: Vector
    diagonal: Dense
    local: Dense


@register
class NSGS(Solver):
    """Block Gauss–Seidel with exact one-contact solves; W may be nonsymmetric, its diagonal blocks singular.

    Converges in practice for most W ⪰ 0, linearly and slowly where contacts are hyperstatic. A contact whose
    W_NN is not positive takes a step of the natural map instead.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="nsgs",
        node="fc",
        summary="nonsmooth Gauss-Seidel, exact one-contact solves",
        method="splitting",
        citation="Jean and Moreau 1987; Jourdan, Alart and Jean 1998, CMAME 155:31",
        traits=frozenset({Trait.SPARSE, Trait.WARM_START, Trait.HISTORY, Trait.DETERMINISTIC}),
        options=NSGSOptions,
    )

    def setup(self, problem: FrictionContact, budget: Budget, options: NSGSOptions) -> BlockRows:
        d, nc = problem.dimension, problem.nc
        if nc == 0:
            none = np.zeros(0)
            return BlockRows(
                problem, np.zeros(1, np.uint64), np.zeros(0, np.uint32), none, none.reshape(0, d * d), none
            )
        W = sp.bsr_array(problem.W, blocksize=(d, d))
        W.sort_indices()
        row = np.repeat(np.arange(nc), np.diff(W.indptr))
        off = W.indices != row
        start = np.concatenate([[0], np.cumsum(np.bincount(row[off], minlength=nc))])
        return BlockRows(
            problem,
            start.astype(np.uint64),
            W.indices[off].astype(np.uint32),
            np.ascontiguousarray(W.data[off]).ravel(),
            problem.diagonal_blocks.reshape(nc, d * d),
            _local_3d(problem.diagonal_blocks) if d == 3 else np.zeros((nc, 0)),
        )

    def warmup(self) -> None:
        for d in (2, 3):
            q = np.zeros(d)
            q[0] = -1.0
            self.run(FrictionContact(W=np.eye(d), q=q, mu=np.array([0.5]), dimension=d))

    def solve(
        self,
        prepared: BlockRows,
        budget: Budget,
        options: NSGSOptions,
        start: Any | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        problem = prepared.problem
        r = np.zeros(problem.q.size) if start is None else np.array(start.r)
        if problem.nc == 0:
            return SolverOutput(claim=Claim.SOLVED, point=FCPoint(r), counters={"iterations": 0})
        from cpbench.kernel_cache import load

        kernel = load("cpbench.solvers.kernels.gauss_seidel")
        sweeps = kernel.sweeps_3d if problem.dimension == 3 else kernel.sweeps_2d
        limit = budget.iterations or options.max_iterations
        call = max(50, BLOCKS_A_CALL // (prepared.column.size + 10 * problem.nc))
        lam, order = np.zeros(problem.nc), np.arange(problem.nc)
        state = np.array([0, 1, 0, budget.seed])
        log_iteration, log_error = np.zeros(LOG, np.int64), np.zeros(LOG)
        matrix = (prepared.start, prepared.column, prepared.blocks, prepared.diagonal)
        law = (problem.q, problem.mu, problem.rho)
        progress = Progress(options.stall_window)
        deadline = time.monotonic() + budget.seconds
        evaluations = 1
        claim, message = Claim.MAX_ITER, f"{limit} sweeps"
        error = kernel.judged(*matrix, *law, r, problem.dimension)
        if record is not None:
            record(0, error, lambda: FCPoint(r))
        while not error <= budget.tolerance and state[0] < limit:
            until = min(limit, int(state[0]) + call)
            while True:
                room = LOG if record is None else int(state[2]) + 1  # with one place left it is back at its next check
                log = (log_iteration[:room], log_error[:room])
                status = sweeps(
                    *matrix,
                    prepared.local,
                    *law,
                    r,
                    lam,
                    order,
                    options.omega,
                    options.shuffle,
                    budget.tolerance,
                    until,
                    state,
                    *log,
                )
                if record is not None:
                    record(int(state[0]), float(log_error[room - 1]), lambda: FCPoint(r))
                if record is None or status != kernel.CONTINUE or state[0] == until or room == LOG:
                    break
            why = None
            for k in range(int(state[2])):
                error = float(log_error[k])
                why = why or progress.trouble(int(log_iteration[k]), error)
            evaluations += int(state[2])
            state[2] = 0
            if why is None and time.monotonic() > deadline:
                why = f"out of time after {state[0]} sweeps"
            if why is not None:
                claim, message = Claim.FAILED, why
                break
        if error <= budget.tolerance:
            claim, message = Claim.INACCURATE, "converged up to rounding"
        done = int(state[0])
        counters = {
            "iterations": done,
            "projections": done * problem.nc,
            "matrix_vector_products": evaluations,
        }
        return _conclude(problem, r, error, budget, claim, message, counters)


def _conclude(
    problem: FrictionContact,
    r: Vector,
    error: float,
    budget: Budget,
    claim: Claim,
    message: str,
    counters: dict[str, int],
) -> SolverOutput:
    """Solved exactly when the judged error of r is at most the tolerance.

    The kernel's error is the same formula; only where rounding could part the two is it measured afresh.
    """
    if not np.isfinite(r).all():
        return SolverOutput(claim=Claim.FAILED, counters=counters, message=message)
    point = FCPoint(r)
    if not (budget.tolerance >= FINE and error <= MARGIN * budget.tolerance):
        error = problem.residuals(point, budget.tolerance).error
    if error <= budget.tolerance:
        return SolverOutput(claim=Claim.SOLVED, point=point, counters=counters)
    return SolverOutput(claim=claim, point=point, counters=counters, message=f"{message}, error {error:.1e}")


def _local_3d(D: Dense) -> Dense:
    """The twelve constants of every contact (`local` of the kernel) from the diagonal blocks, shape (nc, 3, 3)."""
    nc = D.shape[0]
    local = np.zeros((nc, 12))
    top = np.abs(D).max(axis=(1, 2))
    normal = D[:, 0, 0]
    bad = ~(normal > SINGULAR * top)
    inverse = 1.0 / np.where(bad, 1.0, normal)
    to_tangent, to_normal = D[:, 1:, 0] * inverse[:, None], D[:, 0, 1:] * inverse[:, None]
    S = D[:, 1:, 1:] - D[:, 1:, :1] * to_normal[:, None, :]
    mean, half = 0.5 * (S[:, 0, 0] + S[:, 1, 1]), 0.5 * (S[:, 0, 0] - S[:, 1, 1])
    radicand = half * half + S[:, 0, 1] * S[:, 1, 0]
    # complex eigenvalues never make S + λI singular for a real λ; then the bound is only about the real part
    least = mean - np.sqrt(np.maximum(radicand, 0.0))
    size = np.where(top > 0, top, 1.0)
    indefinite = (least < -SINGULAR * size) & (radicand >= 0)
    singular = np.abs(S[:, 0, 0] * S[:, 1, 1] - S[:, 0, 1] * S[:, 1, 0]) <= SINGULAR * size * size
    local[:, 0] = bad
    local[:, 1] = inverse
    local[:, 2:6] = S.reshape(nc, 4)
    local[:, 6:8] = to_tangent
    local[:, 8:10] = to_normal
    local[:, 10] = np.where(indefinite, -least * (1 + SINGULAR), np.where(singular, SINGULAR * size, 0.0))
    local[:, 11] = indefinite
    return local
