"""Several columns of Lemke's tableau brought to the newest pivot together, around matrix products by the caller."""

import numpy as np
from numba import float64, int64, njit, void

from cpbench_solvers.kernels.array_types import COMPILED
from cpbench_solvers.kernels.pivoting import update
from cpbench_solvers.kernels.tableau import ANY_ORDER


@njit(
    void(ANY_ORDER, float64, float64[:, ::1], int64[::1], int64[::1], float64[:, ::1], int64[::1], int64),
    cache=True,
    nogil=True,
)
def align(columns, factor, C, age, slots, E, rows, block):
    """Bring the columns of `slots` to the next multiple of `block` pivots, one after the other."""
    for slot in slots:
        update(columns, factor, C, age, slot, E, rows, (max(age[slot], 0) + block - 1) // block * block)


@njit("void(float64[:,::1], int64, float64[:,::1], int64[::1], int64, float64[:,::1], float64[:,::1])", **COMPILED)
def prepare(W, count, E, rows, begin, t, x):
    """Write the factors t (count, K) of K pivots from `begin` on the first columns W, and their entries x in those
    rows.

    The caller takes t E from W, and `restore` puts x where the pivots are: written afresh, without cancellation.
    """
    K = t.shape[1]
    S = np.empty((K, K))
    first = np.empty(K, np.int64)
    for p in range(K):
        # a row that is pivoted on twice has two places in x: the first is the one that counts
        # where each pivot's row was first pivoted on
        first[p] = p
        for a in range(p):
            if rows[begin + a] == rows[begin + p]:
                first[p] = first[a]
        for a in range(K):
            S[p, a] = E[begin + p, rows[begin + a]]
    for c in range(count):
        for a in range(K):
            x[c, a] = W[c, rows[begin + a]]
        for p in range(K):
            factor = x[c, first[p]] * S[p, p]
            t[c, p] = factor
            for a in range(K):
                x[c, a] -= S[p, a] * factor
            x[c, first[p]] = factor  # afresh, as `update` does, so that both give the same numbers up to rounding
        for a in range(K):
            x[c, a] = x[c, first[a]]


@njit("void(float64[:,::1], int64, int64[::1], int64, float64[:,::1])", cache=True, nogil=True)
def restore(W, count, rows, begin, x):
    """Restore W of the first columns in the rows of the pivots, as `prepare` has found them."""
    for c in range(count):
        for a in range(x.shape[1]):
            W[c, rows[begin + a]] = x[c, a]
