"""The largest error of a row of a linear complementarity problem, by what the rows feel: it hides in norms over all.

Row i is w_i = Σ_j K_ij x_j + k_i, of size s_i = max(Σ_j |K_ij x_j|, |k_i|), or `SMALL` times the largest one of its
connected part where that is more. Rows are compared by s_i/R_i, R_i = √(Σ_j K_ij²/C_j²), C_j = √(Σ_i K_ij²), without
the constants of idle ones, x_i = 0 < w_i. An unknown has its unit from its largest effect on a row, E_i = max_d
|K_di|/s_d. The error of a pair 0 ≤ x_i ⟂ w_i ≥ 0 is |min(E_i x_i, w_i/s_i)|, that of an equality |w_i|/s_i.
Rows without a constant do not count: where all of their unknowns should vanish, they have no size.
"""

import math

import numpy as np
from numba import boolean, float64, int32, int64, njit, types, void

from cpbench_solvers.kernels.array_types import COMPILED, DATA, DATA_2D, INDEX, VECTOR

FAST = {"reassoc", "contract"}
"""Reassociation and contraction only, so that NaN, infinity and divisions keep their meaning."""
INDICES = [(types.Array(index, 1, "C", readonly=True),) * 2 for index in (int32, int64)]
"""Types of the row starts and columns of a CSR matrix."""
MATRICES = [types.UniTuple(DATA_2D, 1), *(types.Tuple((*index, DATA)) for index in INDICES)]
"""A matrix by rows: dense, (K,); in CSR, (start, columns, values)."""
ROUNDING = 8.0 * np.finfo(np.float64).eps
"""Of a sum of terms that cancel, over the sum of their sizes."""
SMALL = 1e-3
"""A row is measured by no less than this share of the largest: a smaller one has its error from others, by rounding."""


@njit(int64(int64[::1], int64), **COMPILED)
def root(part, i):
    """Return the last of the chain of part[i], made shorter on the way."""
    while part[i] != i:
        part[i] = part[part[i]]  # path halving: chains stay short without ranks
        i = part[i]
    return i


@njit(int64(int64[::1], int64, int64), **COMPILED)
def joined(part, i, j):
    """Join the parts of i and j; return 1 where they were two."""
    a, b = root(part, i), root(part, j)
    part[max(a, b)] = min(a, b)  # the least number stands for the part, in any order of the joins
    return a != b


@njit(error_model="numpy", forceinline=True)
def _span(matrix, i):
    """Return the first entry of row i, and the one behind its last; which matrix it is, is known when compiled."""
    if len(matrix) == 1:
        return 0, matrix[0].shape[1]
    return matrix[0][i], matrix[0][i + 1]


@njit(error_model="numpy", forceinline=True)
def _entry(matrix, i, e):
    """Return column and value of an entry of row i."""
    if len(matrix) == 1:
        return e, matrix[0][i, e]
    return matrix[1][e], matrix[2][e]


@njit([void(K, int64[::1]) for K in MATRICES], **COMPILED)
def label_parts(matrix, part):
    """Write the least number of the connected part of every row."""
    n = left = part.size
    for i in range(n):
        part[i] = i
    for i in range(n):
        first, last = _span(matrix, i)
        for e in range(first, last):
            j, value = _entry(matrix, i, e)
            if value != 0.0 and left > 1:
                left -= joined(part, i, j)
        if left == 1:  # most matrices are one part: the first rows say so
            break
    for i in range(n):
        part[i] = root(part, i)


@njit(boolean(DATA_2D, DATA, DATA, int64), fastmath=FAST, **COMPILED)
def is_exact(K, k, x, free):
    """Return whether x is exact to rounding: every row that does not hold its unknown at 0 is 0. No connected part has
    an error of more than a few times that then. free : the first rows are equalities."""
    for i in range(k.size):
        row, value, sizes = K[i], k[i], abs(k[i])
        for j in range(row.size):
            term = row[j] * x[j]
            value += term
            sizes += abs(term)
        if i >= free and not (x[i] >= 0.0 and (x[i] > 0.0 or value >= 0.0)):
            return False
        if (i < free or x[i] > 0.0) and not abs(value) <= ROUNDING * sizes:
            return False
    return True


