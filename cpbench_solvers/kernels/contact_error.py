"""The judged error of reactions, and when sweeps look at it.

An evaluation costs as much as a sweep. So it is made in full at a few sweeps only; at others, where the last change
says that the error may be small enough, the sum over the contacts is given up as soon as it is too large for that.
"""

import numpy as np

from cpbench.foundation.kernels import COLUMN, DATA, DATA_2D, FAST, START, float64, helper, int64, kernel
from cpbench_solvers.kernels.block_row import row_product
from cpbench_solvers.kernels.one_contact import natural_step
from cpbench_solvers.kernels.sweep_progress import ITERATION, NEXT_CHECK, PACE, SEEN

QUARTER = 0.25
"""Of the contacts: the sum that was given up later than this foretells how long there is nothing to be seen."""


@helper(fast=FAST)
def velocity_3d(start, column, blocks, q, r, i):
    one, two = np.uint64(1), np.uint64(2)
    i3 = np.uint64(3) * np.uint64(i)
    # in vector lanes: most of the time of a sweep is here
    u0, u1, u2 = row_product(start[i], start[i + 1], column, blocks, r)
    return q[i3] + u0, q[i3 + one] + u1, q[i3 + two] + u2


@helper(fast=FAST)
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


@helper(fast=FAST)
def _error(start, column, blocks, diagonal, q, mu, rho, r, dimension, natural_most, energy_most):
    """Return (max(natural, energy, opening) of `cpbench.formulations.contact.contact_residuals`, contacts seen); NaN
    when anything is. Fewer than all contacts are seen where a sum of squares exceeds what it is given at most."""
    natural = energy = opening = 0.0
    rr = uu = qq = rr_e = uu_e = qq_e = 0.0
    for i in range(mu.size):
        if dimension == 3:
            u0, u1, u2 = velocity_3d(start, column, blocks, q, r, i)
            r0, r1, r2 = r[3 * i], r[3 * i + 1], r[3 * i + 2]
            q0, q1, q2 = q[3 * i], q[3 * i + 1], q[3 * i + 2]
            u0 += diagonal[i, 0] * r0 + diagonal[i, 1] * r1 + diagonal[i, 2] * r2  # the block itself is stored apart
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
        if natural > natural_most or energy > energy_most:  # sums of squares only grow: the error is too large already
            return np.inf, i
        # else û is in K*
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
    return (worst if not worst < opening else opening), mu.size


@kernel(float64(START, COLUMN, DATA, DATA_2D, DATA, DATA, DATA, DATA, int64), fast=FAST)
def judged(start, column, blocks, diagonal, q, mu, rho, r, dimension):
    """Return the error of `contact_residuals`."""
    return _error(start, column, blocks, diagonal, q, mu, rho, r, dimension, np.inf, np.inf)[0]


@helper(fast=FAST)
def _lengths(q, rho, r, dimension):
    """Return max(‖q‖², ‖r‖²), and the same by energy: what the sums are divided by where velocities are not larger."""
    rr = qq = rr_e = qq_e = 0.0
    for i in range(rho.size):
        own_q = own_r = 0.0
        for k in range(dimension * i, dimension * (i + 1)):
            own_q += q[k] * q[k]
            own_r += r[k] * r[k]
        qq += own_q
        rr += own_r
        qq_e += own_q * rho[i]
        rr_e += own_r / rho[i]
    return max(qq, rr), max(qq_e, rr_e)


@helper()
def looked(
    start, column, blocks, diagonal, q, mu, rho, r, dimension, state, until, change, tolerance, measured
):  # fmt: skip
    """Return (whether the error of r is known, the error): where it is time or small. change : of the last sweep."""
    it, square = state[ITERATION], tolerance * tolerance
    natural_most = energy_most = np.inf
    if it < state[NEXT_CHECK] and it != until:
        natural_most, energy_most = _lengths(q, rho, r, dimension)
        # velocities can only make the scale larger, hence the error smaller
        natural_most, energy_most = square * natural_most, square * energy_most
    error, seen = _error(start, column, blocks, diagonal, q, mu, rho, r, dimension, natural_most, energy_most)
    state[SEEN] += seen
    if seen == mu.size:
        return True, error
    if seen >= QUARTER * mu.size:
        # as if the rest of the contacts were as wrong as those seen
        measured[PACE] = square * mu.size / (seen * change)
    return False, np.inf
