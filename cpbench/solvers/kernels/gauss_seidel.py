"""Nonsmooth Gauss–Seidel sweeps over contacts, with the one-contact problem solved exactly, in 2D and 3D.

One contact with local velocity u = D r + v (v: all other contacts and q) is solved case by case: separation when
v_N ≥ 0; else u_N = 0 gives r_N and leaves S r_T + b = u_T with the Schur complement S of D, not symmetrised. Sticking
is u_T = 0. Sliding is (S + λI) r_T = -b with λ > 0 such that ‖r_T‖ = μ r_N, found by Newton's method on the secular
equation 1/(μ r_N) = 1/‖r_T‖, kept inside a bracket. λ is the ratio ‖u_T‖/‖r_T‖ and is remembered from sweep to sweep.

Fast-math is limited to reassociation and contraction: NaN and infinity keep their meaning.
"""

import numpy as np
from numba import boolean, float64, int64, njit, types, uint32, uint64

from cpbench.solvers.kernels.block_row import fetch, row_product

FAST = {"reassoc", "contract", "arcp", "nsz"}
DATA = types.Array(float64, 1, "C", readonly=True)
DATA_2D = types.Array(float64, 2, "C", readonly=True)
START = types.Array(uint64, 1, "C", readonly=True)
COLUMN = types.Array(uint32, 1, "C", readonly=True)
VECTOR = float64[::1]

CONTINUE, CONVERGED, NOT_FINITE = 0, 1, 2
"""What the sweeps return: they have come to `until` or the log is full; the error is small enough; NaN."""

ITERATION, NEXT_CHECK, LOGGED, RANDOM, LAST_CHECK = range(5)
"""Places in `state`; LOGGED counts the evaluations of the error."""
PACE, LAST_ERROR, LEAST = range(3)
"""Places in `measured`: the square of the error over that of the change, and the error, from the last evaluation; the
least error so far."""

PROJECT, INVERSE_NN, S11, S12, S21, S22, TN1, TN2, NT1, NT2, FLOOR, INDEFINITE = range(12)
"""Columns of `local`: 1 where the normal equation cannot be solved for r_N; 1/W_NN; S; W_TN/W_NN; W_NT/W_NN; the
least λ for which S + λI is safely invertible; 1 where S has a negative eigenvalue."""

CACHED, AHEAD, LINE = 1 << 20, 20, 8
"""Of more numbers than a near cache holds, the blocks of the contact that is AHEAD places on are asked for, a LINE of
eight numbers at a time: the solution of one contact waits for nothing then, and memory does not wait for it."""
NEWTON = 80
"""Steps on the secular equation; bisection, where it must, has found the root by then."""
SMALL = 1e-14
LINEAR = 1e-14
"""Square of the share of r_T by which a last step may change it and be as exact when it is linear."""


@njit(fastmath=FAST, error_model="numpy")
def _projected(x0, x1, x2, mu):
    """P_K of one vector."""
    t = np.sqrt(x1 * x1 + x2 * x2)
    if t <= mu * x0:
        return x0, x1, x2
    if mu * t <= -x0:
        return 0.0, 0.0, 0.0
    normal = (mu * t + x0) / (1.0 + mu * mu)
    factor = mu * normal / t
    return normal, factor * x1, factor * x2


@njit(fastmath=FAST, error_model="numpy")
def natural_step(r0, r1, r2, u0, u1, u2, mu, rho):
    """P_K(r - ρ û): a fixed point is a solution, whatever the block is like."""
    hat = u0 + mu * np.sqrt(u1 * u1 + u2 * u2)
    return _projected(r0 - rho * hat, r1 - rho * u1, r2 - rho * u2, mu)


