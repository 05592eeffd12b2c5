"""A Delassus matrix with rolling friction to rows of blocks, moments in lengths; one-contact constants."""

import numpy as np

from cpbench.foundation.kernels import DATA, INDEX, VECTOR, boolean, float64, helper, kernel, uint32, uint64, void
from cpbench_solvers.kernels.block_layout import fill, natural_rho, own_block

SINGULAR = 1e-12
"""Relative to the block's largest entry: W_NN below it cannot carry the normal equation; S below it is regularised."""
SHIFT = 1e-7
"""Added to a singular S, over the same."""


@helper(float64(float64[:, ::1], float64[:, ::1]))
def _least(S, work):
    """Return 1/‖S⁻¹‖, in Frobenius' norm: the least singular value, or up to √n times less; 0 where S is singular.

    Gauss and Jordan, with the largest pivot of the column. work : (n, 2n).
    """
    n = S.shape[0]
    for i in range(n):
        for j in range(n):
            work[i, j], work[i, n + j] = S[i, j], 0.0
        work[i, n + i] = 1.0
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(work[i, k]) > abs(work[best, k]):
                best = i
        if work[best, k] == 0.0:  # exactly singular: no pivot is left in the column
            return 0.0
        for j in range(2 * n):
            work[k, j], work[best, j] = work[best, j], work[k, j]
        pivot = 1.0 / work[k, k]
        for j in range(2 * n):
            work[k, j] *= pivot
        for i in range(n):
            factor = work[i, k]
            if i != k:
                for j in range(2 * n):
                    work[i, j] -= factor * work[k, j]
    square = 0.0
    for i in range(n):
        for j in range(n, 2 * n):
            square += work[i, j] ** 2
    return 1.0 / np.sqrt(square)


@helper(boolean(float64[:, ::1], float64, float64[:, ::1]))
def _monotone(D, shift, work):
    """Return whether D + Dᵀ has no eigenvalue below -shift: the pivots of its elimination with that on the diagonal."""
    d = D.shape[0]
    for i in range(d):
        for j in range(d):
            work[i, j] = D[i, j] + D[j, i]  # only the symmetric part decides
        work[i, i] += shift
    for k in range(d):
        if not work[k, k] > 0.0:  # Sylvester: pivots have the signs of the eigenvalues
            return False
        for i in range(k + 1, d):
            factor = work[i, k] / work[k, k]
            for j in range(k + 1, d):
                work[i, j] -= factor * work[k, j]
    return True


@kernel(
    void(
        INDEX,
        INDEX,
        DATA,
        uint64[::1],
        uint32[::1],
        VECTOR,
        float64[:, :, ::1],
        float64[:, ::1],
        VECTOR,
        float64[:, ::1],
        float64[:, ::1],
        float64[:, ::1],
        float64[:, ::1],
    )
)
def from_rows(
    indptr, indices, data, start, column, blocks, diagonal, lengths, rho, schur, to_tangent, to_normal, scalars
):  # fmt: skip
    """Write everything from a matrix in CSR with sorted columns, whose blocks off the diagonal `count` has counted.

    Parameters
    ----------
    start, column, blocks, diagonal : of `block_layout`, by rows, the last two of zeros. lengths : (nc, d), 1 and √(tr
    W_TT/tr W_MM) in rows of moments. rho : (nc,). schur, to_tangent, to_normal, scalars : of `rolling_gauss_seidel`.
    """
    nc, d = lengths.shape
    n, k = d - 1, (d - 1) // 2
    fill(indptr, indices, data, d, True, d, 1, start, column, blocks)
    S, work = np.empty((n, n)), np.empty((d, 2 * d))
    for i in range(nc):
        D = diagonal[i]
        own_block(indptr, indices, data, i, diagonal)
        slides = rolls = 0.0
        for a in range(k):
            slides += D[1 + a, 1 + a]
            rolls += D[1 + k + a, 1 + k + a]
        # sliding and rolling are then equally mobile: one ρ suits both
        length = np.sqrt(slides / rolls) if slides > 0.0 and rolls > 0.0 else 1.0
        for a in range(d):
            lengths[i, a] = length if a > k else 1.0
    for i in range(nc):
        D = diagonal[i]
        for e in range(start[i], start[i + 1]):
            j = np.int64(column[e])
            for a in range(d):
                for c in range(d):
                    blocks[(e * d + a) * d + c] *= lengths[i, a] * lengths[j, c]
        top = 0.0
        for a in range(d):
            for c in range(d):
                D[a, c] *= lengths[i, a] * lengths[i, c]
                top = max(top, abs(D[a, c]))
        rho[i] = natural_rho(diagonal, i)
        # 0 marks a contact that takes a step of the natural map
        inverse = 1.0 / D[0, 0] if D[0, 0] > SINGULAR * top else 0.0
        for a in range(n):
            to_tangent[i, a], to_normal[i, a] = D[1 + a, 0] * inverse, D[0, 1 + a] * inverse
        for a in range(n):
            for c in range(n):
                S[a, c] = schur[i, n * a + c] = D[1 + a, 1 + c] - D[1 + a, 0] * to_normal[i, c]
        # larger than SINGULAR: refinement takes the shift out again
        scalars[i, 0] = SHIFT * top if _least(S, work) <= SINGULAR * top else 0.0
        scalars[i, 1] = inverse
        scalars[i, 2] = _monotone(D, SINGULAR * top, work)
