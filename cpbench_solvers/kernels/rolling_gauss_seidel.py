"""Nonsmooth Gauss–Seidel sweeps over contacts with rolling friction, each solved exactly for given others.

Moments are in units of a length of the contact: r and u are (N, T, M/ℓ) and (N, T, ωℓ).
"""

import numpy as np

from cpbench.foundation.kernels import (
    COLUMN,
    DATA,
    DATA_2D,
    START,
    VECTOR,
    boolean,
    float64,
    helper,
    int64,
    kernel,
    void,
)
from cpbench_solvers.kernels.contact_law import defect, velocity
from cpbench_solvers.kernels.rolling_local import natural_step, one_contact
from cpbench_solvers.kernels.sweep_progress import ITERATION, NEXT_CHECK, shuffled
from cpbench_solvers.kernels.vectors import put, square

HARD, RISKED = 2, 4
"""Places in `state`: contacts that the last sweep solved without Newton, and as many since the caller put it to 0."""
HARD_A_CALL = 500
"""These cost about 1 ms each: when there were as many, the caller looks at the clock."""
ERROR, LEAST = 0, 1
"""Places in `measured`: the judged error of r, and of `best`."""
SHARE = 8
"""The error is evaluated after every sweep at first, and never later than after an eighth more of them."""


@helper()
def _add_own(diagonal, c, own, v, u):
    """Set u = v + W_cc r_c."""
    d = v.size
    for i in range(d):
        u[i] = v[i]
        for j in range(d):
            u[i] += diagonal[c, d * i + j] * own[j]


_LAW = (START, COLUMN, DATA, DATA_2D, DATA, DATA, DATA, DATA, DATA)


@kernel(float64(*_LAW, DATA))
def judged(start, column, blocks, diagonal, q, mu, mu_r, rho, lengths, r):
    """Return max(natural, energy, opening) of `formulations.contact.contact_residuals`; NaN when anything is."""
    d = q.size // mu.size
    v, u, zero, x = np.empty(d), np.empty(d), np.zeros(d), np.empty(d - 1)
    plain_r, plain_u, plain_q = np.empty(d), np.empty(d), np.empty(d)
    natural = energy = opening = 0.0
    rr = uu = qq = rr_e = uu_e = qq_e = 0.0
    for c in range(mu.size):
        own, free = r[d * c : d * c + d], q[d * c : d * c + d]
        velocity(start, column, blocks, q, r, c, v)
        _add_own(diagonal, c, own, v, u)
        energy += defect(own, u, mu[c], mu_r[c], rho[c], x) / rho[c]
        opening += rho[c] * defect(zero, u, mu[c], mu_r[c], 1.0, x)
        rr_e += square(own) / rho[c]
        uu_e += square(u) * rho[c]
        qq_e += square(free) * rho[c]
        for i in range(d):  # with moments as such
            unit = lengths[c] if i > (d - 1) // 2 else 1.0
            plain_r[i], plain_u[i], plain_q[i] = own[i] * unit, u[i] / unit, free[i] / unit
        natural += defect(plain_r, plain_u, mu[c], mu_r[c] * lengths[c], 1.0, x)
        rr += square(plain_r)
        uu += square(plain_u)
        qq += square(plain_q)
    if qq > 0.0:
        natural /= max(qq, max(rr, uu))
        energy /= max(qq_e, max(rr_e, uu_e))
        opening /= qq_e
    worst = np.sqrt(natural) if not natural < energy else np.sqrt(energy)
    return worst if not worst < opening else opening


@kernel(
    void(
        *_LAW,
        DATA_2D,
        DATA_2D,
        DATA_2D,
        DATA_2D,
        VECTOR,
        VECTOR,
        float64[:, ::1],
        int64[::1],
        float64,
        boolean,
        float64,
        int64,
        int64[::1],
        VECTOR,
        boolean,
    )
)
def sweeps(
    start, column, blocks, diagonal, q, mu, mu_r, rho, lengths, schur, to_tangent, to_normal, scalars,
    r, best, warm, order, omega, shuffle, tolerance, until, state, measured, watched,
):  # fmt: skip
    """Sweep in place on r to a judged error of at most `tolerance`, NaN, or `until` sweeps; less for hard contacts.

    Parameters
    ----------
    start, column, blocks : block-CSR of W without its diagonal blocks. diagonal : (nc, d²).
    q, r, best : (nc·d,). mu, mu_r, rho, lengths : (nc,).
    schur : (nc, (d−1)²). to_tangent, to_normal : (nc, d−1), W_XN/W_NN and W_NX/W_NN.
    scalars : (nc, 3), the shift that makes S safely invertible; 1/W_NN, 0 where it is not positive; whether the
    block is monotone, which is when there is something to bracket.
    warm : (nc, 2), λ and κ. order : (nc,), the order of a sweep. watched : come back after every evaluation.
    """
    d = q.size // mu.size
    n = d - 1
    u, v, x, dx, b = np.empty(d), np.empty(d), np.empty(n), np.empty(n), np.empty(n)
    A, pivots = np.empty((n, n)), np.empty(n, np.int64)
    if state[NEXT_CHECK] == 0:
        measured[ERROR] = measured[LEAST] = judged(start, column, blocks, diagonal, q, mu, mu_r, rho, lengths, r)
        put(best, r)
        state[NEXT_CHECK] = 1
        if watched or measured[ERROR] <= tolerance or not np.isfinite(measured[ERROR]):
            return
    while state[ITERATION] < until:
        if shuffle:
            shuffled(order, state)
        hard = 0
        for place in range(order.size):
            c = order[place]
            own = r[d * c : d * c + d]
            velocity(start, column, blocks, q, r, c, v)
            found, easy, rn = False, False, 0.0
            inverse = scalars[c, 1]
            if v[0] >= 0.0:  # the others push it off: no force
                found = easy = True
                x[:] = 0.0
            elif inverse > 0.0:
                for i in range(n):
                    b[i] = v[1 + i] - to_tangent[c, i] * v[0]
                block = (schur[c], to_normal[c], scalars[c, 0], scalars[c, 2] > 0.0)
                free = -v[0] * inverse
                found, easy, rn = one_contact(*block, free, b, mu[c], mu_r[c], warm[c], x, dx, A, pivots)
            if not easy:  # bracketed: about 1 ms, see HARD_A_CALL
                hard += 1
            if not found:
                _add_own(diagonal, c, own, v, u)
                rn = natural_step(own, u, mu[c], mu_r[c], rho[c], x)
            own[0] += omega * (rn - own[0])
            for i in range(n):
                own[1 + i] += omega * (x[i] - own[1 + i])
        state[ITERATION] += 1
        state[HARD] = hard
        state[RISKED] += hard
        it = state[ITERATION]
        if it >= state[NEXT_CHECK] or it == until:
            state[NEXT_CHECK] = it + 1 + it // SHARE
            error = judged(start, column, blocks, diagonal, q, mu, mu_r, rho, lengths, r)
            measured[ERROR] = error
            if error < measured[LEAST]:
                measured[LEAST] = error
                put(best, r)
            if watched or error <= tolerance or not np.isfinite(error):
                return
        if state[RISKED] >= HARD_A_CALL:  # after a whole sweep, so that it can go on at the first contact
            return
