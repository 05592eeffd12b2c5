"""How sweeps count themselves, draw their order, and know when to measure what they have come to."""

import numpy as np

from cpbench.foundation.kernels import helper
from cpbench_solvers.kernels.vectors import put

CONTINUE, CONVERGED, NOT_FINITE = 0, 1, 2
"""What the sweeps return: they have come to `until` or the log is full; the error is small enough; NaN."""

ITERATION, NEXT_CHECK, LOGGED, RANDOM, LAST_CHECK, SEEN = range(6)
"""Places in `state`; LOGGED counts the evaluations of the error, SEEN the contacts that were looked at for it."""
PACE, LAST_ERROR, LEAST = range(3)
"""Places in `measured`: the square of the error over that of the change, and the error, from the last evaluation; the
least error so far. With a PACE of 0 every sweep is looked at before the first evaluation."""
FIRST = 4
"""The sweep of that, where nothing ends before."""


@helper()
def due(state, until, change, tolerance, measured):
    """Return whether the error is to be looked at: it is time, or the change in this sweep says that it may be small
    enough, or is not a number."""
    it = state[ITERATION]
    # not >: a NaN is looked at, and ends the sweeps
    foretold = not measured[PACE] * change > tolerance * tolerance and measured[PACE] < np.inf
    return it >= state[NEXT_CHECK] or it == until or foretold


@helper()
def checked(state, error, change, tolerance, measured, r, best):
    """Keep the error, the best r, and set the next check: where the last two foretell the tolerance, a quarter ahead
    at most. Whether that was the end: CONVERGED, NOT_FINITE, else CONTINUE."""
    if error < measured[LEAST]:
        measured[LEAST] = error
        put(best, r)
    state[LOGGED] += 1
    if error <= tolerance:
        return CONVERGED
    if not np.isfinite(error):
        return NOT_FINITE
    it, last = state[ITERATION], measured[LAST_ERROR]
    step = max(it // 4, min(it, 4), 1)
    if error < last < np.inf and it > state[LAST_CHECK]:
        rate = np.log(error / last) / (it - state[LAST_CHECK])
        # a tenth earlier than foretold
        step = min(step, max(1.0, 0.9 * np.log(tolerance / error) / rate))
    state[LAST_CHECK] = it
    state[NEXT_CHECK] = it + int(step)
    measured[LAST_ERROR] = error
    # where a sweep changes nothing there is no pace, and nothing to be seen before it is time: 0·∞ and ∞ are not small
    measured[PACE] = error * error / change if change > 0.0 else np.inf
    return CONTINUE


@helper()
def shuffled(order, state):
    """Shuffle in place after Fisher and Yates, with the 64-bit linear congruential generator of Knuth (MMIX)."""
    x = np.uint64(state[RANDOM])
    for k in range(order.size - 1, 0, -1):
        x = x * np.uint64(6364136223846793005) + np.uint64(1442695040888963407)
        other = np.int64((x >> np.uint64(33)) % np.uint64(k + 1))
        order[k], order[other] = order[other], order[k]
    state[RANDOM] = np.int64(x)
