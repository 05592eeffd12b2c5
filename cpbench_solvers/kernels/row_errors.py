"""Connected parts of a matrix, and whether an answer to a mixed linear complementarity problem is exact to rounding."""

import numpy as np

from cpbench.foundation.kernels import DATA, DATA_2D, boolean, helper, int32, int64, kernel, read_only, tuple_of, void

FAST = frozenset({"reassoc", "contract"})
"""Reassociation and contraction only, so that NaN, infinity and divisions keep their meaning."""
INDICES = [(read_only(index),) * 2 for index in (int32, int64)]
"""Types of the row starts and columns of a CSR matrix."""
ROUNDING = 8.0 * np.finfo(np.float64).eps
"""Of a sum of terms that cancel, over the sum of their sizes."""


@helper(int64(int64[::1], int64))
def root(part, i):
    """Return the last of the chain of part[i], made shorter on the way."""
    while part[i] != i:
        part[i] = part[part[i]]  # path halving: chains stay short without ranks
        i = part[i]
    return i


@helper(int64(int64[::1], int64, int64))
def joined(part, i, j):
    """Join the parts of i and j; return 1 where they were two."""
    a, b = root(part, i), root(part, j)
    part[max(a, b)] = min(a, b)  # the least number stands for the part, in any order of the joins
    return a != b


@helper(*(void(tuple_of(*index, DATA), int64[::1]) for index in INDICES))
def label_parts(matrix, part):
    """Write the least number of the connected part of every row of a matrix in CSR, (start, columns, values)."""
    (start, columns, values), n, left = matrix, part.size, part.size
    for i in range(n):
        part[i] = i
    for i in range(n):
        for e in range(start[i], start[i + 1]):
            if values[e] != 0.0 and left > 1:
                left -= joined(part, i, columns[e])
        if left == 1:  # most matrices are one part: the first rows say so
            break
    for i in range(n):
        part[i] = root(part, i)


@kernel(boolean(DATA_2D, DATA, DATA, int64), fast=FAST)
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
