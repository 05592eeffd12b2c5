"""A matrix to rows of blocks, d rows a contact, and the constants of the one-contact problems.

The d rows of a contact are merged: a block of `width` columns is where any of them has an entry, whatever the others
have. Nothing is allocated but what the caller hands over; a sparse matrix is read once for its places and once for its
numbers. `apart` : the diagonal blocks are left out.
"""

import numpy as np

from cpbench.foundation.kernels import (
    DATA,
    DATA_2D,
    boolean,
    float64,
    helper,
    int32,
    int64,
    kernel,
    read_only,
    uint32,
    uint64,
    void,
)

INT32, INT64 = (read_only(kind) for kind in (int32, int64))
BLOCKS = read_only(float64, 3)

SINGULAR = 1e-12
"""Relative to the block's largest entry: W_NN below it cannot carry the normal equation; S below it is regularised."""


@helper()
def _next_block(end, indices, at, width):
    """Return block column of the first block that is not behind `at`, -1 where there is none. end : of every row."""
    found = np.int64(-1)
    for t in range(at.size):
        # the least column of any of the d rows: entries are sorted
        if at[t] < end[t] and (found < 0 or indices[at[t]] < found):
            found = np.int64(indices[at[t]])
    return found if found < 0 else found // width


@kernel(*(void(kind, kind, int64, boolean, uint64[::1]) for kind in (INT32, INT64)))
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
            beyond = width * (j + 1)  # every row is moved past this block, whatever it has in it
            for t in range(d):
                while at[t] < end[t] and indices[at[t]] < beyond:
                    at[t] += 1
            if j != i or not apart:
                blocks += np.uint64(1)
            j = _next_block(end, indices, at, width)
        start[i + 1] = start[i] + blocks


@kernel(
    *(
        void(kind, kind, DATA, int64, boolean, int64, int64, uint64[::1], uint32[::1], float64[::1])
        for kind in (INT32, INT64)
    )
)
def fill(indptr, indices, data, width, apart, down, right, start, column, blocks):
    """Write the columns of the blocks that `count` counted, and their entries, `down` and `right` apart, over zeros."""
    nc = start.size - 1
    d = (indptr.size - 1) // nc
    at, end = np.empty(d, np.int64), np.empty(d, np.int64)
    for i in range(nc):
        for t in range(d):
            at[t], end[t] = indptr[d * i + t], indptr[d * i + t + 1]
        k = np.int64(start[i])  # mixed with signed numbers, unsigned ones would become floats
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


@kernel(void(BLOCKS, float64[:, ::1]))
def one_contact_constants(D, local):
    """Write the twelve numbers of every contact that `gauss_seidel` names, from the diagonal blocks, (nc, 3, 3)."""
    for i in range(D.shape[0]):
        top = 0.0
        for t in range(3):
            for c in range(3):
                top = max(top, abs(D[i, t, c]))
        bad = not D[i, 0, 0] > SINGULAR * top  # also for NaN
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
        # S + λI is regular from here on
        local[i, 10] = -least * (1.0 + SINGULAR) if indefinite else (SINGULAR * size if singular else 0.0)
        local[i, 11] = indefinite


@helper(float64(float64[:, :, ::1], int64))
def natural_rho(diagonal, i):
    """Return ρ of contact i: d over the trace of its block, 1 where that is not positive."""
    trace = 0.0
    for t in range(diagonal.shape[1]):
        trace += diagonal[i, t, t]
    return diagonal.shape[1] / trace if trace > 0.0 else 1.0


@helper()
def own_block(indptr, indices, data, i, diagonal):
    """Write the diagonal block of contact i of a matrix in CSR with sorted columns into `diagonal` of zeros."""
    d = diagonal.shape[1]
    for a in range(d):
        row = d * i + a
        # a row may have thousands of entries, its own block is one of them
        at = indptr[row] + np.searchsorted(indices[indptr[row] : indptr[row + 1]], d * i)
        while at < indptr[row + 1] and indices[at] < d * (i + 1):
            diagonal[i, a, indices[at] - d * i] = data[at]
            at += 1


@kernel(void(DATA_2D, uint64[::1], uint32[::1], float64[::1], float64[:, :, ::1], float64[:, ::1], float64[::1]))
def from_dense(W, start, column, blocks, diagonal, local, rho):
    """Write everything from a dense matrix; blocks of zeros are left out.

    Parameters
    ----------
    start : (nc + 1,). column : at least as many as there are blocks. blocks : d·d times as many; of three rows by
    columns and with one number more, as the kernel of 3×3 blocks reads them with four lanes, of two by rows. diagonal :
    (nc, d, d). local : (nc, 12), not written for d = 2. rho : (nc,).
    """
    nc, d = diagonal.shape[0], diagonal.shape[1]
    down, right = (1, d) if d == 3 else (d, 1)
    at = 0
    for i in range(nc):
        start[i] = at
        for j in range(nc):
            some = False
            for a in range(d):
                for b in range(d):
                    entry = W[d * i + a, d * j + b]
                    some |= entry != 0.0  # a stored block costs nine products in every sweep
                    if i == j:
                        diagonal[i, a, b] = entry
                    else:
                        # written ahead, and over again by the next one where all of it is 0
                        blocks[d * d * at + down * a + right * b] = entry
            if some and i != j:
                column[at] = j
                at += 1
        rho[i] = natural_rho(diagonal, i)
    start[nc] = at
    if d == 3:
        blocks[d * d * at] = 0.0  # the fourth lane of the last block reads it: no NaN may be there
        one_contact_constants(diagonal, local)


@kernel(
    *(
        void(
            kind, kind, DATA, uint64[::1], uint32[::1], float64[::1], float64[:, :, ::1], float64[:, ::1], float64[::1]
        )
        for kind in (INT32, INT64)
    )
)
def from_sparse(indptr, indices, data, start, column, blocks, diagonal, local, rho):
    """Write as `from_dense` does, from CSR whose blocks `count` has counted, into `blocks` and `diagonal` of zeros."""
    d = diagonal.shape[1]
    down, right = (1, d) if d == 3 else (d, 1)
    fill(indptr, indices, data, d, True, down, right, start, column, blocks)
    for i in range(diagonal.shape[0]):
        own_block(indptr, indices, data, i, diagonal)
        rho[i] = natural_rho(diagonal, i)
    if d == 3:
        one_contact_constants(diagonal, local)
