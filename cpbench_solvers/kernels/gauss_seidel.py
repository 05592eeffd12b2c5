"""Nonsmooth Gauss–Seidel sweeps over contacts, with the one-contact problem solved exactly, in 2D and 3D.

Reference in plain NumPy: `tests/solvers/references/nsgs.py`.
"""

import numpy as np

from cpbench.foundation.kernels import (
    COLUMN,
    DATA,
    DATA_2D,
    FAST,
    START,
    VECTOR,
    boolean,
    float64,
    helper,
    int64,
    kernel,
)
from cpbench_solvers.kernels.block_row import fetch
from cpbench_solvers.kernels.contact_error import looked, velocity_2d, velocity_3d
from cpbench_solvers.kernels.one_contact import PROJECT, natural_step, one_contact_2d, one_contact_3d
from cpbench_solvers.kernels.sweep_progress import CONTINUE, ITERATION, LOGGED, checked, due, shuffled

CACHED, AHEAD, LINE = 1 << 20, 20, 8
"""Of more numbers than a near cache holds, the blocks of the contact that is AHEAD places on are asked for, a LINE of
eight numbers at a time: the solution of one contact waits for nothing then, and memory does not wait for it."""


@helper()
def fetch_row(start, blocks, i):
    """Ask for the blocks of contact i."""
    number, last = np.uint64(9) * start[i], np.uint64(9) * start[i + 1]
    while number < last:
        fetch(blocks, number)
        number += np.uint64(LINE)


@helper(fast=FAST)
def sweep_3d(start, column, blocks, diagonal, local, q, mu, rho, r, lam, order, omega):
    """Return Σ‖change of r_c‖²/ρ_c of one sweep, in place on r; omega is not in it."""
    change = 0.0
    far = blocks.size > CACHED
    for place in range(order.size):
        i = order[place]
        if far and place + AHEAD < order.size:
            fetch_row(start, blocks, order[place + AHEAD])
        v0, v1, v2 = velocity_3d(start, column, blocks, q, r, i)  # of all others, as they are now: Gauss–Seidel
        found = False
        x0 = x1 = x2 = 0.0
        if local[i, PROJECT] == 0.0:
            found, x0, x1, x2, lam[i] = one_contact_3d(local, i, v0, v1, v2, mu[i], lam[i])
        old0, old1, old2 = r[3 * i], r[3 * i + 1], r[3 * i + 2]
        if not found:
            # the natural map is taken at the old reaction: u = Wr + q
            v0 += diagonal[i, 0] * old0 + diagonal[i, 1] * old1 + diagonal[i, 2] * old2
            v1 += diagonal[i, 3] * old0 + diagonal[i, 4] * old1 + diagonal[i, 5] * old2
            v2 += diagonal[i, 6] * old0 + diagonal[i, 7] * old1 + diagonal[i, 8] * old2
            x0, x1, x2 = natural_step(old0, old1, old2, v0, v1, v2, mu[i], rho[i])
        # in the norm of ρ: that of an energy, whatever the units
        change += ((x0 - old0) ** 2 + (x1 - old1) ** 2 + (x2 - old2) ** 2) / rho[i]
        r[3 * i] = old0 + omega * (x0 - old0)
        r[3 * i + 1] = old1 + omega * (x1 - old1)
        r[3 * i + 2] = old2 + omega * (x2 - old2)
    return change


@helper(fast=FAST)
def sweep_2d(start, column, blocks, diagonal, q, mu, rho, r, order, omega):
    """Sweep as `sweep_3d` does, 4 numbers a block; the local problem needs nothing but `diagonal`."""
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


_ARGUMENTS = (
    *(START, COLUMN, DATA, DATA_2D, DATA_2D, DATA, DATA, DATA, VECTOR, VECTOR, int64[::1]),
    *(float64, boolean, float64, int64, int64[::1], VECTOR, int64[::1], VECTOR, VECTOR),
)


@kernel(int64(*_ARGUMENTS), fast=FAST)
def sweeps_3d(
    start, column, blocks, diagonal, local, q, mu, rho, r, lam, order, omega, shuffle,
    tolerance, until, state, measured, log_iteration, log_error, best,
):  # fmt: skip
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
        known, error = False, np.inf
        if due(state, until, change, tolerance, measured):
            law = (start, column, blocks, diagonal, q, mu, rho, r, 3)
            known, error = looked(*law, state, until, change, tolerance, measured)
        if known:
            log_iteration[state[LOGGED]], log_error[state[LOGGED]] = state[ITERATION], error
            outcome = checked(state, error, change, tolerance, measured, r, best)
            if outcome != CONTINUE:
                return outcome
    return CONTINUE


# not one kernel for both: sums are made in any order, and the compiler chooses others where it has a branch


@kernel(int64(*_ARGUMENTS), fast=FAST)
def sweeps_2d(
    start, column, blocks, diagonal, local, q, mu, rho, r, lam, order, omega, shuffle,
    tolerance, until, state, measured, log_iteration, log_error, best,
):  # fmt: skip
    """Sweep as `sweeps_3d` does, 4 numbers a block."""
    while state[ITERATION] < until and state[LOGGED] < log_error.size:
        if shuffle:
            shuffled(order, state)
        change = sweep_2d(start, column, blocks, diagonal, q, mu, rho, r, order, omega)
        state[ITERATION] += 1
        known, error = False, np.inf
        if due(state, until, change, tolerance, measured):
            law = (start, column, blocks, diagonal, q, mu, rho, r, 2)
            known, error = looked(*law, state, until, change, tolerance, measured)
        if known:
            log_iteration[state[LOGGED]], log_error[state[LOGGED]] = state[ITERATION], error
            outcome = checked(state, error, change, tolerance, measured, r, best)
            if outcome != CONTINUE:
                return outcome
    return CONTINUE
