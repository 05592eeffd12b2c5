"""Which method of frictional contact is to be advanced next: a pure function of counted work and of progress.

Portfolios of this kind: Huberman, Lukose and Hogg 1997, Science 275:51; Gomes and Selman 2001, Artif. Intell. 126:43.
"""

from __future__ import annotations

import math

import scipy.sparse as sp

from cpbench.foundation.factorization import DENSE_LIMIT
from cpbench.foundation.matrices import Matrix
from cpbench_solvers.contact.sweeps import BlockRows

GAIN = 0.9
"""A turn that leaves more than this share of the least error has gained nothing."""
PATIENCE = 8.0
"""A method that gains nothing waits until others have had so many times the work of its next turn, as one that promises
to be done by then does where it is expected to take longer: what gains nothing gets a small share, but always one."""
SWEEP, PER_BLOCK, PER_CONTACT = 500.0, 3.0, 25.0
"""Of an accelerated sweep: nanoseconds for itself, for a block of W and for a contact."""
GRADIENT = 1.5
"""Of an iteration of projected gradients with its measurement: sweeps that take as long."""
STEP, PER_ROW, PER_ENTRY, PER_SQUARE, PER_CUBE = 3e4, 1e3, 1.0, 5.0, 0.02
"""Of a Newton step: nanoseconds for all calls, for a row of W, for an entry of W times √n when W is sparse, for n² and
for n³ when it is dense."""
POINT, PER_POINT_ROW, PER_POINT_ENTRY, PER_POINT_CUBE = 2.7e4, 540.0, 4.5, 0.036
"""Of a step of interior points: nanoseconds for all calls, for a row of W and, when it is sparse, for an entry of W
times √n; when it is dense, for n³."""
ITERATION, SOLVE_SHARE, PER_FACTOR_ENTRY = 1e4, 0.06, 3.0
"""Of an iteration of ADMM: nanoseconds for all calls, for an entry of the factors, and before these are there to be
counted the share of a Newton step.

Not measured while it runs, so that the same problem takes the same way everywhere. The constants are those of one busy
core of an AMD EPYC (family 26) on scenes of 1 to 300 contacts: all is counted to a factor of 2 of what was measured,
either way.
"""


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
        return min(self._foreseen(tolerance), PATIENCE * self.turn) - self.spent

    def _foreseen(self, tolerance: float) -> float:
        """Return the work that it will have had when it is done, at the rate that it had since less than half of it."""
        spent, error = self._marks[0]
        if not 0.0 < self.error < error:
            return math.inf
        rate = math.log(error / self.error) / (self.spent - spent)
        return self.spent + max(math.log(self.error / tolerance), 0.0) / rate


def sweep_work(rows: BlockRows) -> float:
    """Return nanoseconds of an accelerated sweep."""
    return SWEEP + PER_BLOCK * rows.column.size + PER_CONTACT * rows.problem.nc


def step_work(W: Matrix) -> float:
    """Return nanoseconds of a Newton step."""
    n = W.shape[0]
    factors = PER_ENTRY * W.nnz * math.sqrt(n) if sp.issparse(W) else (PER_SQUARE + PER_CUBE * n) * n * n
    return STEP + PER_ROW * n + factors


def point_work(W: Matrix) -> float:
    """Return nanoseconds of a step of interior points."""
    n = W.shape[0]
    factors = PER_POINT_ENTRY * W.nnz * math.sqrt(n) if sp.issparse(W) and n > DENSE_LIMIT else PER_POINT_CUBE * n**3
    return POINT + PER_POINT_ROW * n + factors


def iteration_work(W: Matrix, entries: int) -> float:
    """Return nanoseconds of an iteration of ADMM, `entries` : of its factors, 0 before they are known."""
    return ITERATION + (PER_FACTOR_ENTRY * entries if entries else SOLVE_SHARE * step_work(W))
