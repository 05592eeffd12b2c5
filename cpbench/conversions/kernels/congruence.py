"""EᵀWF + K written once, as canonical CSR; E, F and K are block diagonal, E and F with the same block at every contact.

W is canonical CSR with d rows and d columns a contact; its blocks need not be full nor aligned. The rows of a contact
in WF are made first, in a buffer that stays in cache and has the layout of the result: every row of the result is
then a short combination of them, in one loop that vectorises over all the blocks of the contact.
"""

import numpy as np

from cpbench.foundation.kernels import boolean, float64, helper, int32, int64, kernel, read_only, void

NOT_FULL = -1
"""Value that `write` returns when a block lacks an entry and `full` was promised."""
_NONE = 1 << 62


# Neither contraction nor reassociation: terms that cancel must give 0, which is not stored. Offsets are unsigned
# where a loop should vectorise: a signed one may count from the end. What is called for every row would count
# references to its arrays, which costs more than the row: `write` has the rows itself, and the
# stages of a contact are copied into it (inline).


@kernel(*(void(read_only(index), read_only(index), int64[::1], int64[::1]) for index in (int32, int64)))
def count_blocks(indptr, indices, at, blocks):
    """Set blocks[c] to how many d x d blocks of contact c hold an entry; at : work, (d,)."""
    d = at.size
    for c in range(blocks.size):
        for a in range(d):
            at[a] = indptr[c * d + a]
        count = 0
        while True:
            least = _NONE
            for a in range(d):
                if at[a] < indptr[c * d + a + 1]:
                    least = min(least, np.int64(indices[at[a]]))
            if least == _NONE:
                break
            end = (least // d + 1) * d
            for a in range(d):
                while at[a] < indptr[c * d + a + 1] and indices[at[a]] < end:
                    at[a] += 1
            count += 1
        blocks[c] = count


@helper(inline=True)
def _merge(indptr, indices, data, c, at, J, S):
    """Place blocks of contact c side by side in S, (d, ·), their columns in J, c among them; return how many they
    are.
    """
    d = at.size
    for a in range(d):
        at[a] = indptr[c * d + a]
    count, diagonal, more = 0, False, True
    while more:
        least = _NONE
        for a in range(d):
            if at[a] < indptr[c * d + a + 1]:
                least = min(least, np.int64(indices[at[a]]))
        more = least < _NONE
        j = least // d
        if j > c and not diagonal:
            j = c
        if j == c or more:
            diagonal = diagonal or j == c
            for a in range(d):
                for b in range(d):
                    S[a, count * d + b] = 0.0
                while at[a] < indptr[c * d + a + 1] and indices[at[a]] < (j + 1) * d:
                    S[a, count * d + indices[at[a]] - j * d] = data[at[a]]
                    at[a] += 1
            J[count] = j
            count += 1
            more = True
    return count


@helper(inline=True)
def _place_blocks(indptr, indices, data, full, c, at, J, S):
    """Place the blocks of contact c side by side in S, and their columns in J: rows that are alike and full are copied,
    others merged unless all are promised to be `full`. Return how many blocks, or NOT_FULL."""
    d = at.size
    first = indptr[c * d]
    n = np.uint64(indptr[c * d + 1] - first)
    unlike = np.int64(n) % d + np.int64(indptr[c * d + d] - first) - d * np.int64(n)
    count, diagonal = 0, False
    if unlike == 0:
        start = np.uint64(first)
        for a in range(np.uint64(1), np.uint64(d)):
            for t in range(n):
                unlike += indices[start + t] != indices[start + a * n + t]
    if unlike == 0:
        count = np.int64(n) // d
        for b in range(count):
            column_0 = np.int64(indices[first + b * d])
            j = column_0 // d
            unlike += (column_0 != j * d) | (indices[first + b * d + d - 1] != column_0 + d - 1)
            diagonal |= j == c
            J[b] = j
        for a in range(1, d):
            unlike += indptr[c * d + a + 1] - indptr[c * d + a] - np.int64(n)
    if unlike == 0 and diagonal:
        start = np.uint64(first)
        for a in range(np.uint64(d)):
            for t in range(n):
                S[a, t] = data[start + a * n + t]
    elif full:
        count = NOT_FULL
    else:
        count = _merge(indptr, indices, data, c, at, J, S)
    return count


@helper(inline=True)
def _multiply_rows(count, J, S, c, F, chosen, active, width, d, R, column):
    """Write R, the rows of contact c in WF, and its columns; return their number, and where the diagonal block begins,
    which has the columns of K too."""
    length = 0
    where = 0
    for b in range(count):
        base = J[b] * width
        g, columns = np.uint64(0), np.uint64(active)
        if J[b] == c:
            where = length
            g, columns = columns, np.uint64(chosen.size) - columns
        start = np.uint64(length)
        for m in range(columns):
            column[start + m] = base + chosen[g + m]
        if d == 3:  # held in registers: the compiler cannot know that R is not S
            w00, w01, w02 = S[0, 3 * b], S[0, 3 * b + 1], S[0, 3 * b + 2]
            w10, w11, w12 = S[1, 3 * b], S[1, 3 * b + 1], S[1, 3 * b + 2]
            w20, w21, w22 = S[2, 3 * b], S[2, 3 * b + 1], S[2, 3 * b + 2]
            for m in range(columns):
                f0, f1, f2 = F[0, g + m], F[1, g + m], F[2, g + m]
                R[0, start + m] = w00 * f0 + w01 * f1 + w02 * f2
                R[1, start + m] = w10 * f0 + w11 * f1 + w12 * f2
                R[2, start + m] = w20 * f0 + w21 * f1 + w22 * f2
        else:
            for a in range(d):
                for m in range(columns):
                    total = 0.0
                    for t in range(d):
                        total += S[a, b * d + t] * F[t, g + m]
                    R[a, start + m] = total
        length += np.int64(columns)
    return length, where


@kernel(
    *(
        int64(
            *(read_only(index), read_only(index), read_only(float64), boolean),
            *(read_only(int64), read_only(int64, 2), read_only(float64, 2)),
            *(read_only(float64, 2), read_only(int64), int64, int64),
            *(read_only(int64), read_only(int64, 2), read_only(float64, 3), read_only(float64, 2)),
            *(int64[::1], int64[::1], float64[:, ::1], float64[:, ::1], index[::1]),
            *(index[::1], index[::1], float64[::1]),
        )
        for index in (int32, int64)
    )
)
def write(
    indptr,
    indices,
    data,
    full,
    e_count,
    e_place,
    e_value,
    F,
    chosen,
    active,
    width,
    k_count,
    k_place,
    K,
    coefficients,
    at,
    J,
    S,
    R,
    column,
    ptr,
    ix,
    x,
):
    """Fill ptr, ix and x, entries that are 0 left out; returns how many there are, or NOT_FULL.

    Parameters
    ----------
    indptr, indices, data : W. full : return NOT_FULL at the first contact whose blocks are not all full.
    e_count, e_place, e_value : the nonzeros of the columns of E, (k,), (k, d), (k, d).
    F, chosen : the columns that are not 0, then those that are not 0 in F or K, and which they are; (d, ·), (·,).
    active : how many the first are. width : of a contact in the result.
    k_count, k_place : the places in the second list of the nonzeros of K, by rows, (k,), (k, ·).
    K, coefficients : the block of contact c is Σ coefficients[c, s] K[s], columns as in the second list; (nc, ·).
    at, J, S, R, column : work, (d,), (b,), (d, b·d), (d, b·m), (b·m,), b one more than the most blocks of a contact.
    ptr, ix, x : the result; ix and x need room for every entry that is structurally there and for the
        zeros of one row, at most two blocks of them, which are taken out again.
    """
    d = at.size
    height = e_count.size
    p = 0
    ptr[0] = 0
    for c in range(coefficients.shape[0]):
        count = _place_blocks(indptr, indices, data, full, c, at, J, S)
        if count == NOT_FULL:
            return NOT_FULL
        length, where = _multiply_rows(count, J, S, c, F, chosen, active, width, d, R, column)
        for i in range(height):
            if e_count[i] == 0:  # nothing but K
                for s in range(k_count[i]):
                    m = k_place[i, s]
                    value = 0.0
                    for r in range(K.shape[0]):
                        value += coefficients[c, r] * K[r, i, m]
                    if value != 0.0:
                        ix[p] = c * width + chosen[active + m]
                        x[p] = value
                        p += 1
                ptr[c * height + i + 1] = p
                continue
            start, zeros = np.uint64(p), 0
            row, e = np.uint64(e_place[i, 0]), e_value[i, 0]
            other, f = np.uint64(e_place[i, 1]), e_value[i, 1]
            for t in range(np.uint64(length)):
                value = e * R[row, t] + f * R[other, t]
                x[start + t] = value
                ix[start + t] = column[t]
                zeros += value == 0.0
            for s in range(2, e_count[i]):
                row, e = np.uint64(e_place[i, s]), e_value[i, s]
                zeros = 0
                for t in range(np.uint64(length)):
                    value = x[start + t] + e * R[row, t]
                    x[start + t] = value
                    zeros += value == 0.0
            for s in range(k_count[i]):
                m = k_place[i, s]
                value = x[p + where + m]
                zeros -= value == 0.0
                for r in range(K.shape[0]):
                    value += coefficients[c, r] * K[r, i, m]
                zeros += value == 0.0
                x[p + where + m] = value
            end = p + length
            if zeros == 0:
                p = end
            else:
                while x[p] != 0.0:
                    p += 1
                for t in range(p, end):
                    if x[t] != 0.0:
                        x[p] = x[t]
                        ix[p] = ix[t]
                        p += 1
            ptr[c * height + i + 1] = p
    return p
