"""Base of solvers of frictional contact: W by rows of blocks, sweeps of NSGS over it, and what they conclude."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cpbench.formulations.contact import FCPoint, LocalContact
from cpbench.formulations.local_contact import FrictionContact
from cpbench.foundation.matrices import Dense, Matrix, Vector, scaled_both, sparse
from cpbench.solvers.base import Budget, Claim, SolverOutput, solved
from cpbench_solvers.kernels import anderson, block_layout, contact_error, gauss_seidel

APART = 1e-11
"""Two evaluations of the error, whose sums are made in different order, are less than this apart."""
MEMORY = 15
"""Columns of Anderson's acceleration. Of 25 choices of this (5 to 20) and of the kernel's constants, the one with the
fewest sweeps to 1e-4 and 1e-8 on 18 real files: 195 in the geometric mean, 6000 where it did not get there; the others
201 to 322."""
ROUNDED = "converged up to rounding"
LOG = 256
"""Error evaluations a call of the sweeps can log."""


CONTINUE, NOT_FINITE = 0, 2
ITERATION, NEXT_CHECK, LOGGED, RANDOM, SEEN, PLACES = 0, 1, 2, 3, 5, 6
PACE, LEAST, FIRST = 0, 2, 4
"""Of what the sweeps return, of `state` and of `measured`: the names of the kernels, in `sweep_progress`."""


class Sweeping(NamedTuple):
    """A way to sweep: the kernel, its first arguments, how many numbers it remembers, and where its answer is."""

    kernel: Callable[..., Any]
    arguments: tuple[Any, ...]
    size: int
    answer: slice


@dataclass(eq=False)  # not frozen: objects that are take longer to make than a small problem to solve
class BlockRows:
    """W by rows of blocks, the diagonal ones apart, and what the one-contact problem needs of these.

    Attributes
    ----------
    start, column, blocks : block-CSR without the diagonal. diagonal : (nc, d·d). local : (nc, 12). rho : (nc,).
    matrix : W as kernels take it. law : first arguments of every kernel of sweeps. order : 0, 1, ..., nc − 1.
    """

    problem: FrictionContact
    start: np.ndarray[Any, np.dtype[np.uint64]]
    column: np.ndarray[Any, np.dtype[np.uint32]]
    blocks: Vector
    diagonal: Dense
    local: Dense
    rho: Vector

    def __post_init__(self) -> None:
        problem = self.problem
        self.matrix = self.start, self.column, self.blocks, self.diagonal
        self.law = (*self.matrix, self.local, problem.q, problem.mu, self.rho)
        self.order = np.arange(self.rho.size)

    def judged_error(self, r: Vector) -> float:
        """Return the error of the reactions r, shape (nc·d,), as `residuals` of the problem measures it."""
        *matrix, _, q, mu, rho = self.law
        return contact_error.judged(*matrix, q, mu, rho, r, self.problem.dimension)

    @property
    def accelerated(self) -> Sweeping:
        """Sweeps with Anderson's acceleration."""
        return self.sweeping(self.order)

    @property
    def plain(self) -> Sweeping:
        """Sweeps without acceleration."""
        return self.sweeping(self.order, 0)

    def sweeping(self, order: NDArray[np.int64], most: int = MEMORY) -> Sweeping:
        """Return sweeps over the contacts in this order; Anderson's acceleration keeps `most` differences (0: none)."""
        n = self.problem.q.size
        memory = min(most, n)
        size = anderson.work_size(n, self.problem.nc, memory)
        arguments = (*self.law, order, memory, self.problem.dimension)
        return Sweeping(anderson.accelerated, arguments, size, slice(anderson.ANSWER, anderson.ANSWER + n))


class Sweeps:
    """NSGS over the contacts in their order, in pieces; it remembers the multipliers of sliding between them."""

    def __init__(self, rows: BlockRows) -> None:
        self._rows = rows
        problem = rows.problem
        self._sweeps = gauss_seidel.sweeps_3d if problem.dimension == 3 else gauss_seidel.sweeps_2d
        self._lam = np.zeros(problem.nc)
        self._log = np.zeros(LOG, np.int64), np.zeros(LOG)
        # no error is below 0: nothing is kept
        self._best = np.zeros(problem.q.size)
        self.done = self.evaluations = 0
        self._measured = np.array([np.inf, np.inf, 0.0])

    def sweep(self, r: Vector, count: int, tolerance: float) -> float:
        """Sweep in place on r until its judged error, which is returned, is at most `tolerance`, or `count` times."""
        rows, state = self._rows, np.array([0, count, 0, 0, 0, 0])  # the error is evaluated at the end
        iterate, kept = (r, self._lam, rows.order), (self._measured, *self._log, self._best)
        self._sweeps(*rows.law, *iterate, 1.0, False, tolerance, count, state, *kept)
        self.done += int(state[ITERATION])
        self.evaluations += int(state[LOGGED])
        return float(self._log[1][state[LOGGED] - 1])


