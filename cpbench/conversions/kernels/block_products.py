"""The rows of W_ij = Σ_b P_biᵀ Q_bj over the bodies b that groups i and j touch, from the blocks of `delassus`.

Bodies and groups are stored as there. Neither contraction nor reassociation is allowed: symmetry to the last bit needs
the same rounding at ij and at ji.
"""

import numpy as np
from numba import float64, int32, int64, njit, types, uint64

from cpbench.conversions.kernels.delassus import COUNTS, DATA, INDEX_KINDS, LABELS


@njit(types.void(COUNTS, LABELS, int64[::1], int32[::1], int64[::1]), cache=True, error_model="numpy")
def transpose_touch(touch, group, by_group, body, slot):
    """List the bodies of every group, in increasing order, and the place of the pair in `group`; by_group comes
    zero.
    """
    for g in group:
        by_group[g + 1] += 1
    for g in range(by_group.size - 1):
        by_group[g + 1] += by_group[g]
    at = by_group.copy()
    for b in range(touch.size - 1):
        for t in range(touch[b], touch[b + 1]):
            g = group[t]
            body[at[g]] = b
            slot[at[g]] = t
            at[g] += 1


@njit(types.UniTuple(int64, 2)(COUNTS, LABELS, COUNTS, LABELS, int64, int64[::1]), cache=True, error_model="numpy")
def count_blocks(by_group, body, touch, group, columns, begin):
    """Count the blocks of W: begin[i] are those above row i; return their sum and the most terms of a row."""
    marked = np.full(columns, -1, dtype=np.int32)
    total, most = 0, 0
    for i in range(by_group.size - 1):
        terms = 0
        for t in range(by_group[i], by_group[i + 1]):
            b = body[t]
            terms += touch[b + 1] - touch[b]
            for g in group[touch[b] : touch[b + 1]]:
                if marked[g] != i:
                    marked[g] = i
                    total += 1
        begin[i + 1] = total
        most = max(most, terms)
    return total, most


@njit(types.void(LABELS, LABELS, int32[::1], uint64[::1]), cache=True, error_model="numpy")
def _merge(one, other, found, position):
    """Merge two increasing lists, and record the places of their elements in the union."""
    # unsigned throughout: a signed index is tested for its sign at every access
    u, v, n, step, end, other_end = uint64(0), uint64(0), uint64(0), uint64(1), uint64(one.size), uint64(other.size)
    while u < end and v < other_end:
        g, h = one[u], other[v]
        found[n] = min(g, h)
        position[u] = n
        position[end + v] = n
        u += uint64(g <= h)
        v += uint64(h <= g)
        n += step
    while u < end:
        found[n] = one[u]
        position[u] = n
        u += step
        n += step
    while v < other_end:
        found[n] = other[v]
        position[end + v] = n
        v += step
        n += step


@njit(types.void(DATA, int64, int64, DATA, int64, float64[:, ::1]), cache=True, error_model="numpy")
def _block_row(p, stride, size, q, width, terms):
    """Compute terms = pᵀq, p of shape (size, rows of terms) with rows `stride` apart, q of shape (size, width)."""
    if terms.shape[0] == 3 and size % 3 == 0:
        t0, t1, t2 = terms[0, :width], terms[1, :width], terms[2, :width]
        for k in range(0, size, 3):
            x, y, z = p[k * stride :][:3], p[(k + 1) * stride :][:3], p[(k + 2) * stride :][:3]
            x0, x1, x2, y0, y1, y2, z0, z1, z2 = x[0], x[1], x[2], y[0], y[1], y[2], z[0], z[1], z[2]
            q0, q1, q2 = q[k * width :][:width], q[(k + 1) * width :][:width], q[(k + 2) * width :][:width]
            if k == 0:
                for c in range(width):
                    e, f, g = q0[c], q1[c], q2[c]
                    t0[c] = x0 * e + y0 * f + z0 * g
                    t1[c] = x1 * e + y1 * f + z1 * g
                    t2[c] = x2 * e + y2 * f + z2 * g
            else:
                for c in range(width):
                    e, f, g = q0[c], q1[c], q2[c]
                    t0[c] = t0[c] + x0 * e + y0 * f + z0 * g
                    t1[c] = t1[c] + x1 * e + y1 * f + z1 * g
                    t2[c] = t2[c] + x2 * e + y2 * f + z2 * g
    else:
        for a in range(terms.shape[0]):
            term = terms[a, :width]
            term[:] = 0.0
            for k in range(size):
                x, row = p[k * stride + a], q[k * width :][:width]
                for c in range(width):
                    term[c] += x * row[c]


