"""An order of elimination that leaves the factor of a sparse symmetric matrix sparse: approximate minimum degree.

Eliminated unknowns are kept as elements, lists of the unknowns that they connect. Amestoy, Davis and Duff 1996, SIAM J.
Matrix Anal. Appl. 17:886: the degree of an unknown is bounded by the sizes of its elements, elements within another one
are absorbed, and unknowns that only the newest element connects are eliminated with it. Unknowns with very many
neighbours come last, and are left out of the lists, each of which would be looked through in every elimination
(Amestoy, Davis and Duff 2004, ACM Trans. Math. Softw. 30:381).
"""

import numpy as np

from cpbench.foundation.kernels import boolean, helper, int32, int64, kernel, read_only, void

_INT = int64[::1]
DENSE, LEAST = 10.0, 16.0
"""Times √N is the number of neighbours beyond which an unknown comes last, and the least such number: those of 2004."""
_INDEX = read_only(int32)


@helper(void(int64, int64, _INT, _INT, _INT))
def _put_in(i, degree, head, after, before):
    """Put i into the list of its degree."""
    first = head[degree]
    after[i], before[i] = first, -1 - degree
    if first >= 0:
        before[first] = i
    head[degree] = i


@helper(void(int64, _INT, _INT, _INT))
def _take_out(i, head, after, before):
    """Take i out of the list of its degree."""
    if before[i] >= 0:
        after[before[i]] = after[i]
    else:
        head[-1 - before[i]] = after[i]
    if after[i] >= 0:
        before[after[i]] = before[i]


@helper()
def _room(need, store, begin, size):
    """Return a store with room for `need` more numbers, and how much of it is used: what was absorbed is left out."""
    live = need
    for e in range(size.size):
        live += max(size[e], 0)
    # twice what is needed: the next time is then as far away as the whole elimination has gone
    grown, at = np.empty(2 * live + size.size, np.int64), 0
    for e in range(size.size):
        for q in range(max(size[e], 0)):
            grown[at + q] = store[begin[e] + q]
        begin[e] = at
        at += max(size[e], 0)
    return grown, at


@helper(int64(_INT, _INT, boolean[::1]))
def _full_ones(degree, order, gone):
    """Write the unknowns with very many neighbours at the end of the order; return where they begin there."""
    N = last = order.size
    for i in range(N):
        if degree[i] > max(DENSE * np.sqrt(N), LEAST):
            last -= 1
            order[last], gone[i] = i, True
    order[last:] = order[last:][np.argsort(degree[order[last:]], kind="mergesort")]
    return last


@helper(int64(int64, int64, _INT, boolean[::1], _INT, int64))
def _met(i, p, seen, gone, store, at):
    """Put unknown i into the element of p where it is not yet in it, nor in the order; return how many were put."""
    if seen[i] == p or gone[i]:
        return 0
    seen[i] = p
    store[at] = i
    return 1


@kernel(void(_INDEX, _INDEX, _INT))
def minimum_degree(indptr, indices, order):
    """Write the order of a matrix whose pattern, without its diagonal, is symmetric. order : (N,)."""
    N = order.size
    near = np.empty(max(indices.size, 1), np.int64)  # of every unknown: its elements, then its other neighbours
    near[: indices.size] = indices
    start, others = indptr[:N].astype(np.int64), (indptr[1:] - indptr[:N]).astype(np.int64)
    elements = np.zeros(N, np.int64)
    head, after, before = np.full(N + 1, -1, np.int64), np.empty(N, np.int64), np.empty(N, np.int64)
    degree = others.copy()
    gone, rest = np.zeros(N, np.bool_), np.empty(N, np.int64)
    last = _full_ones(degree, order, gone)
    for i in range(N - 1, -1, -1):
        if not gone[i]:
            _put_in(i, degree[i], head, after, before)
    store, used = np.empty(2 * indices.size + N + 1, np.int64), 0  # the lists of the elements
    begin, size = np.zeros(N, np.int64), np.full(N, -1, np.int64)  # size < 0 : no element, or absorbed
    seen, outside, stamp = np.full(N, -1, np.int64), np.zeros(N, np.int64), np.full(N, -1, np.int64)
    done, least = 0, 0
    while done < last:
        while head[least] < 0:
            least += 1
        p = head[least]
        _take_out(p, head, after, before)
        order[done], gone[p], seen[p] = p, True, p
        done += 1
        need = others[p]
        for q in range(start[p], start[p] + elements[p]):
            need += size[near[q]]
        if used + need > store.size:
            store, used = _room(need, store, begin, size)
        first, count = used, 0
        for q in range(start[p], start[p] + elements[p]):
            e = near[q]
            for k in range(begin[e], begin[e] + size[e]):
                count += _met(store[k], p, seen, gone, store, first + count)
            size[e] = -1
        for q in range(start[p] + elements[p], start[p] + elements[p] + others[p]):
            count += _met(near[q], p, seen, gone, store, first + count)
        begin[p], size[p] = first, count
        # how much of every other element lies outside of this one
        for k in range(first, first + count):
            i = store[k]
            for q in range(start[i], start[i] + elements[i]):
                e = near[q]
                if size[e] < 0:
                    continue
                if stamp[e] != p:  # counted down from its size: the first member that meets it begins
                    stamp[e], outside[e] = p, size[e]
                outside[e] -= 1
        kept = 0
        for k in range(first, first + count):
            i = store[k]
            _take_out(i, head, after, before)
            moved = 0
            for q in range(start[i] + elements[i], start[i] + elements[i] + others[i]):
                j = near[q]
                if seen[j] != p and not gone[j]:
                    rest[moved] = j
                    moved += 1
            write, bound = start[i], 0
            for q in range(start[i], start[i] + elements[i]):
                e = near[q]
                if size[e] < 0:
                    continue
                if outside[e] <= 0:
                    size[e] = -1  # within the newest element
                    continue
                near[write] = e
                write += 1
                bound += outside[e]
            if write == start[i] and moved == 0:
                # all its neighbours are in this element: it may come next without any fill
                order[done], gone[i] = i, True
                done += 1
                continue
            # there is room: p, or an element that p has absorbed, stood in this list
            near[write] = p
            elements[i], others[i] = write + 1 - start[i], moved
            for q in range(moved):
                near[write + 1 + q] = rest[q]
            degree[i] = bound + moved
            store[first + kept] = i
            kept += 1
        size[p] = kept
        used = first + kept
        for k in range(first, first + kept):
            i = store[k]
            degree[i] = min(degree[i] + kept - 1, N - done - 1)
            _put_in(i, degree[i], head, after, before)
            least = min(least, degree[i])