@dataclass(frozen=True)
class SweepState:
    """Arrays that sweeps write: reactions, multipliers of sliding, `state` and `measured`, and the best reactions."""

    r: Vector
    lam: Vector
    state: NDArray[np.int64]
    measured: Vector
    best: Vector

    @classmethod
    def initial(cls, r: Vector, contacts: int, seed: int) -> SweepState:
        """Return the state before the first sweep."""
        state, measured = np.zeros(PLACES, np.int64), np.full(3, np.inf)
        state[NEXT_CHECK], state[RANDOM], measured[PACE] = FIRST, seed, 0.0
        return cls(r, np.zeros(contacts), state, measured, r.copy())


class AcceleratedSweeps:
    """Sweeps with Anderson's acceleration, in pieces, from `start` or from 0; see the kernel `anderson`."""

    done, error, seen = 0, math.inf, 0
    """Sweeps, the judged error of `best`, ∞ before the first, and contacts seen for errors."""

    def __init__(self, rows: BlockRows, start: Vector | None = None, way: Sweeping | None = None) -> None:
        self._rows = rows
        self._way = way = way or rows.accelerated
        self._work = work = np.empty(way.size)
        self.best = work[way.answer]
        work[0] = 0.0
        if start is not None:
            work[0], self.best[:] = 1.0, start

    def sweep(self, count: int, tolerance: float, look: Callable[[], None] | None = None) -> bool:
        """Make at most `count` sweeps, or until an answer is within the tolerance; False when there was a NaN.

        `look` is called when a better answer was found, and changes nothing in the sweeps.
        """
        way, work, watched = self._way, self._work, look is not None
        until, status = self.done + count, CONTINUE
        while status == CONTINUE:
            seen = self.error
            status, self.done, self.error, self.seen = way.kernel(*way.arguments, work, tolerance, until, watched)
            if look is not None and self.error < seen and self.done > 0:
                look()
            if self.done >= until:
                break
        return status != NOT_FINITE

    def iterate(self) -> SweepState:
        """Return the state for other sweeps to go on from, in the memory of these."""
        problem = self._rows.problem
        state, measured, best, r, lam = anderson.iterate(self._work, problem.q.size, problem.nc)
        return SweepState(r, lam, state, measured, best)


def work(problem: FrictionContact, done: int, seen: int) -> dict[str, int]:
    """Count the work of so many sweeps, errors of so many contacts among them."""
    products = -(-seen // problem.nc)
    return {"iterations": done, "projections": done * problem.nc, "matrix_vector_products": products}


def block_rows(problem: FrictionContact) -> BlockRows:
    """Return W by rows of blocks."""
    d, nc = problem.dimension, problem.nc
    layout, W = block_layout, problem.W
    start, diagonal = np.zeros(nc + 1, np.uint64), np.zeros((nc, d, d))
    local, rho = np.empty((nc, 12 if d == 3 else 0)), np.empty(nc)
    # 3×3 blocks are read with four lanes: there is one number more
    if isinstance(W, np.ndarray):
        column = np.empty(nc * nc - nc, np.uint32)
        blocks = np.empty(column.size * d * d + (d == 3))
        layout.from_dense(W, start, column, blocks, diagonal, local, rho)
        some = int(start[nc])
        column, blocks = column[:some], blocks[: some * d * d + (d == 3)]
    else:
        rows = sparse(W)
        if nc:
            layout.count(rows.indptr, rows.indices, d, True, start)
        column = np.empty(int(start[nc]), np.uint32)
        blocks = np.zeros(column.size * d * d + (d == 3))
        layout.from_sparse(rows.indptr, rows.indices, rows.data, start, column, blocks, diagonal, local, rho)
    return BlockRows(problem, start, column, blocks, diagonal.reshape(nc, d * d), local, rho)


@dataclass(eq=False)
class ScaledContacts:
    """W′ = SWS and q′ = Sq for x = S⁻¹r, S² the ρ_c of the problem: one penalty then suits every contact.

    Formed where they are asked for: what sweeps solve does not need them, and small problems take longer to scale than
    to solve.
    """

    rows: BlockRows

    @cached_property
    def s(self) -> Vector:
        """The diagonal of S, shape (nc·d,)."""
        return np.repeat(np.sqrt(self.rows.problem.rho), self.rows.problem.dimension)

    @cached_property
    def W(self) -> Matrix:
        """W′."""
        return scaled_both(self.rows.problem.W, self.s)

    @cached_property
    def q(self) -> Vector:
        """q′."""
        return self.s * self.rows.problem.q


def scaled_contacts(problem: FrictionContact) -> ScaledContacts:
    """Return the problem for sweeps, and scaled where asked."""
    return ScaledContacts(block_rows(problem))


def conclude(
    problem: LocalContact, r: Vector, error: float, budget: Budget, claim: Claim, message: str, counters: dict[str, int]
) -> SolverOutput:
    """Claim solved exactly when the judged error of r is at most the tolerance.

    The kernel's error is the same formula; only where rounding could part the two is it measured afresh.
    """
    if error <= budget.tolerance - APART:
        return solved(FCPoint(r), counters)
    if not error <= budget.tolerance and not np.isfinite(r).all():  # an infinite r has no finite error
        return SolverOutput(claim=Claim.FAILED, counters=counters, message=message)
    point = FCPoint(r)
    if not budget.tolerance + APART < error < np.inf:
        error = problem.residuals(point, budget.tolerance).error
    if error <= budget.tolerance:
        return solved(point, counters)
    return SolverOutput(claim=claim, point=point, counters=counters, message=f"{message}, error {error:.1e}")
