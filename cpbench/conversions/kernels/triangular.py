"""Sparse triangular systems with sparse right-hand sides, and an ordering that makes them cheap.

The nonzeros of x = L⁻¹b are the nodes that can be reached from those of b in the graph of L (Gilbert and Peierls 1988).
In an elimination tree of small height few are: nested dissection (George 1973) gives such a tree, with level sets of
a breadth-first search as separators.
"""

import numpy as np
from numba import boolean, float64, int32, int64, njit, types

LEAF = 8  # parts up to this size are not cut any more
LONG = 4  # parts with at most this many nodes a level are cut at the levels they have, not searched again


def _readonly(kind):
    return types.Array(kind, 1, "C", readonly=True)


_INDEX, _LONG, _DATA = _readonly(int32), _readonly(int64), _readonly(float64)


@njit(int64(_INDEX, _INDEX, int64, int32[::1], int64, int32[::1], int32[::1]), cache=True, error_model="numpy")
def _levels(indptr, indices, start, part, label, queue, depth):
    """Search breadth-first from `start` among the nodes of that label: fill queue and depth, return how many were
    reached.

    The label of what was found becomes -label - 2, so that nothing is found twice.
    """
    queue[0], depth[start], part[start] = start, 0, -label - 2
    head, tail = 0, 1
    while head < tail:
        node = queue[head]
        head += 1
        for other in indices[indptr[node] : indptr[node + 1]]:
            if part[other] == label:
                part[other] = -label - 2
                depth[other] = depth[node] + 1
                queue[tail] = other
                tail += 1
    return tail


@njit(types.void(int32[::1], int32[::1], int32[::1]), cache=True, error_model="numpy")
def _halve_levels(queue, depth, order):
    """Order a long part (a band, a path): its middle level last, before that the two halves, likewise."""
    levels = depth[queue[queue.size - 1]] + 1
    start = np.empty(levels + 1, dtype=np.int32)
    start[levels] = queue.size
    for k in range(queue.size - 1, -1, -1):
        start[depth[queue[k]]] = k
    stack = [(0, 0, levels)]
    while len(stack) > 0:
        place, low, high = stack.pop()
        if high <= low:
            continue
        middle = (low + high) // 2
        last = place + start[high] - start[low]
        width = start[middle + 1] - start[middle]
        for k in range(width):
            order[last - width + k] = queue[start[middle] + k]
        stack.append((place, low, middle))
        stack.append((place + start[middle] - start[low], middle + 1, high))