@njit(inline="always", error_model="numpy")
def _unite(bodies, touch, group, i, n, marked, place, found, position):
    """Record the n groups that more than two bodies touch, increasing, and the places of their pairs in the union."""
    k = 0
    for b in bodies:
        for g in group[touch[b] : touch[b + 1]]:
            if marked[g] != i:
                marked[g] = i
                found[k] = g
                k += 1
    found[:n].sort()
    for k in range(n):
        place[found[k]] = k
    k = 0
    for b in bodies:
        for g in group[touch[b] : touch[b + 1]]:
            position[k] = place[g]
            k += 1


@njit(inline="always", error_model="numpy")
def _write_columns(found, n, dq, dp, indices):
    """Write the columns of the dp rows of a group, which are alike."""
    width = n * dq
    index = indices[:width]
    if dq == 3:
        for k in range(n):
            column = 3 * found[k]
            index[3 * k], index[3 * k + 1], index[3 * k + 2] = column, column + 1, column + 2
    else:
        for k in range(n):
            for c in range(dq):
                index[k * dq + c] = found[k] * dq + c
    for a in range(1, dp):
        copied = indices[a * width :][:width]
        for k in range(width):
            copied[k] = index[k]


@njit(inline="always", error_model="numpy")
def _add_blocks(blocks, where, dq, entry, a):
    """Add row a of the blocks of a body to a row of W, at the places `where`."""
    term = blocks[a]
    if dq == 3:
        for k in range(where.size):
            e = uint64(3) * where[k]
            entry[e] += term[k, 0]
            entry[e + uint64(1)] += term[k, 1]
            entry[e + uint64(2)] += term[k, 2]
    else:
        for k in range(where.size):
            for c in range(dq):
                entry[int64(where[k]) * dq + c] += term[k, c]


@njit(
    [
        int64(
            *(COUNTS, LABELS, COUNTS),
            *(COUNTS, LABELS, COUNTS, DATA, int64),
            *(COUNTS, LABELS, COUNTS, DATA, int64),
            *(COUNTS, int64, int64, i[::1], i[::1], float64[::1]),
        )
        for i in INDEX_KINDS
    ],
    cache=True,
    error_model="numpy",
)
def multiply_blocks(
    by_group,
    body,
    slot,
    p_touch,
    p_group,
    p_start,
    P,
    dp,
    q_touch,
    q_group,
    q_start,
    Q,
    dq,
    begin,
    columns,
    most,
    indptr,
    indices,
    W,
):
    """Fill indptr, indices and W, canonical CSR; return how many entries are zero.

    `begin` and `most` are those of count_blocks.

    The rows are made body by body, whatever their order: what is needed of a body is then still in the cache.
    """
    marked = np.full(columns, -1, dtype=np.int32)
    place = np.empty(columns, dtype=np.int64)
    found = np.empty(columns, dtype=np.int32)
    position = np.empty(most, dtype=np.uint64)
    terms = np.empty((dp, most * dq))
    blocks = terms.reshape(dp, most, dq)
    zeros = 0
    indptr[0] = 0
    for i in range(by_group.size - 1):
        for a in range(dp):
            indptr[i * dp + a + 1] = (begin[i] * dp + (begin[i + 1] - begin[i]) * (a + 1)) * dq
    for leader in range(p_touch.size - 1):
        for i in p_group[p_touch[leader] : p_touch[leader + 1]]:
            first, last = by_group[i], by_group[i + 1]
            if body[first] != leader:
                continue
            n = begin[i + 1] - begin[i]
            if last - first <= 2:
                b = body[last - 1]
                one = q_group[q_touch[leader] : q_touch[leader + 1]]
                other = q_group[q_touch[b] : q_touch[b + 1]] if b != leader else one[:0]
                _merge(one, other, found, position)
            else:
                _unite(body[first:last], q_touch, q_group, i, n, marked, place, found, position)
            width = n * dq
            at = begin[i] * dp * dq
            _write_columns(found, n, dq, dp, indices[at : at + dp * width])
            clean = W[at : at + dp * width]
            for k in range(clean.size):  # numba's slice assignments cost more than loops
                clean[k] = 0.0
            shift = 0
            for t in range(first, last):
                b = body[t]
                count = q_touch[b + 1] - q_touch[b]
                if count == 0:
                    continue
                size = (q_start[b + 1] - q_start[b]) // (count * dq)
                p = P[p_start[b] + (slot[t] - p_touch[b]) * dp :]
                q = Q[q_start[b] : q_start[b + 1]]
                _block_row(p, (p_touch[b + 1] - p_touch[b]) * dp, size, q, count * dq, terms)
                where = position[shift : shift + count]
                shift += count
                for a in range(dp):
                    _add_blocks(blocks, where, dq, W[at + a * width :][:width], a)
            for k in range(clean.size):
                zeros += clean[k] == 0.0
    return zeros
