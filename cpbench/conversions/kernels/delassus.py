"""D A⁻¹C for an A that falls apart into small components (bodies), with the rows of D and the columns of C in groups
(contacts): W_ij = Σ_b P_biᵀ Q_bj over the bodies b that i and j touch, with Q_b = A_b⁻¹C_b and P_b = D_bᵀ.

Bodies are stored one after the other. Body b has its `size` unknowns at members[member[b]:member[b + 1]] and touches
the groups group[touch[b]:touch[b + 1]], in increasing order; from values[start[b]] on stands its matrix, by rows,
with `size` rows and d columns a group. For a symmetric positive definite A_b = L Lᵀ the one matrix L⁻¹C_b serves as P
and as Q; entry ij of W is then the same sum of the same products in the same order as entry ji, and both agree to the
last bit.
"""

import numpy as np
from numba import float64, int32, int64, njit, types

# neither contraction nor reassociation: symmetry to the last bit needs the same rounding at ij and at ji


def _readonly(kind, ndim=1):
    return types.Array(kind, ndim, "C", readonly=True)


DATA, COUNTS, LABELS = _readonly(float64), _readonly(int64), _readonly(int32)
INDEX_KINDS = (int32, int64)
_BLOCKS = _readonly(float64, 3)


@njit(
    [types.UniTuple(int64, 4)(_readonly(i), _readonly(i), COUNTS, COUNTS, int64) for i in INDEX_KINDS],
    cache=True,
    error_model="numpy",
)
def sample_groups(indptr, indices, member, members, most):
    """Count the columns, and groups of 2, 3 and 5 columns, that the bodies touch; look at `most` bodies at most."""
    bodies = member.size - 1
    step = max(1, bodies // most)
    columns, pairs, triples, fives = 0, 0, 0, 0
    for b in range(0, bodies, step):
        count = 0
        for u in range(member[b], member[b + 1]):
            count += indptr[members[u] + 1] - indptr[members[u]]
        if count == 0:
            continue
        touched = np.empty(count, dtype=np.int64)
        t = 0
        for u in range(member[b], member[b + 1]):
            for e in range(indptr[members[u]], indptr[members[u] + 1]):
                touched[t] = indices[e]
                t += 1
        touched.sort()
        last = int64(-5)
        for c in touched:
            columns += c != last
            pairs += c // 2 != last // 2
            triples += c // 3 != last // 3
            fives += c // 5 != last // 5
            last = c
    return columns, pairs, triples, fives


@njit(
    [
        types.void(_readonly(i), _readonly(i), COUNTS, COUNTS, LABELS, int64, int64[::1], int64[::1])
        for i in INDEX_KINDS
    ],
    cache=True,
    error_model="numpy",
)
def count_touched(indptr, indices, member, members, group_of, d, touch, start):
    """Fill touch and start from the rows of a CSR matrix."""
    marked = np.full(group_of[-1] + 1 if group_of.size else 0, -1, dtype=np.int64)
    for b in range(member.size - 1):
        count = 0
        for u in range(member[b], member[b + 1]):
            end = int64(-1)  # of the group of the column before; columns increase
            for column in indices[indptr[members[u]] : indptr[members[u] + 1]]:
                if column >= end:
                    g = group_of[column]
                    end = (int64(g) + 1) * d
                    if marked[g] != b:
                        marked[g] = b
                        count += 1
        touch[b + 1] = touch[b] + count
        start[b + 1] = start[b] + count * d * (member[b + 1] - member[b])


@njit(
    [
        types.void(
            *(_readonly(i), _readonly(i), DATA),
            *(COUNTS, COUNTS, LABELS, int64),
            *(COUNTS, COUNTS, int32[::1], float64[::1]),
        )
        for i in INDEX_KINDS
    ],
    cache=True,
    error_model="numpy",
)
def gather(indptr, indices, data, member, members, group_of, d, touch, start, group, values):
    """Fill `group` and `values` (zero before)."""
    groups = group_of[-1] + 1 if group_of.size else 0
    marked = np.full(groups, -1, dtype=np.int64)
    place = np.empty(groups, dtype=np.int64)
    for b in range(member.size - 1):
        first, size = touch[b], member[b + 1] - member[b]
        t = first
        ordered = True
        for u in range(member[b], member[b + 1]):
            end = int64(-1)
            for column in indices[indptr[members[u]] : indptr[members[u] + 1]]:
                if column < end:
                    continue
                g = group_of[column]
                end = (int64(g) + 1) * d
                if marked[g] != b:
                    marked[g] = b
                    if t > first and group[t - 1] > g:
                        ordered = False
                    group[t] = g
                    t += 1
        if not ordered:
            group[first:t].sort()
        for s in range(first, t):
            place[group[s]] = start[b] + (s - first) * d
        width = (t - first) * d
        for u in range(size):
            row = members[member[b] + u]
            end, at = int64(-1), int64(0)
            for e in range(indptr[row], indptr[row + 1]):
                column = indices[e]
                if column >= end:
                    g = group_of[column]
                    end = (int64(g) + 1) * d
                    at = place[g] + u * width - int64(g) * d
                values[at + column] = data[e]


@njit(types.void(_BLOCKS, COUNTS, int64, float64[::1]), cache=True, error_model="numpy")
def multiply(inverses, start, first, values):
    """Compute Q_b = A_b⁻¹C_b in place for the bodies first, first + 1, ... whose inverses are given."""
    size = inverses.shape[1]
    for k in range(inverses.shape[0]):
        body = values[start[first + k] : start[first + k + 1]]
        width = body.size // size
        old = body.copy()
        body[:] = 0.0
        for u in range(size):
            row = body[u * width :][:width]
            for v in range(size):
                factor, other = inverses[k, u, v], old[v * width :][:width]
                for c in range(width):
                    row[c] += factor * other[c]


@njit(types.void(_BLOCKS, COUNTS, int64, float64[::1]), cache=True, error_model="numpy")
def substitute(lower, start, first, values):
    """Compute L_b⁻¹C_b in place for the bodies first, first + 1, ... whose Cholesky factors are given."""
    size = lower.shape[1]
    for k in range(lower.shape[0]):
        body = values[start[first + k] : start[first + k + 1]]
        width = body.size // size
        for u in range(size):
            row = body[u * width :][:width]
            for v in range(u):
                factor, other = lower[k, u, v], body[v * width :][:width]
                for c in range(width):
                    row[c] -= factor * other[c]
            factor = 1.0 / lower[k, u, u]
            for c in range(width):
                row[c] *= factor