@njit(types.void(_INDEX, _INDEX, int32[::1]), cache=True, error_model="numpy")
def dissect(indptr, indices, order):
    """Set order[i] to the node eliminated as number i, for a symmetric graph (loops do not matter)."""
    n = order.size
    part, depth, queue = np.zeros(n, dtype=np.int32), np.empty(n, dtype=np.int32), np.empty(n, dtype=np.int32)
    for i in range(n):
        order[i] = i
    stack = [(0, n, 0)]
    labels = 1
    while len(stack) > 0:
        first, last, label = stack.pop()
        size = last - first
        if size <= LEAF:
            continue
        found = _levels(indptr, indices, order[first], part, label, queue, depth)
        levels = depth[queue[found - 1]] + 1
        if found == size and LONG * levels >= size:
            _halve_levels(queue[:size], depth, order[first:last])
            continue
        if found == size:  # from the far end once more
            end = queue[found - 1]
            for k in range(found):
                part[queue[k]] = label
            found = _levels(indptr, indices, end, part, label, queue, depth)
            levels = depth[queue[found - 1]] + 1
        cut = 0
        if found == size:
            if levels < 3:
                continue
            # the thinnest level with a third of the nodes on either side, else the one of the median
            cut = depth[queue[size // 2]]
            cut = min(max(cut, 1), levels - 2)
            thinnest, k = size, 0
            while k < size:
                level, before = depth[queue[k]], k
                while k < size and depth[queue[k]] == level:
                    k += 1
                if 3 * before >= size and 3 * (size - k) >= size and k - before < thinnest:
                    cut, thinnest = level, k - before
        left, right = labels, labels + 1
        labels += 2
        if found < size:  # another component
            k = first + found
            for i in range(first, last):
                if part[order[i]] == label:
                    depth[order[i]] = k  # its place, for a moment
                    part[order[i]] = right
                    k += 1
            nodes = order[first:last].copy()
            for node in nodes:
                if part[node] == right:
                    order[depth[node]] = node
            for k in range(found):
                order[first + k] = queue[k]
                part[queue[k]] = left
            stack.append((first, first + found, left))
            stack.append((first + found, last, right))
            continue
        i = first
        for k in range(size):
            if depth[queue[k]] < cut:
                order[i] = queue[k]
                part[queue[k]] = left
                i += 1
        middle = i
        for k in range(size):
            if depth[queue[k]] > cut:
                order[i] = queue[k]
                part[queue[k]] = right
                i += 1
        stack.append((first, middle, left))
        stack.append((middle, i, right))
        for k in range(size):
            if depth[queue[k]] == cut:
                order[i] = queue[k]
                part[queue[k]] = -1
                i += 1


@njit(int64(_INDEX, _INDEX, _INDEX, int64, int32[::1], int64[::1]), cache=True, error_model="numpy")
def eliminate(indptr, indices, order, limit, parent, count):
    """Compute the elimination tree of a symmetric graph in that order, and the entries of each column of its factor L.

    Returns the entries of L, or -1 as soon as they exceed `limit`.
    """
    n = order.size
    place, ancestor, mark = np.empty(n, dtype=np.int32), np.full(n, -1, dtype=np.int32), np.full(n, -1, dtype=np.int32)
    for i in range(n):
        place[order[i]] = i
    parent[:] = -1
    count[:] = 1
    total = n
    for i in range(n):
        for other in indices[indptr[order[i]] : indptr[order[i] + 1]]:
            j = place[other]
            while j < i and j != -1:
                up = ancestor[j]
                ancestor[j] = i
                if up == -1:
                    parent[j] = i
                    break
                if up == i:
                    break
                j = up
        mark[i] = i
        for other in indices[indptr[order[i]] : indptr[order[i] + 1]]:
            j = place[other]
            if j >= i:
                continue
            while mark[j] != i:
                mark[j] = i
                count[j] += 1
                total += 1
                j = parent[j]
        if total > limit:
            return -1
    return total


@njit(int64[::1](_INDEX, _LONG, int64), cache=True, error_model="numpy")
def gather_up(parent, own, limit):
    """Sum `own` over the nodes of every subtree, at most `limit`."""
    total = own.copy()
    for k in range(parent.size):
        total[k] = min(total[k], limit)
        if parent[k] >= 0:
            total[parent[k]] += total[k]
    return total


@njit(
    int64(_INDEX, int64, int64, _LONG, _LONG, _INDEX, _INDEX, int32[::1], int64[::1], int32[::1]),
    cache=True,
    error_model="numpy",
)
def _reach(b_index, top, stamp, begin, end, l_index, column_of, mark, at, work):
    """Find the nodes reached from those in b_index, at work[top:n], each before those it leads to; return top.

    Node i leads to l_index[begin[j]:end[j]] with j = column_of[i], nowhere when j < 0. `work` is the list and a stack.
    """
    n = mark.size
    reached, stack = work[:n], work[n:]
    for first in b_index:
        if mark[first] == stamp:
            continue
        mark[first] = stamp
        stack[0] = first
        j = column_of[first]
        at[0] = begin[j] if j >= 0 else 0
        height = 1
        while height > 0:
            node = stack[height - 1]
            j = column_of[node]
            k = at[height - 1]
            stop = end[j] if j >= 0 else 0
            while k < stop and mark[l_index[k]] == stamp:
                k += 1
            if k >= stop:
                height -= 1
                top -= 1
                reached[top] = node
            else:
                at[height - 1] = k + 1
                node = l_index[k]
                mark[node] = stamp
                stack[height] = node
                j = column_of[node]
                at[height] = begin[j] if j >= 0 else 0
                height += 1
    return top


@njit(types.Tuple((int32[::1], float64[::1]))(int32[::1], float64[::1], int64), cache=True, error_model="numpy")
def _room(index, value, needed):
    """Return the same arrays, or copies with twice the room where they have less than needed."""
    if needed <= index.size:
        return index, value
    more_index, more_value = np.empty(2 * needed, dtype=np.int32), np.empty(2 * needed)
    for k in range(index.size):
        more_index[k], more_value[k] = index[k], value[k]
    return more_index, more_value


_TRIANGLE = types.Tuple((int64[::1], int32[::1], float64[::1]))


@njit(
    types.Tuple((boolean, int32[::1], _TRIANGLE, _TRIANGLE, float64[::1]))(_INDEX, _INDEX, _DATA, float64, int64),
    cache=True,
    error_model="numpy",
)
def factor(a_ptr, a_index, a, threshold, room):
    """Factor PA = LU by columns (Gilbert and Peierls 1988).

    The diagonal entry of A is the pivot when it is at least `threshold` times the greatest candidate. L and U are
    expected to have `room` entries each.

    Returns whether no pivot is zero; row of A -> row of PA; L and U without their diagonals, by columns, the entries
    of a column in no order; the diagonal of U.
    """
    n = a_ptr.size - 1
    row_of = np.full(n, -1, dtype=np.int32)
    mark, at, work = np.full(n, -1, dtype=np.int32), np.empty(n, dtype=np.int64), np.empty(2 * n, dtype=np.int32)
    x = np.zeros(n)
    l_ptr, u_ptr = np.zeros(n + 1, dtype=np.int64), np.zeros(n + 1, dtype=np.int64)
    pivots = np.zeros(n)
    l_index, l_value = np.empty(room, dtype=np.int32), np.empty(room)
    u_index, u = np.empty(room, dtype=np.int32), np.empty(room)
    for c in range(n):
        entries = a_index[a_ptr[c] : a_ptr[c + 1]]
        top = _reach(entries, n, c, l_ptr[:-1], l_ptr[1:], l_index, row_of, mark, at, work)
        l_index, l_value = _room(l_index, l_value, l_ptr[c] + n - top)
        u_index, u = _room(u_index, u, u_ptr[c] + n - top)
        for e in range(a_ptr[c], a_ptr[c + 1]):
            x[a_index[e]] = a[e]
        lower, upper = l_ptr[c], u_ptr[c]
        greatest, pivot = 0.0, -1
        for node in work[top:n]:
            j = row_of[node]
            z = x[node]
            if j >= 0:
                for e in range(l_ptr[j], l_ptr[j + 1]):
                    x[l_index[e]] -= l_value[e] * z
                x[node] = 0.0
                if z != 0.0:  # it may have cancelled, or faded along a chain
                    u_index[upper], u[upper] = j, z
                    upper += 1
            else:
                l_index[lower] = node
                lower += 1
        for e in range(l_ptr[c], lower):
            if abs(x[l_index[e]]) > greatest:
                greatest, pivot = abs(x[l_index[e]]), l_index[e]
        if not greatest > 0.0:
            return False, row_of, (l_ptr, l_index, l_value), (u_ptr, u_index, u), pivots
        if row_of[c] < 0 and mark[c] == c and abs(x[c]) >= threshold * greatest:
            pivot = c
        value = x[pivot]
        row_of[pivot] = c
        pivots[c] = value
        u_ptr[c + 1] = upper
        kept = l_ptr[c]
        for e in range(l_ptr[c], lower):
            node = l_index[e]
            if node != pivot and x[node] != 0.0:
                l_index[kept], l_value[kept] = node, x[node] / value
                kept += 1
            x[node] = 0.0
        l_ptr[c + 1] = kept
    for e in range(l_ptr[n]):
        l_index[e] = row_of[l_index[e]]
    end, u_end = l_ptr[n], u_ptr[n]
    return True, row_of, (l_ptr, l_index[:end], l_value[:end]), (u_ptr, u_index[:u_end], u[:u_end]), pivots


@njit(_TRIANGLE(_LONG, _INDEX, _DATA, _DATA, _INDEX, _INDEX, _DATA), cache=True, error_model="numpy")
def solve(t_ptr, t_index, t, diagonal, b_ptr, b_index, b):
    """Solve TX = B, all by columns, for T with these entries off its diagonal; the entries of a column are in no
    order.
    """
    n, columns = t_ptr.size - 1, b_ptr.size - 1
    mark, at, work = np.full(n, -1, dtype=np.int32), np.empty(n, dtype=np.int64), np.empty(2 * n, dtype=np.int32)
    column_of, x = np.arange(n).astype(np.int32), np.zeros(n)
    ptr = np.zeros(columns + 1, dtype=np.int64)
    room = max(16 * b_index.size, 1024)
    index, value = np.empty(room, dtype=np.int32), np.empty(room)
    for c in range(columns):
        entries = b_index[b_ptr[c] : b_ptr[c + 1]]
        top = _reach(entries, n, c, t_ptr[:-1], t_ptr[1:], t_index, column_of, mark, at, work)
        index, value = _room(index, value, ptr[c] + n - top)
        for e in range(b_ptr[c], b_ptr[c + 1]):
            x[b_index[e]] = b[e]
        place = ptr[c]
        for node in work[top:n]:
            z = x[node] / diagonal[node]
            x[node] = 0.0
            if z != 0.0:
                for e in range(t_ptr[node], t_ptr[node + 1]):
                    x[t_index[e]] -= t[e] * z
                index[place], value[place] = node, z
                place += 1
        ptr[c + 1] = place
    return ptr, index[: ptr[columns]].copy(), value[: ptr[columns]].copy()


@njit(types.void(_INDEX, _INDEX, _DATA, _INDEX, _INDEX, _DATA, float64[:, ::1]), cache=True, error_model="numpy")
def add_product(y_ptr, y_index, y, x_ptr, x_index, x, M):
    """Add YX to M for Y and X by rows and M dense."""
    line = np.zeros(M.shape[1])  # stays in cache, where a row of M would be fetched at random places
    for i in range(M.shape[0]):
        for e in range(y_ptr[i], y_ptr[i + 1]):
            scale, k = y[e], y_index[e]
            columns = x_index[x_ptr[k] : x_ptr[k + 1]]
            values = x[x_ptr[k] : x_ptr[k + 1]]
            for c in range(columns.size):
                line[columns[c]] += scale * values[c]
        row = M[i]
        for c in range(line.size):
            row[c] += line[c]
            line[c] = 0.0


@njit(types.void(types.Array(float64, 2, "C", readonly=True), _LONG, int32[::1], float64[::1]), cache=True)
def compress(M, indptr, indices, data):
    """Compress the nonzero entries of a dense M by rows, indptr given."""
    for i in range(M.shape[0]):
        row, k = M[i], indptr[i]
        for j in range(row.size):
            if row[j] != 0.0:
                indices[k], data[k] = j, row[j]
                k += 1