@njit([void(K, VECTOR) for K in MATRICES], **COMPILED)
def shares(matrix, share):
    """Write 1/C of the columns, 1 for those of zeros."""
    share[:] = 0.0
    if len(matrix) == 1:
        for i in range(share.size):
            for j in range(share.size):
                share[j] += matrix[0][i, j] * matrix[0][i, j]  # row by row, as K lies
    else:
        for e in range(matrix[0][share.size]):
            share[matrix[1][e]] += matrix[2][e] * matrix[2][e]
    for j in range(share.size):
        share[j] = 1.0 / math.sqrt(share[j]) if share[j] > 0.0 else 1.0


@njit(void(DATA, int64, INDEX, DATA, DATA, DATA, VECTOR), **COMPILED)
def _sizes(k, free, part, x, w, R, size):
    """Make the sums of terms in `size` the sizes of the rows."""
    top = np.zeros(k.size)
    for i in range(k.size):
        if R[i] > 0.0:
            idle = i >= free and x[i] == 0.0 and w[i] > 0.0  # its constant says nothing of the sizes of others
            top[part[i]] = max(top[part[i]], (size[i] if idle else max(size[i], abs(k[i]))) / R[i])
    for i in range(k.size):
        size[i] = max(max(size[i], abs(k[i])), SMALL * R[i] * top[part[i]])


@njit([void(K, DATA, DATA, int64, INDEX, DATA, VECTOR, VECTOR) for K in MATRICES], fastmath=FAST, **COMPILED)
def rows(matrix, k, x, free, part, share, w, size):
    """Write the rows w = Kx + k and their sizes.

    Parameters
    ----------
    free : the first rows are equalities, beside free unknowns. part, share : (n,) of `label_parts`, `shares`.
    """
    R = np.empty(k.size)
    for i in range(k.size):
        total, terms, squares = k[i], 0.0, 0.0
        first, last = _span(matrix, i)
        for e in range(first, last):
            j, value = _entry(matrix, i, e)
            term = value * x[j]
            total += term
            terms += abs(term)
            squares += (value * share[j]) ** 2
        w[i], size[i], R[i] = total, terms, math.sqrt(squares)
    _sizes(k, free, part, x, w, R, size)


@njit(float64(DATA_2D, DATA, DATA, int64, DATA, DATA, float64), **COMPILED)
def largest_dense(K, k, x, free, w, size, error):
    """Return the largest error of a row, at least `error`, which is returned where it is not a number.

    w, size : of `rows`.
    """
    for i in range(k.size):
        if k[i] != 0.0 and (i < free or x[i] > 0.0 or w[i] < 0.0):  # rows without a constant have no size of their own
            miss = abs(w[i]) / size[i]
            if miss > error:
                if i >= free and w[i] > 0.0:  # the pair may be wrong by x_i instead: the smaller one counts
                    effect = 0.0
                    for d in range(k.size):
                        if K[d, i] != 0.0:
                            effect = max(effect, abs(K[d, i]) / size[d])
                    miss = min(miss, effect * x[i])
                error = max(error, miss)
    return error


@njit([VECTOR(*index, DATA, DATA) for index in INDICES], **COMPILED)
def _effects(start, columns, values, size):
    """Return (n,) the largest effect of each unknown on a row."""
    effect = np.zeros(size.size)
    for d in range(size.size):
        for e in range(start[d], start[d + 1]):
            if values[e] != 0.0:
                effect[columns[e]] = max(effect[columns[e]], abs(values[e]) / size[d])
    return effect


@njit([float64(*index, DATA, DATA, DATA, int64, DATA, DATA, float64) for index in INDICES], **COMPILED)
def largest_sparse(start, columns, values, k, x, free, w, size, error):
    """Return as `largest_dense` does."""
    effect = np.empty(0)
    for i in range(k.size):
        if k[i] != 0.0 and (i < free or x[i] > 0.0 or w[i] < 0.0):
            miss = abs(w[i]) / size[i]
            if miss > error:
                if i >= free and w[i] > 0.0:
                    if effect.size == 0:
                        effect = _effects(start, columns, values, size)
                    miss = min(miss, effect[i] * x[i])
                error = max(error, miss)
    return error