@njit(fastmath=FAST, error_model="numpy")
def one_contact_3d(local, i, v0, v1, v2, mu, lam):
    """(found, r_N, r_T1, r_T2, λ) of u = D r + v; not found only for indefinite blocks."""
    if v0 >= 0.0:
        return True, 0.0, 0.0, 0.0, lam
    iw = local[i, INVERSE_NN]
    free = -v0 * iw
    if mu == 0.0:
        return True, free, 0.0, 0.0, lam
    a, b, c, d = local[i, S11], local[i, S12], local[i, S21], local[i, S22]
    b1 = v1 - local[i, TN1] * v0
    b2 = v2 - local[i, TN2] * v0
    h1, h2 = local[i, NT1], local[i, NT2]
    floor = local[i, FLOOR]
    # with the adjugate, x = y/det: quotients take longer than all the rest
    stick = 0.0 if local[i, INDEFINITE] != 0.0 else floor
    al, dl = a + stick, d + stick
    det = al * dl - b * c
    y1, y2 = b * b2 - dl * b1, c * b1 - al * b2
    normal = free * det - h1 * y1 - h2 * y2
    if normal * det > 0.0 and y1 * y1 + y2 * y2 <= mu * mu * normal * normal:
        inverse = 1.0 / det
        return True, normal * inverse, y1 * inverse, y2 * inverse, lam
    if not lam > floor:  # exact for S = sI without coupling to the normal
        lam = np.sqrt(b1 * b1 + b2 * b2) / (mu * free) - 0.5 * (a + d)
        if not lam > floor:
            lam = floor + 0.05 * max(abs(a) + abs(d), abs(floor))
    low, high = floor, np.inf
    for _ in range(NEWTON):
        al, dl = a + lam, d + lam
        det = al * dl - b * c
        y1, y2 = b * b2 - dl * b1, c * b1 - al * b2
        t = np.sqrt(y1 * y1 + y2 * y2)
        m = mu * (free * det - h1 * y1 - h2 * y2)
        excess = t - m
        if abs(excess) <= SMALL * (t + abs(m)):
            inverse = 1.0 / det
            return True, m / mu * inverse, y1 * inverse, y2 * inverse, lam
        if excess > 0.0:
            low = lam
        else:
            high = lam
        z1, z2 = dl * y1 - b * y2, al * y2 - c * y1  # dx/dλ = -z/det²
        yz, hz = y1 * z1 + y2 * z2, mu * (h1 * z1 + h2 * z2)
        if m > 0.0:
            step = excess * t * t * m * det / (yz * m * m + hz * t * t * t)
            new = lam + step
            if new > low and step * step * (z1 * z1 + z2 * z2) <= LINEAR * det * det * t * t:
                x1, x2 = y1 * det - step * z1, y2 * det - step * z2
                inverse = 1.0 / (det * det)
                rn = free - (h1 * x1 + h2 * x2) * inverse
                m = mu * rn / np.sqrt(x1 * x1 + x2 * x2)
                return True, rn, m * x1, m * x2, new
        else:
            new = lam + excess * t * det / (yz + hz * t)
        if not (new > low and new < high):
            new = 0.5 * (low + high) if high < np.inf else 4.0 * lam + SMALL * (abs(a) + abs(d))
        if abs(new - lam) <= 1e-16 * lam:
            break
        lam = new
    # rounding leaves r_T off the cone by a little where t cancels; off by more there is no root in the bracket
    if not (abs(excess) <= 1e-6 * (t + abs(m)) and m > 0.0):
        return False, 0.0, 0.0, 0.0, 0.0
    inverse, m = 1.0 / det, m / t
    return True, m * t / mu * inverse, y1 * m * inverse, y2 * m * inverse, lam


@njit(fastmath=FAST, error_model="numpy")
def one_contact_2d(a, h, g, c, v0, v1, mu):
    """(found, r_N, r_T) for D = [[a, h], [g, c]]: separation, sticking, and sliding to either side."""
    if v0 >= 0.0:
        return True, 0.0, 0.0
    if mu == 0.0:
        return a > 0.0, -v0 / a, 0.0
    determinant = a * c - h * g
    if abs(determinant) > SMALL * (abs(a * c) + abs(h * g)):
        rn = (h * v1 - c * v0) / determinant
        rt = (g * v0 - a * v1) / determinant
        if rn >= 0.0 and abs(rt) <= mu * rn:
            return True, rn, rt
    elif a > 0.0 and abs(v1 - g * v0 / a) <= SMALL * (abs(v1) + abs(g * v0 / a)):
        return True, -v0 / a, 0.0
    opposed = a * v1 - g * v0  # b times W_NN: the side on which r_T opposes the free sliding
    first = -1.0 if opposed > 0.0 else 1.0
    if a > 0.0 and determinant >= 0.0 and a + first * mu * h > 0.0:
        rn = -v0 / (a + first * mu * h)
        return True, rn, first * mu * rn
    for side in (first, -first):
        normal = a + side * mu * h
        if normal > 0.0:
            rn = -v0 / normal
            if side * (v1 + (g + side * mu * c) * rn) <= 0.0:
                return True, rn, side * mu * rn
    return False, 0.0, 0.0


