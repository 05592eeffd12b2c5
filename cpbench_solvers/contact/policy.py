"""Which method of frictional contact is to be advanced next: a pure function of counted work and of progress.

Portfolios of this kind: Huberman, Lukose and Hogg 1997, Science 275:51; Gomes and Selman 2001, Artif. Intell. 126:43.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench_solvers.contact.newton_equation import factored_sparse
from cpbench_solvers.contact.sweeps import BlockRows
from cpbench_solvers.kernels import minimum_degree, qp_ldl

GAIN = 0.9
"""A turn that leaves more than this share of the least error has gained nothing."""
PATIENCE = 8.0
"""A method that gains nothing waits until others have had so many times the work of its next turn, as one that promises
to be done by then does where it is expected to take longer: what gains nothing gets a small share, but always one."""
SWEEP, PER_BLOCK, PER_CONTACT = 500.0, 3.0, 25.0
"""Of an accelerated sweep: nanoseconds for itself, for a block of W and for a contact."""
GRADIENT = 1.5
"""Of an iteration of projected gradients with its measurement: sweeps that take as long."""
STEP, PER_ROW, PER_SQUARE, PER_CUBE = 3e4, 1e3, 5.0, 0.02
"""Of a Newton step on a dense W: nanoseconds for all calls, for a row of W, for n² and for n³."""
POINT, PER_POINT_ROW, PER_POINT_CUBE = 5e4, 540.0, 0.036
"""Of a step of interior points on a dense W."""
FACTOR, PER_FACTOR_ROW, PER_ENTRY, PER_FILL, MOVING = 3e5, 900.0, 30.0, 0.08, 0.25
"""Of either on a sparse W, whose factors have e entries: for all calls, for a row, for an entry and for e²/n; the share
of the last two in a Newton step, whose system is that of the contacts that are closed."""
ITERATION, PER_SOLVED = 1e4, 1.0
"""Of an iteration of ADMM: nanoseconds for all calls and for an entry of the factors.

Not measured while it runs, so that the same problem takes the same way everywhere. The constants are those of one busy
core of an AMD EPYC (family 26) on scenes of 1 to 1,000 contacts: all is counted to a factor of 2 of what was measured,
either way.
"""
FILL = 2
"""Times the entries of W: what the factors of a sparse W are thought to have until they are counted."""


class TurnProgress:
    """Work [ns] and least error of one method, and the work that it will have had when it is done.

    Attributes
    ----------
    turn : work after its next turn, which doubles. spent, error : so far. stalled : whether the last turn gained
    nothing.
    """

    def __init__(self, expected: float, first: float, patience: float = PATIENCE, lull: float = 0.0) -> None:
        """Begin; `expected` : work until it is done, before it has shown anything. first : of its first turn.
        patience : see PATIENCE. lull : work in which its error may stand still before it falls fast; where that is not
        0, its average rate counts, not the last one, and it is expected to be done in its next turn."""
        self._expected, self._patience, self._lull, self.turn = expected, patience, lull, first
        self.spent, self.error, self.stalled = 0.0, math.inf, False
        self._before = math.inf
        self._marks = [(0.0, 1.0), (0.0, 1.0)]

    def note(self, work: float, error: float) -> None:
        """Note an iterate of that error after so much more work."""
        self.spent, self.error = self.spent + work, min(self.error, error)
        if self.spent >= 2.0 * self._marks[1][0] and not self._lull:
            self._marks = [self._marks[1], (self.spent, self.error)]

    def rest(self) -> None:
        """End a turn."""
        self.stalled = self.spent >= self._lull and not self.error <= GAIN * self._before
        self._before = self.error
        self.turn = 2.0 * max(self.turn, self.spent)

    def due(self, tolerance: float) -> float:
        """Return the work [ns] by which it competes with other methods for the next turn: what is left where it gains,
        and all that it will have had where it does not."""
        if not self.spent:
            return self._expected
        if self.stalled:
            return self._patience * self.turn
        if self._lull:
            return min(self._foreseen(tolerance), self.turn)
        return min(self._foreseen(tolerance), self._patience * self.turn) - self.spent

    def _foreseen(self, tolerance: float) -> float:
        """Return the work that it will have had when it is done, at the rate that it had since less than half of it."""
        spent, error = self._marks[0]
        if not 0.0 < self.error < error:
            return math.inf
        rate = math.log(error / self.error) / (self.spent - spent)
        return self.spent + max(math.log(self.error / tolerance), 0.0) / rate


def sweep_work(rows: BlockRows, entries: int = 0) -> float:
    """Return nanoseconds of an accelerated sweep; `entries` : of the factors of W, for methods that have some."""
    return SWEEP + PER_BLOCK * rows.column.size + PER_CONTACT * rows.problem.nc


def gradient_work(rows: BlockRows, entries: int) -> float:
    """Return nanoseconds of an iteration of projected gradients."""
    return GRADIENT * sweep_work(rows)


def step_work(rows: BlockRows, entries: int) -> float:
    """Return nanoseconds of a Newton step."""
    n = rows.problem.q.size
    if factored_sparse(rows.problem.W):
        return _factor_work(n, entries, MOVING)
    return STEP + PER_ROW * n + (PER_SQUARE + PER_CUBE * n) * n * n


def point_work(rows: BlockRows, entries: int) -> float:
    """Return nanoseconds of a step of interior points."""
    n = rows.problem.q.size
    if factored_sparse(rows.problem.W):
        return _factor_work(n, entries, 1.0)
    return POINT + (PER_POINT_ROW + PER_POINT_CUBE * n * n) * n


def iteration_work(rows: BlockRows, entries: int) -> float:
    """Return nanoseconds of an iteration of ADMM with its measurement, which takes as long as a sweep."""
    return ITERATION + PER_SOLVED * entries + sweep_work(rows)


def _factor_work(n: int, entries: int, share: float) -> float:
    return FACTOR + PER_FACTOR_ROW * n + share * entries * (PER_ENTRY + PER_FILL * entries / n)


def likely_entries(rows: BlockRows) -> int:
    """Return the entries of the factors of W before they are counted."""
    W: Any = rows.problem.W
    return FILL * W.nnz if factored_sparse(W) else W.shape[0] ** 2


def factor_entries(rows: BlockRows) -> int:
    """Return the entries of the factors of W, of a sparse one in an order of least degree, by its graph of contacts."""
    nc, d = rows.problem.nc, rows.problem.dimension
    if not factored_sparse(rows.problem.W):
        return likely_entries(rows)
    graph: Any = sp.csr_array((np.ones(rows.column.size), rows.column, rows.start.astype(np.int64)), shape=(nc, nc))
    graph = sp.csr_array(graph + graph.T)
    order, parent, count = np.empty((3, nc), np.int64)
    minimum_degree.minimum_degree(graph.indptr.astype(np.int32), graph.indices.astype(np.int32), order)
    upper: Any = sp.triu(graph[order][:, order], 1, format="csc")
    qp_ldl.tree(upper.indptr.astype(np.int32), upper.indices.astype(np.int32), parent, count)
    return d * d * int(2 * count.sum() + nc)
