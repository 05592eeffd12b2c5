"""Scaling of a symmetric matrix that is the same in all units: the entries of every row are 1 on average.

D minimizes ½Σ D_i A_ij D_j − Σ n_i log D_i, A ≥ 0, n_i how many entries of a row are not 0, which is convex in
log D (Sinkhorn and Knopp 1967; Knight and Ruiz 2013, IMA J. Numer. Anal. 33:1029). Newton steps by conjugate gradients
begin at the least Σ (log D_i A_ij D_j)² (Curtis and Reid 1972).
"""

import numpy as np

from cpbench.foundation.kernels import DATA, FAST, INDEX, START, VECTOR, float64, helper, int64, kernel, void

STEPS, CG_STEPS = 30, 100
GUESSED, ENOUGH = 0.1, 1e-4
"""Rows may be off by this much in the root mean square: in logarithms at the guess, on average at the end."""
INEXACT = 0.1
"""Conjugate gradients leave this share of the right side of a Newton step."""
FARTHEST = 3.0
"""A Newton step changes no log D_i by more: it is right near 0 only."""
LEAST = 1e-3
"""Of a diagonal entry, what elimination leaves of it at least: rounding may leave none."""
LARGEST, LEAST_ENTRY = 1e35, 1e-35
"""Entries are cut off where they are less; where the guess leaves one that is more, another scaling is the guess."""
LONG, ONE = np.uint64(16), np.uint64(1)
"""Entries of a row from which on it is worth asking whether their columns follow each other."""
UNSIGNED, EXPONENT, BIAS = np.int64(2**63 - 1), np.log(2.0) * 2.0**-52, 1023.0 * np.log(2.0)
"""Logarithms from the bits of a number are linear between powers of two, wrong by 0.06 at most: enough for a guess."""


@helper(inline=True)
def _follow(column, begin, end):
    """Return whether the columns of a row follow each other, which needs no indices."""
    return end - begin > LONG and column[end - ONE] - column[begin] == end - begin - ONE


@helper(void(START, START, DATA, int64, int64, DATA, VECTOR), fast=FAST)
def _times(start, column, weight, first, last, x, y):
    """Write the rows from `first` to `last` of Wx."""
    for i in range(first, last):
        begin, end, total = start[i], start[i + 1], 0.0
        if _follow(column, begin, end):
            row, part = weight[begin:end], x[column[begin] :]
            for k in range(row.size):
                total += row[k] * part[k]
        else:
            for k in range(begin, end):
                total += weight[k] * x[column[k]]
        y[i] = total


@helper(float64(START, START, VECTOR, int64, DATA), fast=FAST)
def _scale_row(start, column, weight, i, x):
    """Set W_ij ← x_i W_ij x_j in a row; return its sum."""
    begin, end, total, own = start[i], start[i + 1], 0.0, x[i]
    if _follow(column, begin, end):
        row, part = weight[begin:end], x[column[begin] :]
        for k in range(row.size):
            row[k] *= own * part[k]
            total += row[k]
        return total
    for k in range(begin, end):
        weight[k] *= own * x[column[k]]
        total += weight[k]
    return total


@helper(void(START, START, DATA, DATA, int64, VECTOR), fast=FAST)
def _eliminate(start, column, weight, diagonal, head, x):
    """Write the rows from `head` on of x, so that these rows of (diag(diagonal) + W) x are 0."""
    _times(start, column, weight, head, x.size, x, x)  # columns of these rows are before them
    for i in range(head, x.size):
        x[i] = -x[i] / diagonal[i] if diagonal[i] > 0.0 else 0.0


@helper(void(START, START, DATA, DATA, int64, VECTOR, VECTOR), fast=FAST)
def _product(start, column, weight, diagonal, head, x, y):
    """Write the rows before `head` of diag(diagonal) x + Wx."""
    _times(start, column, weight, 0, head, x, y)
    for i in range(head):
        y[i] += diagonal[i] * x[i]


@helper(inline=True)
def _reduced(start, column, weight, i, head, inverse, moved):
    """Return Σ W_ij² inverse_j, Σ W_ij moved_j, which are 0 before `head`, and W_ii."""
    begin, end, own, right, same = start[i], start[i + 1], 0.0, 0.0, 0.0
    if _follow(column, begin, end):
        first = column[begin]
        if first <= i <= column[end - ONE]:
            same = weight[begin + np.uint64(i) - first]
        begin += max(np.uint64(head), first) - first
    for k in range(begin, end):
        j, value = column[k], weight[k]
        right += value * moved[j]
        own += value * value * inverse[j]
        same += value if j == i else 0.0
    return own, right, same


