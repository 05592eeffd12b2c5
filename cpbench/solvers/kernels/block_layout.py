"""A sparse matrix to rows of blocks, d rows a contact, and the constants of the one-contact problems.

The d rows of a contact are merged: a block of `width` columns is where any of them has an entry, whatever the others
have. Nothing is allocated but what the caller hands over; the matrix is read once for its places and once for its
numbers. `apart` : the diagonal blocks are left out.
"""

import numpy as np
from numba import boolean, float64, int32, int64, njit, types, uint32, uint64, void

from cpbench.solvers.kernels.array_types import DATA

INT32, INT64 = (types.Array(kind, 1, "C", readonly=True) for kind in (int32, int64))
BLOCKS = types.Array(float64, 3, "C", readonly=True)

SINGULAR = 1e-12
"""Relative to the block's largest entry: W_NN below it cannot carry the normal equation; S below it is regularised."""


@njit(error_model="numpy")
def _next_block(end, indices, at, width):
    """Return block column of the first block that is not behind `at`, -1 where there is none. end : of every row."""
    found = np.int64(-1)
    for t in range(at.size):
        if at[t] < end[t] and (found < 0 or indices[at[t]] < found):
            found = np.int64(indices[at[t]])
    return found if found < 0 else found // width


@njit(
    [void(kind, kind, int64, boolean, uint64[::1]) for kind in (INT32, INT64)],
    cache=True,
    error_model="numpy",
)
def count(indptr, indices, width, apart, start):
    """Set start[i + 1] to the number of blocks in the rows of the contacts 0 … i."""
    nc = start.size - 1
    d = (indptr.size - 1) // nc
    at, end = np.empty(d, np.int64), np.empty(d, np.int64)
    start[0] = 0
    for i in range(nc):
        for t in range(d):
            at[t], end[t] = indptr[d * i + t], indptr[d * i + t + 1]
        blocks = np.uint64(0)
        j = _next_block(end, indices, at, width)
        while j >= 0:
            beyond = width * (j + 1)
            for t in range(d):
                while at[t] < end[t] and indices[at[t]] < beyond:
                    at[t] += 1
            if j != i or not apart:
                blocks += np.uint64(1)
            j = _next_block(end, indices, at, width)
        start[i + 1] = start[i] + blocks


@njit(
    [
        void(kind, kind, DATA, int64, boolean, int64, int64, uint64[::1], uint32[::1], float64[::1])
        for kind in (INT32, INT64)
    ],
    cache=True,
    error_model="numpy",
)
def fill(indptr, indices, data, width, apart, down, right, start, column, blocks):
    """Write the blocks that `count` counted: columns, and entries that lie `down` and `right` apart in `blocks` of
    zeros."""
    nc = start.size - 1
    d = (indptr.size - 1) // nc
    at, end = np.empty(d, np.int64), np.empty(d, np.int64)
    for i in range(nc):
        for t in range(d):
            at[t], end[t] = indptr[d * i + t], indptr[d * i + t + 1]
        k = np.int64(start[i])
        j = _next_block(end, indices, at, width)
        while j >= 0:
            first, beyond, place = width * j, width * (j + 1), d * width * k
            if j != i or not apart:
                column[k] = j
                k += 1
            for t in range(d):
                while at[t] < end[t] and indices[at[t]] < beyond:
                    if j != i or not apart:
                        blocks[place + down * t + right * (indices[at[t]] - first)] = data[at[t]]
                    at[t] += 1
            j = _next_block(end, indices, at, width)


@njit(void(BLOCKS, float64[:, ::1]), cache=True, error_model="numpy")
def one_contact_constants(D, local):
    """Write the twelve numbers of every contact that `gauss_seidel` names, from the diagonal blocks, shape (nc, 3,
    3)."""
    for i in range(D.shape[0]):
        top = 0.0
        for t in range(3):
            for c in range(3):
                top = max(top, abs(D[i, t, c]))
        bad = not D[i, 0, 0] > SINGULAR * top
        inverse = 1.0 / (1.0 if bad else D[i, 0, 0])
        size = top if top > 0.0 else 1.0
        h1, h2 = D[i, 0, 1] * inverse, D[i, 0, 2] * inverse
        a, b = D[i, 1, 1] - D[i, 1, 0] * h1, D[i, 1, 2] - D[i, 1, 0] * h2
        c, d = D[i, 2, 1] - D[i, 2, 0] * h1, D[i, 2, 2] - D[i, 2, 0] * h2
        mean, half = 0.5 * (a + d), 0.5 * (a - d)
        radicand = half * half + b * c
        # complex eigenvalues never make S + λI singular for a real λ; then the bound is only about the real part
        least = mean - np.sqrt(max(radicand, 0.0))
        indefinite = least < -SINGULAR * size and radicand >= 0.0
        singular = abs(a * d - b * c) <= SINGULAR * size * size
        local[i, 0] = bad
        local[i, 1] = inverse
        local[i, 2], local[i, 3], local[i, 4], local[i, 5] = a, b, c, d
        local[i, 6], local[i, 7] = D[i, 1, 0] * inverse, D[i, 2, 0] * inverse
        local[i, 8], local[i, 9] = h1, h2
        local[i, 10] = -least * (1.0 + SINGULAR) if indefinite else (SINGULAR * size if singular else 0.0)
        local[i, 11] = indefinite


READY = True
