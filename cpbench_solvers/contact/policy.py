"""Which method of frictional contact is to be advanced next: a pure function of counted work and of progress.

Portfolios of this kind: Huberman, Lukose and Hogg 1997, Science 275:51; Gomes and Selman 2001, Artif. Intell. 126:43.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import scipy.sparse as sp

from cpbench.foundation.factorization import DENSE_LIMIT
from cpbench.foundation.matrices import Matrix
from cpbench_solvers.contact.sweeps import BlockRows

SWEEP, PER_BLOCK, PER_CONTACT = 500.0, 3.0, 25.0
"""Of an accelerated sweep: nanoseconds for itself, for a block of W and for a contact."""
STEP, PER_ROW, PER_ENTRY, PER_SQUARE, PER_CUBE = 3e4, 1e3, 1.0, 5.0, 0.02
"""Of a Newton step: nanoseconds for all calls, for a row of W, for an entry of W times √n when W is sparse, for n² and
for n³ when it is dense."""
POINT, PER_POINT_ROW, PER_POINT_ENTRY = 1.5e4, 300.0, 2.5
"""Of a step of interior points: nanoseconds for all calls, for a row of W and, when it is sparse, for an entry of W
times √n; when it is dense, as for a Newton step, for n³."""
ITERATION, SOLVE_SHARE, PER_FACTOR_ENTRY = 5e3, 0.03, 1.5
"""Of an iteration of ADMM: nanoseconds for all calls, for an entry of the factors, and before these are there to be
counted the share of a Newton step.

Not measured while it runs, so that the same problem takes the same way everywhere. The constants are those of one busy
core of an AMD EPYC (family 26) on scenes of 1 to 300 contacts: all is counted to a factor of 2 of what was measured,
either way.
"""


@dataclass(frozen=True)
class SweepProgress:
    """Progress of the sweeps.

    Attributes
    ----------
    cost : of a sweep [ns]. next : how many are made in the next turn. spent : how many were, since another method came
    much nearer. sweeps : of these the present ones, which go on. begun, error : at their beginning and now.
    """

    cost: float
    next: int
    spent: int = 0
    sweeps: int = 0
    begun: float = 1.0
    error: float = 1.0

    def due(self, tolerance: float) -> float:
        """Return the work that they will have had after their next turn [ns], or when they are done, if that is
        expected sooner: at the rate that they had on average, for they stand still for long and then gain a lot.

        >>> SweepProgress(cost=1e4, next=600, spent=300, sweeps=300, error=1e-3).due(1e-4) / 1e4
        400.0
        >>> SweepProgress(cost=1e4, next=600, spent=300, sweeps=300, error=0.9).due(1e-4) / 1e4
        900.0
        >>> SweepProgress(cost=1e4, next=600, spent=300).due(1e-4) / 1e4
        900.0
        """
        gained = math.log(self.begun / self.error) if 0 < self.error < self.begun else 0.0
        left = self.sweeps * math.log(self.error / tolerance) / gained if gained > 0 else math.inf
        return (self.spent + min(round(left, 6), float(self.next))) * self.cost


def next_method(sweeps: float, due: Mapping[str, float]) -> str | None:
    """Return the method whose turn it is, None for sweeps: the one that promises to be done with the least work.

    Parameters
    ----------
    sweeps, due : work [ns] that the sweeps and every other method will have had after their next turn. It doubles from
    turn to turn, so that none starves: where one needs the work w, each other one has had at most about 2w before.

    >>> next_method(1e9, {"newton": 1e8, "admm": 3e8})
    'newton'
    >>> next_method(1e8, {"newton": 1e8, "admm": 3e8})
    """
    cheapest = min(due, key=due.__getitem__)
    return None if sweeps <= due[cheapest] else cheapest


def sweep_work(rows: BlockRows) -> float:
    """Return nanoseconds of an accelerated sweep."""
    return SWEEP + PER_BLOCK * rows.column.size + PER_CONTACT * rows.problem.nc


def step_work(W: Matrix) -> float:
    """Return nanoseconds of a Newton step."""
    n = W.shape[0]
    return (
        STEP
        + PER_ROW * n
        + (PER_ENTRY * W.nnz * math.sqrt(n) if sp.issparse(W) else (PER_SQUARE + PER_CUBE * n) * n * n)
    )


def point_work(W: Matrix) -> float:
    """Return nanoseconds of a step of interior points."""
    n = W.shape[0]
    factors = PER_POINT_ENTRY * W.nnz * math.sqrt(n) if sp.issparse(W) and n > DENSE_LIMIT else PER_CUBE * n**3
    return POINT + PER_POINT_ROW * n + factors


def iteration_work(W: Matrix, entries: int) -> float:
    """Return nanoseconds of an iteration of ADMM, `entries` : of its factors, 0 before they are known."""
    return ITERATION + (PER_FACTOR_ENTRY * entries if entries else SOLVE_SHARE * step_work(W))