@helper(void(START, START, DATA, DATA, int64, VECTOR, VECTOR, float64, int64))
def _solve(start, column, weight, diagonal, head, r, x, enough, steps):
    """Write the x of (diag(diagonal) + W) x = r, as far as what is left of r, squared and over the diagonal of the
    matrix without the rows from `head` on, is more than `enough`. Those rows are eliminated; r is overwritten."""
    n = x.size
    p, Ap, pivot, old = np.zeros(n), np.empty(head), np.empty(head), 1.0
    inverse, moved = np.zeros(n), np.zeros(n)
    x[:] = 0.0
    for i in range(head, n):
        inverse[i] = 1.0 / diagonal[i] if diagonal[i] > 0.0 else 0.0
        moved[i] = r[i] * inverse[i]
    for i in range(head):
        own, right, same = _reduced(start, column, weight, i, head, inverse, moved)
        r[i] -= right
        pivot[i] = max(diagonal[i] + same - own, LEAST * diagonal[i])
    for step in range(steps):
        new = 0.0
        for i in range(head):
            if pivot[i] > 0.0:
                new += r[i] * r[i] / pivot[i]
        if not new > enough:
            break
        share = new / old if step else 0.0
        for i in range(head):
            # preconditioned by the diagonal; empty rows have none
            p[i] = share * p[i] + (r[i] / pivot[i] if pivot[i] > 0.0 else 0.0)
        _eliminate(start, column, weight, diagonal, head, p)
        _product(start, column, weight, diagonal, head, p, Ap)
        curvature = 0.0
        for i in range(head):
            curvature += p[i] * Ap[i]
        if not curvature > 0.0:
            break  # else nothing is left but rounding
        for i in range(head):
            x[i] += new / curvature * p[i]
            r[i] -= new / curvature * Ap[i]
        old = new
    _eliminate(start, column, weight, diagonal, head, x)
    for i in range(head, n):
        if diagonal[i] > 0.0:
            x[i] += r[i] / diagonal[i]


@helper(float64(START, START, DATA, DATA, VECTOR, VECTOR), fast=FAST)
def _weigh(start, column, size, D, weight, sums):
    """Write the entries D_i A_ij D_j and the sum of each row; return the largest sum."""
    most = 0.0
    for i in range(D.size):
        total = 0.0
        for k in range(start[i], start[i + 1]):
            weight[k] = min(max(abs(size[k]) * D[i] * D[column[k]], LEAST_ENTRY), LARGEST * LARGEST)
            total += weight[k]
        sums[i], most = total, max(most, total)
    return most


@kernel(void(INDEX, INDEX, DATA, int64, VECTOR))
def equilibrate(start, column, size, head, D):
    """Write D; 1 for rows that are empty. A, in CSR, has the absolute values of `size`, none of them 0. Rows from
    `head` on have entries in columns before it alone."""
    n = D.size
    count, r, x, sums, weight = np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.ones(size.size)
    bits, total = size.view(np.int64), float(size.size)
    start, column = start.view(np.uint64), column.view(np.uint64)  # signed indices cost a test for negative ones
    for i in range(n):
        count[i], r[i] = start[i + 1] - start[i], 0.0
        for k in range(start[i], start[i + 1]):
            # Curtis and Reid: least squares of logarithms, whose matrix is the pattern
            r[i] -= EXPONENT * (bits[k] & UNSIGNED) - BIAS
    _solve(start, column, weight, count, head, r, x, GUESSED * GUESSED * total, CG_STEPS)
    for i in range(n):
        D[i] = np.exp(x[i])
    if _weigh(start, column, size, D, weight, sums) > LARGEST:
        for i in range(n):  # cut off, it would be another matrix: the largest entry of every row is 1 at most
            top = 0.0
            for k in range(start[i], start[i + 1]):
                top = max(top, weight[k])
            D[i] /= np.sqrt(top) if top > 0.0 else 1.0
        _weigh(start, column, size, D, weight, sums)
    for _ in range(STEPS):
        off = 0.0
        for i in range(n):
            r[i] = count[i] - sums[i]  # the gradient of the convex function, by log D_i
            if count[i] > 0.0:
                off += r[i] * r[i] / count[i]
        if not off > ENOUGH * ENOUGH * total:
            break
        if off > 0.25 * total:  # far away, a step by each row alone is better
            for i in range(n):
                # Sinkhorn's step, halved because rows and columns share D
                x[i] = np.sqrt(count[i] / sums[i]) if count[i] > 0.0 else 1.0
        else:
            square = 0.0
            for i in range(n):
                square += r[i] * r[i] / sums[i] if count[i] > 0.0 else 0.0
            _solve(start, column, weight, sums, head, r, x, INEXACT * INEXACT * square, CG_STEPS)
            for i in range(n):
                x[i] = np.exp(min(max(x[i], -FARTHEST), FARTHEST))
        for i in range(n):
            D[i] *= x[i]
            sums[i] = _scale_row(start, column, weight, i, x)