@njit(fastmath=FAST, error_model="numpy")
def velocity_3d(start, column, blocks, q, r, i):
    one, two = np.uint64(1), np.uint64(2)
    i3 = np.uint64(3) * np.uint64(i)
    u0, u1, u2 = row_product(start[i], start[i + 1], column, blocks, r)
    return q[i3] + u0, q[i3 + one] + u1, q[i3 + two] + u2


@njit(fastmath=FAST, error_model="numpy")
def velocity_2d(start, column, blocks, q, r, i):
    one, two = np.uint64(1), np.uint64(2)
    i2 = two * np.uint64(i)
    u0, u1 = q[i2], q[i2 + one]
    for k in range(start[i], start[i + 1]):
        j = two * np.uint64(column[k])
        p = np.uint64(4) * np.uint64(k)
        x0, x1 = r[j], r[j + one]
        u0 += blocks[p] * x0 + blocks[p + one] * x1
        u1 += blocks[p + two] * x0 + blocks[p + two + one] * x1
    return u0, u1


@njit(
    float64(START, COLUMN, DATA, DATA_2D, DATA, DATA, DATA, DATA, int64),
    cache=True,
    fastmath=FAST,
    error_model="numpy",
)
def judged(start, column, blocks, diagonal, q, mu, rho, r, dimension):
    """max(natural, energy, opening) of `cpbench.formulations.contact.contact_residuals`; NaN when anything is."""
    natural = energy = opening = 0.0
    rr = uu = qq = rr_e = uu_e = qq_e = 0.0
    for i in range(mu.size):
        if dimension == 3:
            u0, u1, u2 = velocity_3d(start, column, blocks, q, r, i)
            r0, r1, r2 = r[3 * i], r[3 * i + 1], r[3 * i + 2]
            q0, q1, q2 = q[3 * i], q[3 * i + 1], q[3 * i + 2]
            u0 += diagonal[i, 0] * r0 + diagonal[i, 1] * r1 + diagonal[i, 2] * r2
            u1 += diagonal[i, 3] * r0 + diagonal[i, 4] * r1 + diagonal[i, 5] * r2
            u2 += diagonal[i, 6] * r0 + diagonal[i, 7] * r1 + diagonal[i, 8] * r2
        else:
            u0, u1 = velocity_2d(start, column, blocks, q, r, i)
            u2 = r2 = q2 = 0.0
            r0, r1 = r[2 * i], r[2 * i + 1]
            q0, q1 = q[2 * i], q[2 * i + 1]
            u0 += diagonal[i, 0] * r0 + diagonal[i, 1] * r1
            u1 += diagonal[i, 2] * r0 + diagonal[i, 3] * r1
        p0, p1, p2 = natural_step(r0, r1, r2, u0, u1, u2, mu[i], 1.0)
        natural += (r0 - p0) ** 2 + (r1 - p1) ** 2 + (r2 - p2) ** 2
        p0, p1, p2 = natural_step(r0, r1, r2, u0, u1, u2, mu[i], rho[i])
        energy += ((r0 - p0) ** 2 + (r1 - p1) ** 2 + (r2 - p2) ** 2) / rho[i]
        if not u0 >= 0.0:  # else û is in K*
            p0, p1, p2 = natural_step(0.0, 0.0, 0.0, u0, u1, u2, mu[i], 1.0)
            opening += rho[i] * (p0 * p0 + p1 * p1 + p2 * p2)
        square = r0 * r0 + r1 * r1 + r2 * r2
        rr += square
        rr_e += square / rho[i]
        square = u0 * u0 + u1 * u1 + u2 * u2
        uu += square
        uu_e += square * rho[i]
        square = q0 * q0 + q1 * q1 + q2 * q2
        qq += square
        qq_e += square * rho[i]
    if qq > 0.0:
        natural /= max(qq, max(rr, uu))
        energy /= max(qq_e, max(rr_e, uu_e))
        opening /= qq_e
    worst = np.sqrt(natural) if not natural < energy else np.sqrt(energy)
    return worst if not worst < opening else opening


