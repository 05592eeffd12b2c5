"""Gauss–Seidel sweeps over contacts with Anderson's acceleration.

A sweep is a map r ↦ g(r) whose fixed points are solutions; f = g − r. Every PERIOD-th iterate is
g − Σ γ_j Δg_j with the γ that make ‖f − Σ γ_j Δf_j‖ least over the last columns, in the norm Σ‖·‖²/ρ_c: where no
contact changes its state, the map is smooth, and this is GMRES preconditioned by the sweep. Where contacts do, a step
that lets ‖f‖ grow is not followed and its columns are forgotten. Answers are always g, so that they lie in the cones.
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
    tuple_of,
)
from cpbench_solvers.kernels.contact_error import judged, looked
from cpbench_solvers.kernels.gauss_seidel import sweep_2d, sweep_3d
from cpbench_solvers.kernels.sweep_progress import (
    CONTINUE,
    CONVERGED,
    FIRST,
    ITERATION,
    LAST_ERROR,
    LEAST,
    NEXT_CHECK,
    PACE,
    SEEN,
    checked,
    due,
)

COLUMNS, FOLLOWS, EXTRAPOLATED, REJECTED = range(6, 10)
"""Places in `state` behind those of the sweeps: columns ever made since the last were forgotten; 1 where g and f are
those of the iterate before; 1 where r was extrapolated; how many extrapolations were not followed."""
RESIDUAL = 3
"""Place in `measured` behind those of the sweeps: ‖f‖² of the iterate before."""
MEASURED, ANSWER = 11, 15
"""Where `measured` and the best answer begin in `work`, behind `state`."""
GOING = 2.0
"""The first number in `work` after the first call."""
PERIOD = 2
WORSE = 4.0
"""‖f‖² may grow by this in an extrapolation."""
DEPENDENT = 1e-4
"""A column is left out when this share of the square of its length, or less, is new to those that came after it."""
RARELY = 20
"""Iterations between two evaluations of the error, at most."""
MATRIX = float64[:, ::1]


@helper(fast=FAST)
def _dot(a, b):
    total = 0.0
    for k in range(a.size):
        total += a[k] * b[k]
    return total


@helper()
def _least_squares(gram, count, last, L, diagonal, gamma):
    """Turn ⟨Δf_j, f⟩ in `gamma` into γ of the columns `last`, `last` − 1, … (cyclic), by LDLᵀ of their Gram matrix."""
    size = gram.shape[0]
    for j in range(count):
        at = (last - j) % size
        pivot = gram[at, at]
        for k in range(j):
            pivot -= L[j, k] * L[j, k] * diagonal[k]
        new = pivot > DEPENDENT * gram[at, at]  # else γ would be rounding over rounding
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
            gamma[j] = 0.0  # a column that depends on newer ones adds nothing to them
    for j in range(count - 1, -1, -1):
        if diagonal[j] > 0.0:
            gamma[j] /= diagonal[j]
            for k in range(j + 1, count):
                gamma[j] -= L[k, j] * gamma[k]


@helper(fast=FAST)
def _follow(state, residual, before, memory, r, g, f, g_old, f_old, root, table):
    """Put the next iterate into r: what the sweep made of it, g, or an extrapolation. Then g and f are the old ones.

    before : ‖f‖² of the iterate before. table : Δg and Δf, their Gram matrix, and what its factors take.
    """
    n = r.size
    extrapolated = state[EXTRAPOLATED] == 1
    state[EXTRAPOLATED] = 0
    # a contact has changed its state: the columns belong to another smooth piece of the map
    if memory == 0 or (extrapolated and residual > WORSE * before):
        state[REJECTED] += extrapolated
        state[COLUMNS] = state[FOLLOWS] = 0
        for k in range(n):
            r[k] = g[k]
        return
    columns = table[: 2 * memory * n].reshape((2, memory, n))
    squares = table[2 * memory * n :][: 2 * memory * memory].reshape((2, memory, memory))
    pivots, gamma = table[2 * memory * (n + memory) :][:memory], table[2 * memory * (n + memory) + memory :]
    (moves, changes), (gram, L) = (columns[0], columns[1]), (squares[0], squares[1])
    for k in range(n):
        f[k] = (g[k] - r[k]) * root[k]  # ‖f‖² is Σ‖·‖²/ρ_c: an energy, whatever the units
    if state[FOLLOWS] == 1:  # after a rejection g_old belongs to an iterate that was not followed
        last = state[COLUMNS] % memory
        for k in range(n):
            moves[last, k] = g[k] - g_old[k]
            changes[last, k] = f[k] - f_old[k]
        state[COLUMNS] += 1
        for a in range(min(state[COLUMNS], memory)):
            # only the newest row and column: the others are as they were
            gram[a, last] = gram[last, a] = _dot(changes[a], changes[last])
    for k in range(n):
        r[k] = g_old[k] = g[k]  # without an extrapolation, the plain sweep
        f_old[k] = f[k]
    state[FOLLOWS] = 1
    count = min(state[COLUMNS], memory)
    if count > 0 and state[ITERATION] % PERIOD == 0:  # a plain sweep between two: it damps what extrapolation amplifies
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


@helper()
def _no_contact_closes(q, dimension):
    """Return whether the error of r = 0 is exactly 0: no free velocity closes a contact, so every û is in K*."""
    closing = False
    for k in range(0, q.size, dimension):
        closing = closing or q[k] < 0.0
    return not closing


def work_size(n, contacts, memory):
    """Return the numbers in `work` of `accelerated`."""
    return ANSWER + 7 * n + contacts + 2 * memory * (n + memory + 1)


@helper()
def iterate(work, n, contacts):
    """Return state, measured, best, r and λ in `work`, for the sweeps of `gauss_seidel` to go on from."""
    # one array for all, since numba looks at each argument of a call
    state, measured, best = work[1:MEASURED].view(np.int64), work[MEASURED:ANSWER], work[ANSWER:][:n]
    return state, measured, best, work[ANSWER + n :][:n], work[ANSWER + 7 * n :][:contacts]


@kernel(
    tuple_of(int64, int64, float64, int64)(
        *(START, COLUMN, DATA, DATA_2D, DATA_2D, DATA, DATA, DATA, int64[::1]),
        *(int64, int64, VECTOR, float64, int64, boolean),
    ),
    fast=FAST,
)
def accelerated(
    start, column, blocks, diagonal, local, q, mu, rho, order, memory, dimension, work, tolerance, until, watched
):
    """Sweep until the judged error of an answer is at most `tolerance` or `until` sweeps are done, from where it was.

    Parameters
    ----------
    As those of `gauss_seidel.sweeps_3d`, and: memory : columns; with 0 the sweeps are plain ones. work : all that is
    remembered; before the first call its first number is 0, or 1 where a start lies at ANSWER. watched : come back
    after every evaluation of the error.

    Returns
    -------
    outcome, sweeps done, error of the answer at ANSWER (∞ where there is none), contacts seen for errors.
    """
    n, contacts = q.size, mu.size
    state, measured, best, r, lam = iterate(work, n, contacts)
    g = work[ANSWER + 2 * n :][:n]
    f, g_old, f_old = work[ANSWER + 3 * n :][:n], work[ANSWER + 4 * n :][:n], work[ANSWER + 5 * n :][:n]
    root, table = work[ANSWER + 6 * n :][:n], work[ANSWER + 7 * n + contacts :]
    if work[0] != GOING:
        state[:] = 0
        state[NEXT_CHECK] = FIRST
        lam[:] = 0.0
        measured[PACE] = measured[RESIDUAL] = 0.0
        error = np.inf
        if work[0] == 0.0:
            best[:] = 0.0
            # exact 0, so that nothing is measured for problems without contact forces
            if _no_contact_closes(q, dimension):
                error = 0.0
        else:
            error = judged(start, column, blocks, diagonal, q, mu, rho, best, dimension)
            state[SEEN] += contacts
        work[0] = GOING
        measured[LAST_ERROR] = np.inf
        measured[LEAST] = error if error < np.inf else np.inf
        if error <= tolerance:
            return CONVERGED, 0, error, state[SEEN]
        for k in range(n):
            r[k] = best[k]
            # once: a root and a quotient for every number would be most of a sweep
            root[k] = 1.0 / np.sqrt(rho[k // dimension])
    while state[ITERATION] < until:
        for k in range(n):
            g[k] = r[k]
        if dimension == 3:
            # on g: r is needed for f = g − r
            residual = sweep_3d(start, column, blocks, diagonal, local, q, mu, rho, g, lam, order, 1.0)
        else:
            residual = sweep_2d(start, column, blocks, diagonal, q, mu, rho, g, order, 1.0)
        state[ITERATION] += 1
        evaluated, error = False, np.inf
        if due(state, until, residual, tolerance, measured):
            law = (start, column, blocks, diagonal, q, mu, rho, g, dimension)
            evaluated, error = looked(*law, state, until, residual, tolerance, measured)
        if evaluated:
            outcome = checked(state, error, residual, tolerance, measured, g, best)
            if outcome != CONTINUE:
                return outcome, state[ITERATION], measured[LEAST], state[SEEN]
            # accelerated errors do not fall at a steady rate: look often
            state[NEXT_CHECK] = min(state[NEXT_CHECK], state[ITERATION] + RARELY)
        # after the check, which wants g, a point of the cones
        _follow(state, residual, measured[RESIDUAL], memory, r, g, f, g_old, f_old, root, table)
        measured[RESIDUAL] = residual
        if evaluated and watched:
            break
    return CONTINUE, state[ITERATION], measured[LEAST], state[SEEN]
