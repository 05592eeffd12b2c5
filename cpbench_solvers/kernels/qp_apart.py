"""The connected parts of a quadratic program solved one by one, the small ones by one compiled call for all."""

import numpy as np

from cpbench.foundation.kernels import DATA, INDEX, VECTOR, boolean, float64, helper, int64, kernel, tuple_of, void
from cpbench_solvers.kernels.qp_dual import SOLVED
from cpbench_solvers.kernels.qp_ldl import CSR
from cpbench_solvers.kernels.qp_small import solve

INTS = int64[::1]
LEFT = -1
"""The outcome of parts that are too large for the call."""


@kernel(tuple_of(*[INTS] * 2)(INDEX, int64))
def members(part, count):
    """Return (start, row): row[start[q]:start[q + 1]] are the members of part q, in their order."""
    start, row = np.zeros(count + 1, np.int64), np.empty(part.size, np.int64)
    for q in part:  # counting sort: members of a part stay in their order
        start[q + 1] += 1
    for q in range(count):
        start[q + 1] += start[q]
    at = start[:-1].copy()
    for i in range(part.size):
        row[at[part[i]]] = i
        at[part[i]] += 1
    return start, row


@helper(float64[:, ::1](CSR, INTS, INTS, int64))
def _dense(M, rows, place, columns):
    """Return some rows as a dense matrix; place : of every column among the `columns` of the part."""
    result = np.zeros((rows.size, columns))
    for i in range(rows.size):
        for k in range(M[0][rows[i]], M[0][rows[i] + 1]):
            if M[2][k] != 0.0:
                result[i, place[M[1][k]]] += M[2][k]  # entries that are stored twice add up
    return result


@helper(boolean(float64, float64, float64, float64, VECTOR, VECTOR, int64))
def _alone(q, p, low, high, z, nu, i):
    """Write the answer of an unknown without rows and neighbours; return whether there is one."""
    at = -p / q if q > 0.0 else (low if p > 0.0 else high if p < 0.0 else 0.0)
    at = min(max(at, low), high)  # one unknown: the minimum over an interval is the nearest point to the free one
    if q < 0.0 or not abs(at) < np.inf:  # concave, or falling for ever: for the caller, who looks for a proof
        return False
    force = q * at + p
    z[i], nu[i] = at, force if (force > 0.0 and at == low) or (force < 0.0 and at == high) else 0.0
    return True


@kernel(
    void(
        *(CSR, CSR, DATA, DATA, int64, DATA, DATA, INDEX, int64, int64),
        *(float64, float64, float64, float64, int64, int64),
        *(VECTOR, VECTOR, VECTOR, INTS, INTS),
    )
)
def solve_parts(
    Q, G, p, h, m, lb, ub, part, count, most, tolerance, psd, proximal, feasible, passes, operations,
    z, y, nu, outcome, counts,
):  # fmt: skip
    """Write the answers of parts of up to `most` unknowns, and as many rows, with the outcome of each.

    Parameters
    ----------
    part : (n + r,) the part of every unknown and row, of `count`. tolerance, ..., operations : as `qp_small.solve` has
    them, passes for each unknown and row. z (n,), y (r,), nu (n,), outcome (count,), counts (2,) : passes and steps.
    """
    n = p.size
    start, row = members(part, count)
    place = np.empty(n, np.int64)
    for q in range(count):
        own = row[start[q] : start[q + 1]]
        unknowns = np.searchsorted(own, n)
        inequalities = np.searchsorted(own, n + m)
        at, first, last = own[:unknowns], own[unknowns:inequalities] - n, own[inequalities:] - n
        # dense matrices of a large part would cost more than its sparse ones
        if unknowns == 0 or unknowns > most or own.size > 3 * most:
            outcome[q] = LEFT
            continue
        for j in range(unknowns):
            place[at[j]] = j
        H = _dense(Q, at, place, unknowns)
        i = at[0]
        if own.size == 1 and _alone(H[0, 0], p[i], lb[i], ub[i], z, nu, i):
            outcome[q] = SOLVED
            continue
        x, error, done = np.zeros(2 * unknowns + own.size - unknowns), np.empty(1), np.zeros(4, np.int64)
        own_z, lam = x[:unknowns], x[unknowns : unknowns + first.size]
        mu, own_nu = x[unknowns + first.size : own.size], x[own.size :]
        A, C = _dense(G, first, place, unknowns), _dense(G, last, place, unknowns)
        outcome[q] = solve(
            H, p[at], A, h[first], C, h[last], lb[at], ub[at],
            tolerance, psd, proximal, feasible, np.inf, passes * (own.size + 10), operations,
            own_z, lam, mu, own_nu, error, done,
        )  # fmt: skip
        z[at], y[first], y[last], nu[at] = own_z, lam, mu, own_nu
        counts[0] += done[0]
        counts[1] += done[1]
