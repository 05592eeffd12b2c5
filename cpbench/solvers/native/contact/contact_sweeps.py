"""What solvers of frictional contact share: W by rows of blocks, sweeps of NSGS over it, and what they conclude."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cpbench.formulations.contact import FCPoint
from cpbench.formulations.fc import FrictionContact
from cpbench.kernel_cache import load
from cpbench.matrices import Dense, Matrix, Vector, scaled_both, sparse
from cpbench.solvers.base import Budget, Claim, SolverOutput

FINE, MARGIN = 1e-11, 0.999
"""Two evaluations of the error in different order agree to this share of a tolerance that is not finer than this."""
MEMORY = 15
"""Columns of Anderson's acceleration. Of 25 choices of this (5 to 20) and of the kernel's constants, the one with the
fewest sweeps to 1e-4 and 1e-8 on 18 real files: 195 in the geometric mean, 6000 where it did not get there; the others
201 to 322."""
LOG = 256
"""Error evaluations a call of the sweeps can log."""


def kernel(name: str) -> ModuleType:
    """The compiled module of that name in `solvers/kernels`."""
    return load(f"cpbench.solvers.kernels.{name}")


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

    def judged(self, r: Vector) -> float:
        """The error that `residuals` judges r by."""
        problem = self.problem
        matrix = (self.start, self.column, self.blocks, self.diagonal)
        if problem.nc == 0:
            return 0.0
        return kernel("gauss_seidel").judged(*matrix, problem.q, problem.mu, problem.rho, r, problem.dimension)


class Sweeps:
    """NSGS over the contacts in their order, in pieces; it remembers the multipliers of sliding between them."""

    def __init__(self, rows: BlockRows) -> None:
        self._rows = rows
        problem, gauss_seidel = rows.problem, kernel("gauss_seidel")
        self._sweeps = gauss_seidel.sweeps_3d if problem.dimension == 3 else gauss_seidel.sweeps_2d
        self._lam, self._order = np.zeros(problem.nc), np.arange(problem.nc)
        self._log = np.zeros(LOG, np.int64), np.zeros(LOG)
        self._pace = np.full(1, np.inf)
        self._least, self._best = np.zeros(1), np.zeros(problem.q.size)  # no error is below 0: nothing is kept
        self.done = self.evaluations = 0

    def sweep(self, r: Vector, count: int, tolerance: float) -> float:
        """The judged error of r, changed in place, after `count` sweeps or as soon as it is at most `tolerance`."""
        rows, problem = self._rows, self._rows.problem
        state = np.array([0, count, 0, 0])
        matrix = (rows.start, rows.column, rows.blocks, rows.diagonal, rows.local)
        law = (problem.q, problem.mu, problem.rho)
        kept = (self._least, self._best)
        self._sweeps(
            *matrix, *law, r, self._lam, self._order, 1.0, False, tolerance, count, state, self._pace, *self._log, *kept
        )
        self.done += int(state[0])
        self.evaluations += int(state[2])
        return float(self._log[1][state[2] - 1])


class AcceleratedSweeps:
    """Sweeps with Anderson's acceleration, in pieces, from `start` or from 0; see the kernel `anderson`."""

    def __init__(
        self,
        rows: BlockRows,
        start: Vector | None = None,
        order: NDArray[np.int64] | None = None,
        memory: int = MEMORY,
    ) -> None:
        self._rows, self._kernel = rows, kernel("anderson")
        problem = rows.problem
        n, memory = problem.q.size, min(memory, problem.q.size)
        self._r = np.zeros(n) if start is None else start.copy()
        self._lam = np.zeros(problem.nc)
        self._order = np.arange(problem.nc) if order is None else order
        self._work, self._columns = np.zeros((2, n)), np.empty((2, memory, n))
        self._state, self._measured = np.array([0, 1, 0, 0, 0, 0, 0, 0]), np.array([np.inf, np.inf])
        self._log = np.zeros(LOG, np.int64), np.zeros(LOG)
        self._least, self.best = np.full(1, np.inf), self._r.copy()
        self.evaluations = 0

    @property
    def done(self) -> int:
        return int(self._state[0])

    @property
    def error(self) -> float:
        """The judged error of `best`, ∞ before the first sweep."""
        return float(self._least[0])

    def sweep(self, count: int, tolerance: float, look: Callable[[], None] | None = None) -> bool:
        """At most `count` sweeps, or until an answer is within the tolerance; False when there was a NaN.

        `look` is called after every evaluation of the error, and changes nothing in the sweeps.
        """
        rows, problem, state = self._rows, self._rows.problem, self._state
        until = int(state[0]) + count
        matrix = (rows.start, rows.column, rows.blocks, rows.diagonal, rows.local)
        iterate = (problem.q, problem.mu, problem.rho, self._r, self._lam, self._order, self._work, *self._columns)
        kept = (self._least, self.best)
        while state[0] < until:
            # with one place left in the log it is back at its next evaluation
            room = LOG if look is None else int(state[2]) + 1
            log = (self._log[0][:room], self._log[1][:room])
            status = self._kernel.accelerated(
                *matrix, *iterate, problem.dimension, tolerance, until, state, self._measured, *log, *kept
            )
            if look is not None:
                look()
            if status != self._kernel.CONTINUE or state[0] == until or room == LOG:
                self.evaluations += int(state[2])
                state[2] = 0
            if status != self._kernel.CONTINUE:
                return status == self._kernel.CONVERGED
        return True


def block_rows(problem: FrictionContact) -> BlockRows:
    """W by rows of blocks."""
    d, nc = problem.dimension, problem.nc
    start = np.zeros(nc + 1, np.uint64)
    if nc == 0:
        none = np.zeros(0)
        return BlockRows(problem, start, np.zeros(0, np.uint32), none, none.reshape(0, d * d), none)
    layout, W = kernel("block_layout"), sparse(problem.W)
    layout.count(W.indptr, W.indices, d, True, start)
    column = np.empty(int(start[nc]), np.uint32)
    # by columns and with one number more, as the kernel of 3×3 blocks reads them with four lanes; by rows else
    blocks = np.zeros(column.size * d * d + (d == 3))
    steps = (1, d) if d == 3 else (d, 1)
    layout.fill(W.indptr, W.indices, W.data, d, True, *steps, start, column, blocks)
    local = np.empty((nc, 12 if d == 3 else 0))
    if d == 3:
        layout.one_contact_constants(problem.diagonal_blocks, local)
    return BlockRows(problem, start, column, blocks, problem.diagonal_blocks.reshape(nc, d * d), local)


@dataclass(frozen=True)
class ScaledContacts:
    """W′ = SWS and q′ = Sq for x = S⁻¹r, S² the ρ_c of the problem: one penalty then suits every contact."""

    rows: BlockRows
    W: Matrix
    q: Vector
    s: Vector


def scaled_contacts(problem: FrictionContact) -> ScaledContacts:
    s = np.repeat(np.sqrt(problem.rho), problem.dimension)
    return ScaledContacts(block_rows(problem), scaled_both(problem.W, s), s * problem.q, s)


def conclude(
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