@njit(error_model="numpy")
def fetch_row(start, blocks, i):
    """Ask for the blocks of contact i."""
    number, last = np.uint64(9) * start[i], np.uint64(9) * start[i + 1]
    while number < last:
        fetch(blocks, number)
        number += np.uint64(LINE)


@njit(fastmath=FAST, error_model="numpy")
def sweep_3d(start, column, blocks, diagonal, local, q, mu, rho, r, lam, order, omega):
    """Σ‖change of r_c‖²/ρ_c of one sweep, in place on r; omega is not in it."""
    change = 0.0
    far = blocks.size > CACHED
    for place in range(order.size):
        i = order[place]
        if far and place + AHEAD < order.size:
            fetch_row(start, blocks, order[place + AHEAD])
        v0, v1, v2 = velocity_3d(start, column, blocks, q, r, i)
        found = False
        x0 = x1 = x2 = 0.0
        if local[i, PROJECT] == 0.0:
            found, x0, x1, x2, lam[i] = one_contact_3d(local, i, v0, v1, v2, mu[i], lam[i])
        old0, old1, old2 = r[3 * i], r[3 * i + 1], r[3 * i + 2]
        if not found:
            v0 += diagonal[i, 0] * old0 + diagonal[i, 1] * old1 + diagonal[i, 2] * old2
            v1 += diagonal[i, 3] * old0 + diagonal[i, 4] * old1 + diagonal[i, 5] * old2
            v2 += diagonal[i, 6] * old0 + diagonal[i, 7] * old1 + diagonal[i, 8] * old2
            x0, x1, x2 = natural_step(old0, old1, old2, v0, v1, v2, mu[i], rho[i])
        change += ((x0 - old0) ** 2 + (x1 - old1) ** 2 + (x2 - old2) ** 2) / rho[i]
        r[3 * i] = old0 + omega * (x0 - old0)
        r[3 * i + 1] = old1 + omega * (x1 - old1)
        r[3 * i + 2] = old2 + omega * (x2 - old2)
    return change


@njit(fastmath=FAST, error_model="numpy")
def sweep_2d(start, column, blocks, diagonal, q, mu, rho, r, order, omega):
    """As `sweep_3d`, 4 numbers a block; the local problem needs nothing but `diagonal`."""
    change = 0.0
    for place in range(order.size):
        i = order[place]
        v0, v1 = velocity_2d(start, column, blocks, q, r, i)
        a, h, g, c = diagonal[i, 0], diagonal[i, 1], diagonal[i, 2], diagonal[i, 3]
        found, x0, x1 = one_contact_2d(a, h, g, c, v0, v1, mu[i])
        old0, old1 = r[2 * i], r[2 * i + 1]
        if not found:
            u0 = v0 + a * old0 + h * old1
            u1 = v1 + g * old0 + c * old1
            x0, x1, _ = natural_step(old0, old1, 0.0, u0, u1, 0.0, mu[i], rho[i])
        change += ((x0 - old0) ** 2 + (x1 - old1) ** 2) / rho[i]
        r[2 * i] = old0 + omega * (x0 - old0)
        r[2 * i + 1] = old1 + omega * (x1 - old1)
    return change


@njit(error_model="numpy")
def shuffled(order, state):
    """Fisher–Yates in place, with the 64-bit linear congruential generator of Knuth (MMIX)."""
    x = np.uint64(state[RANDOM])
    for k in range(order.size - 1, 0, -1):
        x = x * np.uint64(6364136223846793005) + np.uint64(1442695040888963407)
        other = np.int64((x >> np.uint64(33)) % np.uint64(k + 1))
        order[k], order[other] = order[other], order[k]
    state[RANDOM] = np.int64(x)


@njit(error_model="numpy")
def due(state, until, change, tolerance, measured):
    """Whether the error is to be evaluated: it is time, or the change in this sweep says that it is small enough."""
    it = state[ITERATION]
    return it >= state[NEXT_CHECK] or it == until or measured[PACE] * change <= tolerance * tolerance


