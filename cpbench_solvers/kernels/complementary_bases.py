"""All complementary bases of an LCP, one system of at most twenty unknowns each, by elimination with row pivoting."""

import numpy as np

from cpbench.foundation.kernels import MATRIX, VECTOR, boolean, helper, int64, kernel

EXCLUDED, FEASIBLE, DOUBTFUL, SINGULAR = 0, 1, 2, 3
"""Something is negative; nothing is; too close to tell; M_FF is singular and M_FF z_F = -q_F has many solutions."""
RANK = 1e-11
"""Pivots up to this share of max|M| are zero."""
NEAR = 1e-9
"""Values this close to zero, as a share of the largest, are of no certain sign; more where the pivots are small."""
ROUNDING = 1e-14


@helper(boolean(MATRIX, VECTOR, int64, MATRIX, int64[::1]))
def _consistent(M, q, k, A, F):
    """Return whether M_FF x = -q_F has a solution, by elimination with complete pivoting."""
    for a in range(k):
        for b in range(k):
            A[a, b] = M[F[a], F[b]]
        A[a, k] = -q[F[a]]
    for c in range(k):
        p, s = c, c
        for a in range(c, k):
            for b in range(c, k):
                if abs(A[a, b]) > abs(A[p, s]):
                    p, s = a, b
        # nothing is left on the left: the system has a solution if nothing is left on the right
        if abs(A[p, s]) <= RANK:
            rest = 0.0
            for a in range(c, k):
                rest = max(rest, abs(A[a, k]))
            return rest <= NEAR
        for b in range(k + 1):
            A[c, b], A[p, b] = A[p, b], A[c, b]
        for a in range(k):
            A[a, c], A[a, s] = A[a, s], A[a, c]
        for a in range(c + 1, k):
            t = A[a, c] / A[c, c]
            for b in range(c, k + 1):
                A[a, b] -= t * A[c, b]
    return True


@helper(int64(MATRIX, VECTOR, int64, MATRIX, int64[::1], VECTOR, VECTOR))
def basis(M, q, mask, A, F, z, closest):
    """Classify the basis of `mask` (bit i: i in F), its z in `z`; closest[0] grows to the least violation so far.

    M : (n, n), max|M| = 1. q : (n,). Workspace: A (n, n+1), F (n,).
    """
    n = q.size
    k = 0
    for i in range(n):
        z[i] = 0.0
        if mask >> i & 1:
            F[k] = i
            k += 1
    for a in range(k):
        for b in range(k):
            A[a, b] = M[F[a], F[b]]
        A[a, k] = -q[F[a]]
    smallest = 1.0
    singular = False
    for c in range(k):
        p = c
        for a in range(c + 1, k):
            if abs(A[a, c]) > abs(A[p, c]):
                p = a
        if abs(A[p, c]) <= RANK:
            singular = True
            break
        smallest = min(smallest, abs(A[p, c]))  # how small pivots were says how many digits z has
        if p != c:
            for b in range(c, k + 1):
                A[c, b], A[p, b] = A[p, b], A[c, b]
        for a in range(c + 1, k):
            t = A[a, c] / A[c, c]
            if t != 0.0:
                for b in range(c + 1, k + 1):
                    A[a, b] -= t * A[c, b]
    if singular:
        # many solutions or none: which of them is z ≥ 0 another program decides
        return SINGULAR if _consistent(M, q, k, A, F) else EXCLUDED
    largest_z = 0.0
    for a in range(k - 1, -1, -1):
        value = A[a, k]
        for b in range(a + 1, k):
            value -= A[a, b] * z[F[b]]
        z[F[a]] = value / A[a, a]
        largest_z = max(largest_z, abs(z[F[a]]))
    least = 0.0
    for i in range(n):
        if mask >> i & 1:
            # relative to z as a whole: a small z_i has its error from the large ones
            least = min(least, z[i] / max(1.0, largest_z))
        else:
            w, size = q[i], max(1.0, abs(q[i]))
            for a in range(k):
                w += M[i, F[a]] * z[F[a]]
                size = max(size, abs(M[i, F[a]] * z[F[a]]))  # what w_i is the rounding of, where terms cancel
            least = min(least, w / size)
    closest[0] = max(closest[0], least)
    near = max(NEAR, ROUNDING / smallest)
    if least < -near:
        return EXCLUDED
    return FEASIBLE if least >= -ROUNDING / smallest else DOUBTFUL  # between both more digits would be needed


@kernel(int64(MATRIX, VECTOR, int64, int64, int64[::1], int64[::1], VECTOR))
def scan(M, q, begin, end, masks, kinds, closest):
    """Look at the bases `begin` to `end` - 1: those not excluded go to `masks`, what they are to `kinds`.

    Returns how many these are. masks, kinds : (end - begin,) at least.
    """
    n = q.size
    A, F, z = np.empty((n, n + 1)), np.empty(n, np.int64), np.empty(n)
    found = 0
    for mask in range(begin, end):
        kind = basis(M, q, mask, A, F, z, closest)
        if kind != EXCLUDED:
            masks[found], kinds[found] = mask, kind
            found += 1
    return found
