"""Cholesky factors of dense matrices, row by row where they are small and by blocks where products of matrices pay."""

import numpy as np

from cpbench.foundation.kernels import VECTOR, boolean, float64, helper, int64, void
from cpbench_solvers.kernels.qp_dense import dot
from cpbench_solvers.kernels.qp_ldl import BLOCK, dense_factor, substitute

BY_BLOCKS = 100
"""Unknowns from which on blocks are faster."""
MATRIX = float64[:, ::1]


@helper(float64(MATRIX, int64, float64, boolean))
def _diagonal(H, i, shift, unit):
    """Return the number on the diagonal that `cholesky` factors, 0 where a row of zeros would have to be one."""
    if not unit:
        return H[i, i] + shift
    if H[i, i] != 0.0:
        return H[i, i] + shift * H[i, i]
    for j in range(H.shape[0]):
        if H[i, j] != 0.0:
            return 0.0
    return 1.0  # an unknown without curvature: semidefinite, if nothing else is in its row


@helper(float64(MATRIX, MATRIX, float64, boolean))
def _by_blocks(H, L, shift, unit):
    """Write and return what `cholesky` does, by LDLᵀ."""
    n = H.shape[0]
    whole, root, least = np.empty(n), np.empty(n), np.inf
    for i in range(n):
        L[i, i] = whole[i] = _diagonal(H, i, shift, unit)
        for j in range(i):
            L[i, j] = H[i, j]
    if not dense_factor(L, np.full(n, np.nan)):  # NaN: pivots keep whatever sign they have
        return 0.0
    for i in range(n):
        if not L[i, i] > 0.0:
            return 0.0
        least, root[i] = min(least, L[i, i] / whole[i]), np.sqrt(L[i, i])
    for i in range(n):
        for j in range(i):
            L[i, j] *= root[j]
        L[i, i] = root[i]
    return least


@helper(float64(MATRIX, MATRIX, float64, boolean))
def cholesky(H, L, shift, unit):
    """Write the lower factor of H + shift·diag(H) (`unit`), or of H + shift·I, and return the least share that is left
    of a number on the diagonal; 0 at the first one of which nothing is. Where `unit`, a row with the diagonal entry 0
    must be 0, and stands for one of the identity."""
    if H.shape[0] >= BY_BLOCKS:
        return _by_blocks(H, L, shift, unit)
    least = 1.0
    for i in range(H.shape[0]):
        row = L[i]
        for j in range(i):
            row[j] = (H[i, j] - dot(row[:j], L[j, :j])) / L[j, j]
        whole = _diagonal(H, i, shift, unit)
        pivot = whole - dot(row[:i], row[:i])
        if not pivot > 0.0:
            return 0.0
        least = min(least, pivot / whole)  # the share that is left says how near to singular H is
        row[i] = np.sqrt(pivot)
    return least


@helper(void(MATRIX, VECTOR, int64))
def forward(L, x, first):
    """Set x ← L⁻¹x, whose numbers before `first` are 0."""
    for i in range(first, x.size):
        x[i] = (x[i] - dot(L[i, first:i], x[first:i])) / L[i, i]  # column by column would be strided: L lies by rows


@helper(void(MATRIX, MATRIX))
def forward_by_blocks(L, columns):
    """Set every column of `columns`, (n, ·), to L⁻¹ times it."""
    n = L.shape[0]
    for begin in range(0, n, BLOCK):
        end = min(begin + BLOCK, n)
        substitute(L, begin, end, columns[begin:end], False)
        if end < n:
            change = np.dot(np.ascontiguousarray(L[end:, begin:end]), columns[begin:end])
            for c in range(end, n):
                row, less = columns[c], change[c - end]
                for i in range(row.size):
                    row[i] -= less[i]


@helper(void(MATRIX, VECTOR))
def backward(L, x):
    """Set x ← L⁻ᵀx."""
    for i in range(x.size - 1, -1, -1):
        value = x[i] / L[i, i]
        x[i] = value
        row = L[i]
        for j in range(i):
            x[j] -= row[j] * value  # L by its rows, used as columns of Lᵀ
