"""Gauss–Seidel sweeps over contacts with Anderson's acceleration.

A sweep is a map r ↦ g(r) whose fixed points are solutions; f = g − r. Every PERIOD-th iterate is
g − Σ γ_j Δg_j with the γ that make ‖f − Σ γ_j Δf_j‖ least over the last columns, in the norm Σ‖·‖²/ρ_c: where no
contact changes its state, the map is smooth, and this is GMRES preconditioned by the sweep. Where contacts do, a step
that lets ‖f‖ grow is not followed and its columns are forgotten. Answers are always g, so that they lie in the cones.
"""

import numpy as np
from numba import float64, int64, njit

from cpbench.solvers.kernels.gauss_seidel import (
    COLUMN,
    CONTINUE,
    CONVERGED,
    DATA,
    DATA_2D,
    FAST,
    ITERATION,
    LOGGED,
    NEXT_CHECK,
    NOT_FINITE,
    START,
    VECTOR,
    checked,
    due,
    judged,
    sweep_2d,
    sweep_3d,
)

COLUMNS, FOLLOWS, EXTRAPOLATED, REJECTED = 4, 5, 6, 7
"""Places in `state` behind those of the sweeps: columns ever made since the last were forgotten; 1 where g and f are
those of the iterate before; 1 where r was extrapolated; how many extrapolations were not followed."""
PACE, RESIDUAL = 0, 1
"""Places in `measured`: as `pace` of the sweeps; ‖f‖² of the iterate before."""
PERIOD = 2
WORSE = 4.0
"""‖f‖² may grow by this in an extrapolation."""
DEPENDENT = 1e-4
"""A column is left out when this share of the square of its length, or less, is new to those that came after it."""
RARELY = 20
"""Iterations between two evaluations of the error, at most."""
MATRIX = float64[:, ::1]


@njit(fastmath=FAST, error_model="numpy")
def _dot(a, b):
    total = 0.0
    for k in range(a.size):
        total += a[k] * b[k]
    return total


@njit(error_model="numpy")
def _least_squares(gram, count, last, L, diagonal, gamma):
    """γ of the columns `last`, `last` − 1, … (cyclic), by LDLᵀ of their Gram matrix; `gamma` comes with ⟨Δf_j, f⟩."""
    size = gram.shape[0]
    for j in range(count):
        at = (last - j) % size
        pivot = gram[at, at]
        for k in range(j):
            pivot -= L[j, k] * L[j, k] * diagonal[k]
        new = pivot > DEPENDENT * gram[at, at]
        diagonal[j] = pivot if new else 0.0
        for i in range(j + 1, count):
            entry = 0.0
            if new:
                entry = gram[(last - i) % size, at]
                for k in range(j):
                    entry -= L[i, k] * L[j, k] * diagonal[k]
                entry /= pivot
            L[i, j] = entry
    for j in range(count):
        for k in range(j):
            gamma[j] -= L[j, k] * gamma[k]
        if diagonal[j] == 0.0:
            gamma[j] = 0.0
    for j in range(count - 1, -1, -1):
        if diagonal[j] > 0.0:
            gamma[j] /= diagonal[j]
            for k in range(j + 1, count):
                gamma[j] -= L[k, j] * gamma[k]


@njit(
    int64(
        *(START, COLUMN, DATA, DATA_2D, DATA_2D, DATA, DATA, DATA),
        *(VECTOR, VECTOR, int64[::1]),
        *(MATRIX, MATRIX, MATRIX, int64, float64, int64, int64[::1], VECTOR, int64[::1], VECTOR, VECTOR, VECTOR),
    ),
    cache=True,
    fastmath=FAST,
    error_model="numpy",
)
def accelerated(
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
    work,
    moves,
    changes,
    dimension,
    tolerance,
    until,
    state,
    measured,
    log_iteration,
    log_error,
    least,
    best,
):
    """Sweep until the judged error of an answer is at most `tolerance` or `until` sweeps are done, from where it was.

    Parameters
    ----------
    As those of `sweeps_3d`, and: r : the next iterate, not an answer; `best` is one.
    work : (2, n) g and f of the iterate before. moves, changes : (m, n) the columns Δg and Δf;
    with m = 0 the sweeps are plain ones.
    """
    n, memory = r.size, moves.shape[0]
    g, f = np.empty(n), np.empty(n)
    gram, L = np.empty((memory, memory)), np.empty((memory, memory))
    pivots, gamma = np.empty(memory), np.empty(memory)
    for a in range(min(state[COLUMNS], memory)):
        for b in range(a + 1):
            gram[a, b] = gram[b, a] = _dot(changes[a], changes[b])
    root = 1.0 / np.sqrt(rho)
    while state[ITERATION] < until and state[LOGGED] < log_error.size:
        g[:] = r
        if dimension == 3:
            residual = sweep_3d(start, column, blocks, diagonal, local, q, mu, rho, g, lam, order, 1.0)
        else:
            residual = sweep_2d(start, column, blocks, diagonal, q, mu, rho, g, order, 1.0)
        state[ITERATION] += 1
        if due(state, until, residual, tolerance, measured):
            error = judged(start, column, blocks, diagonal, q, mu, rho, g, dimension)
            if not np.isfinite(error):
                return NOT_FINITE
            checked(state, error, residual, tolerance, measured, log_iteration, log_error, g, least, best)
            state[NEXT_CHECK] = min(state[NEXT_CHECK], state[ITERATION] + RARELY)
            if error <= tolerance:
                return CONVERGED
        if state[EXTRAPOLATED] == 1 and residual > WORSE * measured[RESIDUAL]:
            state[REJECTED] += 1
            state[COLUMNS] = state[FOLLOWS] = state[EXTRAPOLATED] = 0
            measured[RESIDUAL] = residual
            r[:] = g
            continue
        for k in range(n):
            f[k] = (g[k] - r[k]) * root[k // dimension]
        if state[FOLLOWS] == 1:
            last = state[COLUMNS] % memory
            for k in range(n):
                moves[last, k] = g[k] - work[0, k]
                changes[last, k] = f[k] - work[1, k]
            state[COLUMNS] += 1
            for a in range(min(state[COLUMNS], memory)):
                gram[a, last] = gram[last, a] = _dot(changes[a], changes[last])
        r[:] = g
        count = min(state[COLUMNS], memory)
        state[EXTRAPOLATED] = 0
        if count > 0 and state[ITERATION] % PERIOD == 0:
            last = (state[COLUMNS] - 1) % memory
            for j in range(count):
                gamma[j] = _dot(changes[(last - j) % memory], f)
            _least_squares(gram, count, last, L, pivots, gamma)
            for j in range(count):
                if gamma[j] != 0.0:
                    at = (last - j) % memory
                    for k in range(n):
                        r[k] -= gamma[j] * moves[at, k]
            state[EXTRAPOLATED] = 1
        work[0] = g
        work[1] = f
        state[FOLLOWS] = 1 if memory > 0 else 0
        measured[RESIDUAL] = residual
    return CONTINUE


READY = True
