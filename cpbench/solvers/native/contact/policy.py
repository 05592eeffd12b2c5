"""Which method of frictional contact is expected to be done first: a pure function of counted work and of progress."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import scipy.sparse as sp

from cpbench.matrices import Matrix
from cpbench.solvers.native.contact.sweeps import BlockRows

STEPS, ITERATIONS = 10, 300
"""What Newton's method and ADMM are expected to need, and three times as many after every failure."""
HARDER = 3.0
PER_BLOCK, PER_CONTACT = 3.0, 25.0
"""Of an accelerated sweep: nanoseconds for a block of W and for a contact."""
STEP, PER_ENTRY, PER_CUBE = 5e5, 1.0, 0.02
"""Of a Newton step: nanoseconds for all calls, for an entry of W times √n when W is sparse, for n³ when it is dense."""
SOLVE_SHARE = 0.03
"""Of a Newton step that an iteration of ADMM is expected to take, before its factors are there to be counted."""
ITERATION, PER_FACTOR_ENTRY = 2e4, 1.5
"""Of an iteration of ADMM: nanoseconds for all calls and for an entry of the factors.

Not measured while it runs, so that the same problem takes the same way everywhere. The constants are those of one busy
core of an AMD EPYC (family 26) on 23 files of 20 to 935 contacts: sweeps are counted to a factor of 1.5 of what was
measured, Newton steps and iterations of ADMM to one of 3.5, either way.
"""


class NextMethod(StrEnum):
    """Method that may be tried next."""

    SWEEPS = "sweeps"
    NEWTON = "newton"
    ADMM = "admm"


@dataclass(frozen=True)
class PolicyState:
    """Facts for a decision: the error now, how many sweeps were made in all, the nanoseconds of a sweep, a
    Newton step and an iteration of ADMM, how often the last two have failed, and the sweeps since one has gained."""

    error: float
    sweeps: int
    sweep: float
    step: float
    iteration: float
    newton_failures: int = 0
    admm_failures: int = 0
    idle_sweeps: int = 0


def policy(standing: PolicyState, tolerance: float) -> NextMethod:
    """Return the method that is expected to be done first; the sweeps to start with.

    Accelerated sweeps stand still for long and then gain a lot: they are expected to go on at the rate that they had on
    average, so that the time for which they may stand still grows with the time that they have taken; and to stand
    still for as long again as they do now.

    >>> from dataclasses import replace
    >>> new = PolicyState(error=1.0, sweeps=0, sweep=1e4, step=1e7, iteration=1e6)
    >>> policy(new, 1e-4), policy(replace(new, sweeps=100, error=1e-3), 1e-4)
    (<NextMethod.SWEEPS: 'sweeps'>, <NextMethod.SWEEPS: 'sweeps'>)
    >>> policy(replace(new, sweeps=100_000, error=1e-3), 1e-4)
    <NextMethod.NEWTON: 'newton'>
    """
    if standing.sweeps == 0:
        return NextMethod.SWEEPS
    gained = -math.log(standing.error) if 0 < standing.error < 1 else 0.0
    left = standing.sweeps * (-math.log(tolerance) / gained - 1.0) if gained > 0 else math.inf
    left = max(left, standing.idle_sweeps)
    work = {
        NextMethod.SWEEPS: left * standing.sweep,
        NextMethod.NEWTON: STEPS * standing.step * HARDER**standing.newton_failures,
        NextMethod.ADMM: ITERATIONS * standing.iteration * HARDER**standing.admm_failures,
    }
    return min(work, key=work.__getitem__)


def sweep_work(rows: BlockRows) -> float:
    """Return nanoseconds of an accelerated sweep."""
    return PER_BLOCK * rows.column.size + PER_CONTACT * rows.problem.nc


def step_work(W: Matrix) -> float:
    """Return nanoseconds of a Newton step."""
    n = W.shape[0]
    return STEP + (PER_ENTRY * W.nnz * math.sqrt(n) if sp.issparse(W) else PER_CUBE * n**3)
