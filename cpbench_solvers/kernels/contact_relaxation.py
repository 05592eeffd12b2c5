"""Relaxations of frictional contact in space and in the plane: Jacobi or Gauss–Seidel, any order, any local solver.

`gauss_seidel` has the fast sweeps with the exact local solver; here every sweep may be another one.
"""

import numpy as np
from numba import boolean, float64, int64, njit

from cpbench_solvers.kernels.array_types import COLUMN, DATA, DATA_2D, KEPT, START, VECTOR
from cpbench_solvers.kernels.contact_error import looked, velocity_2d, velocity_3d
from cpbench_solvers.kernels.contact_local import enumerate_modes, newton, project, project_often
from cpbench_solvers.kernels.one_contact import PROJECT, one_contact_2d, one_contact_3d
from cpbench_solvers.kernels.sweep_progress import CONTINUE, ITERATION, LEAST, LOGGED, checked, due, shuffled
from cpbench_solvers.kernels.vectors import put

EXACT, NEWTON, PROJECTION, PROJECTIONS, QUARTIC = range(5)
GROWN, IDLE = 4.0, 4
"""Times the least error, and measurements without a lesser one: what the simultaneous relaxation goes back from, with
half of its omega. The cones keep the iterates bounded, so that they may swing for ever."""


@njit(error_model="numpy")
def _block(diagonal, i, dimension, D):
    """Write D of contact i, with a second tangent that is apart from the rest in the plane."""
    if dimension == 3:
        for a in range(3):
            for b in range(3):
                D[a, b] = diagonal[i, 3 * a + b]
    else:
        D[:] = 0.0
        D[0, 0], D[0, 1], D[1, 0], D[1, 1] = diagonal[i, 0], diagonal[i, 1], diagonal[i, 2], diagonal[i, 3]
        D[2, 2] = D[1, 1]  # regular where the plane is: its second tangent then solves to 0


@njit(error_model="numpy")
def _held(omega, error, measured, r, best):
    """Return the error from which a simultaneous relaxation goes on: where it swings, from the best r, half as far."""
    omega[1] = 0.0 if error < measured[LEAST] else omega[1] + 1.0
    if omega[1] >= IDLE or not error <= GROWN * measured[LEAST]:
        put(r, best)
        omega[0] *= 0.5
        omega[1] = 0.0
        error = measured[LEAST]
    return error


@njit(
    int64(
        *(START, COLUMN, DATA, DATA_2D, DATA_2D, DATA, DATA, DATA, VECTOR, VECTOR, VECTOR, int64[::1], VECTOR),
        *(int64, boolean, boolean, boolean, int64, float64, int64, int64[::1], VECTOR, int64[::1], VECTOR, VECTOR),
    ),
    **KEPT,
)
def relax(
    start, column, blocks, diagonal, local, q, mu, rho, r, lam, step, order, omega, method, simultaneous, shuffle,
    symmetric, dimension, tolerance, until, state, measured, log_iteration, log_error, best,
):  # fmt: skip
    """Sweep as `gauss_seidel` does.

    Parameters
    ----------
    step : (nc,) ρ of each contact's projections. omega : (2,), and measurements without gain. method : the local
    solver. simultaneous : Jacobi. symmetric : every other sweep goes backwards.

    With projections ω multiplies ρ, so that r stays in its cone; elsewhere it multiplies the change of r.
    """
    old = r.copy()
    D, A, B, J = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3))
    w, x, room = np.zeros(3), np.zeros(3), np.zeros((5, 5))
    roots, split = np.zeros(4), np.zeros(6)
    d = dimension
    while state[ITERATION] < until and state[LOGGED] < log_error.size:
        if shuffle:
            shuffled(order, state)
        backwards = symmetric and state[ITERATION] % 2 == 1
        if simultaneous:
            put(old, r)
        change = 0.0
        for place in range(order.size):
            i = order[order.size - 1 - place] if backwards else order[place]
            others = old if simultaneous else r
            if d == 3:
                w[0], w[1], w[2] = velocity_3d(start, column, blocks, q, others, i)
            else:
                w[0], w[1] = velocity_2d(start, column, blocks, q, others, i)
            for k in range(d):
                x[k] = r[d * i + k]
            found = True
            share = omega[0]
            if method == EXACT:
                found = False
                if d == 2:
                    found, y0, y1 = one_contact_2d(
                        diagonal[i, 0], diagonal[i, 1], diagonal[i, 2], diagonal[i, 3], w[0], w[1], mu[i]
                    )
                    y2 = 0.0
                elif local[i, PROJECT] == 0.0:
                    found, y0, y1, y2, lam[i] = one_contact_3d(local, i, w[0], w[1], w[2], mu[i], lam[i])
                if found:
                    x[0], x[1], x[2] = y0, y1, y2
            else:
                _block(diagonal, i, d, D)
                if method == NEWTON:
                    found = newton(D, w, mu[i], rho[i], x, room, A, B, J)
                elif method == PROJECTION:
                    project(D, w, mu[i], share * step[i], x, room[0])
                    share = 1.0  # ω was in ρ: a share of the change would leave the cone
                elif method == PROJECTIONS:
                    step[i] = project_often(D, w, mu[i], step[i], x, room)
                else:
                    found = enumerate_modes(D, w, mu[i], x, room, roots, split)
            if not found:
                # from the old reaction: a local solver that fails may have left anything in x
                _block(diagonal, i, d, D)
                for k in range(d):
                    x[k] = r[d * i + k]
                project(D, w, mu[i], rho[i], x, room[0])
            for k in range(d):
                gap = x[k] - r[d * i + k]
                change += gap * gap / rho[i]
                r[d * i + k] += share * gap
        state[ITERATION] += 1
        known, error = False, np.inf
        if due(state, until, change, tolerance, measured):
            law = (start, column, blocks, diagonal, q, mu, rho, r, d)
            known, error = looked(*law, state, until, change, tolerance, measured)
        if known:
            if simultaneous:
                error = _held(omega, error, measured, r, best)
            log_iteration[state[LOGGED]], log_error[state[LOGGED]] = state[ITERATION], error
            outcome = checked(state, error, change, tolerance, measured, r, best)
            if outcome != CONTINUE:
                return outcome
    return CONTINUE