@njit(error_model="numpy")
def checked(state, error, change, tolerance, measured, r, best):
    """Keep the error, the best r, and set the next check: where the last two foretell the tolerance, a quarter ahead
    at most. Whether that was the end: CONVERGED, NOT_FINITE, else CONTINUE."""
    if error < measured[LEAST]:
        measured[LEAST] = error
        best[:] = r
    state[LOGGED] += 1
    if error <= tolerance:
        return CONVERGED
    if not np.isfinite(error):
        return NOT_FINITE
    it, last = state[ITERATION], measured[LAST_ERROR]
    step = max(it // 4, min(it, 4), 1)
    if error < last < np.inf and it > state[LAST_CHECK]:
        rate = np.log(error / last) / (it - state[LAST_CHECK])
        step = min(step, max(1.0, 0.9 * np.log(tolerance / error) / rate))
    state[LAST_CHECK] = it
    state[NEXT_CHECK] = it + int(step)
    measured[LAST_ERROR] = error
    # where a sweep changes nothing there is no pace, and nothing to be seen before it is time: 0·∞ and ∞ are not small
    measured[PACE] = error * error / change if change > 0.0 else np.inf
    return CONTINUE


_ARGUMENTS = (
    START,
    COLUMN,
    DATA,
    DATA_2D,
    DATA_2D,
    DATA,
    DATA,
    DATA,
    VECTOR,
    VECTOR,
    int64[::1],
    float64,
    boolean,
    float64,
    int64,
    int64[::1],
    VECTOR,
    int64[::1],
    VECTOR,
    VECTOR,
)


@njit(int64(*_ARGUMENTS), cache=True, fastmath=FAST, error_model="numpy")
def sweeps_3d(
    start,
    column,
    blocks,
    diagonal,
    local,
    q,
    mu,
    rho,
    r,
    lam,
    order,
    omega,
    shuffle,
    tolerance,
    until,
    state,
    measured,
    log_iteration,
    log_error,
    best,
):
    """Sweep, in place on r, until the judged error is at most `tolerance` or `until` sweeps are done.

    Parameters
    ----------
    start, column, blocks : block-CSR of W without its diagonal blocks, see `row_product`. diagonal : (nc, 9).
    local : (nc, 12), see the names of its columns. lam : (nc,) last λ. order : (nc,) contacts in sweep order.
    state : (5,), measured : (3,), see the names of their places. log_iteration, log_error : the errors that were
    evaluated; `state` tells how many. best : the r with the least of them.
    """
    while state[ITERATION] < until and state[LOGGED] < log_error.size:
        if shuffle:
            shuffled(order, state)
        change = sweep_3d(start, column, blocks, diagonal, local, q, mu, rho, r, lam, order, omega)
        state[ITERATION] += 1
        if due(state, until, change, tolerance, measured):
            error = judged(start, column, blocks, diagonal, q, mu, rho, r, 3)
            log_iteration[state[LOGGED]], log_error[state[LOGGED]] = state[ITERATION], error
            outcome = checked(state, error, change, tolerance, measured, r, best)
            if outcome != CONTINUE:
                return outcome
    return CONTINUE


@njit(int64(*_ARGUMENTS), cache=True, fastmath=FAST, error_model="numpy")
def sweeps_2d(
    start,
    column,
    blocks,
    diagonal,
    local,
    q,
    mu,
    rho,
    r,
    lam,
    order,
    omega,
    shuffle,
    tolerance,
    until,
    state,
    measured,
    log_iteration,
    log_error,
    best,
):
    """As `sweeps_3d`, 4 numbers a block."""
    while state[ITERATION] < until and state[LOGGED] < log_error.size:
        if shuffle:
            shuffled(order, state)
        change = sweep_2d(start, column, blocks, diagonal, q, mu, rho, r, order, omega)
        state[ITERATION] += 1
        if due(state, until, change, tolerance, measured):
            error = judged(start, column, blocks, diagonal, q, mu, rho, r, 2)
            log_iteration[state[LOGGED]], log_error[state[LOGGED]] = state[ITERATION], error
            outcome = checked(state, error, change, tolerance, measured, r, best)
            if outcome != CONTINUE:
                return outcome
    return CONTINUE


READY = True
