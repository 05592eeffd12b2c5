"""Mehrotra's predictor-corrector for min ½xᵀHx + gᵀx subject to lower ≤ (x, Gx) ≤ upper, data near size one.

s = (x, Gx). Every finite side of an s that is no equation has a slack t > 0 and a multiplier z > 0; y = z at lower less
z at upper. Unknowns may have two sides, rows have one, or are equations.
"""

import numpy as np
from numba import njit, types

from cpbench_solvers.kernels.array_types import COMPILED
from cpbench_solvers.kernels.qp_ldl import CSR, DATA, INT, OUT
from cpbench_solvers.kernels.qp_system import (
    SYSTEM,
    add_transposed,
    apply,
    factor_system,
    largest,
    solve_system,
    times,
)
from cpbench_solvers.kernels.vectors import put

NEAR, LIMIT, BROKEN, STALLED, LARGE = 0, 1, 2, 3, 4
"""Why `advance` comes back: tᵀz is small enough for the error to be measured, iterations are done, the linear system
broke down, tᵀz does not fall, the iterate has grown to `bar`."""
DONE, SINCE = 0, 1
"""Places of `counts`: iterations done, when tᵀz was least."""
SIZE, BEST, BAR, DELTA, LEFT, DAMPING = 0, 1, 2, 3, 4, 5
"""Places of `sizes`: what tᵀz is compared with (the larger part of the objective), the least relative tᵀz, the size of
an iterate that may be on its way along a ray, the regularization, what a linear system may leave, the weight of
proximal steps of the multipliers of equations."""
FIXED = 1e12
"""What stands on the diagonal for an unknown whose bounds are equal."""
PROXIMAL, FINE = 1e-5, 1e-12
"""The weight of proximal steps of the multipliers of equations, data scaled to size one, from the first linear system
on of which a larger share than SOLVED is left: where equations depend on others, also on the unknowns away from their
bounds alone, exact steps take rounding for a reason to move multipliers, without end. The regularization is for the
unknowns only then, and is this at most: beside more of it the curvature of unknowns far from their bounds is lost."""
SOLVED, COARSER, COARSEST = 1e-3, 100.0, 1e-4
"""A linear system of which a larger share is left is factored again with so many times the regularization, up to a
largest one, as long as that leaves less."""
USEFUL = 1.0
"""Where that does not help, a step is one that leaves less than this share: its right-hand side may be rounding."""
SHORT = 0.1
"""A shorter step is tried again, more centrally."""
INSIDE = 0.1
"""Least slacks and multipliers at the start, data scaled to size one."""
GAIN, WINDOW = 0.99, 12
"""The relative tᵀz must fall below GAIN times its old value within a window of iterations, a stall else."""
BLOWN_UP = 1e12
ITERATE = types.Tuple((OUT, OUT, OUT, OUT, OUT, OUT))
"""x (n,), y (n + r,), t and z of the lower and then of the upper sides, each (2, n + r), stationarity (n,), work of
12 (n + r)."""


@njit(types.boolean(types.float64, types.float64), inline="always", **COMPILED)
def _lower(low, high):
    """Return whether an s has a lower side."""
    return low > -np.inf and low < high


@njit(types.boolean(types.float64, types.float64), inline="always", **COMPILED)
def _upper(low, high):
    """Return whether an s has an upper side."""
    return high < np.inf and low < high


@njit(types.void(CSR, CSR, DATA, DATA, DATA, types.float64, ITERATE, OUT), **COMPILED)
def _gather(H, G, g, lower, upper, scale, iterate, sizes):
    """Write y of the sides, of fixed unknowns by stationarity, what is left of stationarity, and the size of tᵀz."""
    x, y, _, z, left, work = iterate
    n, N = x.size, y.size
    Hx = work[:n]
    times(H, x, Hx)
    quadratic = linear = 0.0
    for i in range(N):
        if lower[i] < upper[i]:
            y[i] = (z[i] if lower[i] > -np.inf else 0.0) - (z[N + i] if upper[i] < np.inf else 0.0)
    for i in range(n):
        quadratic += x[i] * Hx[i]
        linear += x[i] * g[i]
        left[i] = Hx[i] + g[i]
    add_transposed(G, -1.0, y[n:], left)
    for i in range(n):
        if lower[i] == upper[i]:
            y[i] = left[i]
            left[i] = 0.0
        else:
            left[i] -= y[i]
    sizes[SIZE] = max(scale, abs(quadratic), abs(linear))


@njit(types.boolean(CSR, CSR, DATA, DATA, DATA, types.float64, SYSTEM, ITERATE, OUT), **COMPILED)
def begin(H, G, g, lower, upper, scale, system, iterate, sizes):
    """Write the regularized least-squares point, its slacks and multipliers pushed inside; False where the system
    breaks down."""
    x, y, t, z, _, work = iterate
    n, N = x.size, y.size
    w, theta, a, b, v = work[:n], work[N : 2 * N - n], work[2 * N : 2 * N + n], work[3 * N : 4 * N - n], work[4 * N :]
    v = v[: N - n]
    for i in range(N):
        equal = lower[i] == upper[i]
        near = lower[i] if equal else min(max(0.0, lower[i]), upper[i])
        if i < n:
            w[i] = FIXED if equal else (1.0 if lower[i] > -np.inf or upper[i] < np.inf else 0.0)
            a[i] = w[i] * near - g[i]
        else:
            theta[i - n] = 0.0 if equal else 1.0
            b[i - n] = near
    if not factor_system(H, G, system, w, theta, sizes[DELTA]):
        return False
    solve_system(H, G, system, w, theta, a, b, x, v)
    for i in range(n):
        y[i] = 0.0
        if lower[i] == upper[i]:
            x[i] = lower[i]
        elif w[i] > 0.0:  # stationary, as the rows are
            y[i] = min(max(0.0, lower[i]), upper[i]) - x[i]
    for i in range(N - n):
        y[n + i] = -v[i]
    s = work[5 * N : 6 * N]
    put(s[:n], x)
    times(G, x, s[n:])
    short = wrong = 0.0
    for i in range(N):
        if _lower(lower[i], upper[i]):
            t[i], z[i] = s[i] - lower[i], y[i]
            short, wrong = max(short, -t[i]), max(wrong, -z[i])
        if _upper(lower[i], upper[i]):
            t[N + i], z[N + i] = upper[i] - s[i], -y[i]
            short, wrong = max(short, -t[N + i]), max(wrong, -z[N + i])
    for i in range(N):
        for k in (i, N + i):
            has = _lower(lower[i], upper[i]) if k == i else _upper(lower[i], upper[i])
            t[k] = max(t[k], 0.0) + max(INSIDE, 0.5 * short) if has else 0.0
            z[k] = max(z[k], 0.0) + max(INSIDE, 0.5 * wrong) if has else 0.0
    _gather(H, G, g, lower, upper, scale, iterate, sizes)
    return bool(np.isfinite(largest(x)))


@njit(types.float64(OUT, OUT, DATA, DATA, types.float64), **COMPILED)
def _reach(value, change, lower, upper, most):
    """Return the largest step up to `most` that keeps value + step·change ≥ 0 at all sides."""
    N, fastest = lower.size, 0.0
    for i in range(N):
        if _lower(lower[i], upper[i]):
            fastest = max(fastest, -change[i] / value[i])
        if _upper(lower[i], upper[i]):
            fastest = max(fastest, -change[N + i] / value[N + i])
    return min(most, 1.0 / fastest) if fastest > 0.0 else most


@njit(types.float64(OUT, OUT, DATA, DATA), **COMPILED)
def _products(t, z, lower, upper):
    """Return tᵀz over all sides."""
    N, total = lower.size, 0.0
    for i in range(N):
        if _lower(lower[i], upper[i]):
            total += t[i] * z[i]
        if _upper(lower[i], upper[i]):
            total += t[N + i] * z[N + i]
    return total


@njit(
    types.float64(CSR, CSR, DATA, DATA, DATA, SYSTEM, ITERATE, types.float64, types.float64, types.float64, OUT),
    **COMPILED,
)
def _step(H, G, g, lower, upper, system, iterate, delta, share, enough, sizes):
    """Return the share that the linear system leaves, infinite where it breaks down; take one predictor and corrector
    step where that is less than `sizes[LEFT]`. enough : tᵀz that is small enough."""
    x, y, t, z, left, work = iterate
    n, N = x.size, y.size
    w, theta, a, b = work[:n], work[N : 2 * N - n], work[2 * N : 2 * N + n], work[3 * N : 4 * N - n]
    dx, v, s, ds = work[4 * N : 4 * N + n], work[4 * N + n : 5 * N], work[5 * N : 6 * N], work[6 * N : 7 * N]
    dt, dz = work[7 * N : 9 * N], work[9 * N : 11 * N]
    h = work[11 * N : 12 * N]
    put(s[:n], x)
    times(G, x, s[n:])
    count = 0
    for i in range(N):
        total = 0.0
        if _lower(lower[i], upper[i]):
            total += z[i] / t[i]
            count += 1
        if _upper(lower[i], upper[i]):
            total += z[N + i] / t[N + i]
            count += 1
        equal = lower[i] == upper[i]
        if i < n:
            w[i] = FIXED if equal else total
        else:
            theta[i - n] = sizes[DAMPING] if equal else 1.0 / total
    if not (np.isfinite(largest(w)) and np.isfinite(largest(theta))):
        return np.inf
    if not factor_system(H, G, system, w, theta, delta):
        return np.inf
    dt[:] = 0.0  # what an attempt before this one has left may be no number
    dz[:] = 0.0
    error = 0.0
    mu = _products(t, z, lower, upper) / max(count, 1)
    aim = second = alpha = 0.0
    for corrector in range(3 if count else 1):
        if corrector == 2:
            if alpha >= SHORT:
                break
            # what the predictor promised does not come: aim at the middle, without its second order
            aim, second = max(aim, 0.5 * mu), 0.0
        # solve for tz + t dz + z dt = tz - c
        for i in range(N):
            total = 0.0
            if _lower(lower[i], upper[i]):
                c = t[i] * z[i] + second * dt[i] * dz[i] - aim
                total -= (c + z[i] * (s[i] - lower[i] - t[i])) / t[i]
            if _upper(lower[i], upper[i]):
                k = N + i
                c = t[k] * z[k] + second * dt[k] * dz[k] - aim
                total += (c + z[k] * (upper[i] - s[i] - t[k])) / t[k]
            h[i] = total
            equal = lower[i] == upper[i]
            if i < n:
                a[i] = 0.0 if equal else total - left[i]
            else:
                b[i - n] = lower[i] - s[i] if equal else theta[i - n] * total
        if corrector or not count:
            error = solve_system(H, G, system, w, theta, a, b, dx, v)
            if not error < sizes[LEFT]:
                return error if np.isfinite(error) else np.inf
        else:  # the predictor only says how far to aim and what the products of its steps are: it is not refined
            apply(system, a, b, dx, v)
        for i in range(n):
            if lower[i] == upper[i]:
                dx[i] = 0.0
        put(ds[:n], dx)
        times(G, dx, ds[n:])
        # of a row the larger of t and z comes from the other one: what is left of its equation would count z/t times
        for i in range(N):
            if _lower(lower[i], upper[i]):
                c = t[i] * z[i] + second * dt[i] * dz[i] - aim
                dt[i] = ds[i] + s[i] - lower[i] - t[i]
                if i < n or t[i] > z[i]:
                    dz[i] = -(c + z[i] * dt[i]) / t[i]
                else:
                    dz[i] = -v[i - n]
                    dt[i] = -(c + t[i] * dz[i]) / z[i]
            if _upper(lower[i], upper[i]):
                k = N + i
                c = t[k] * z[k] + second * dt[k] * dz[k] - aim
                dt[k] = -ds[i] + upper[i] - s[i] - t[k]
                if i < n or t[k] > z[k]:
                    dz[k] = -(c + z[k] * dt[k]) / t[k]
                else:
                    dz[k] = v[i - n]
                    dt[k] = -(c + t[k] * dz[k]) / z[k]
        if count and not corrector:
            alpha = min(_reach(t, dt, lower, upper, 1.0), _reach(z, dz, lower, upper, 1.0))
            after = 0.0
            for i in range(N):
                if _lower(lower[i], upper[i]):
                    after += (t[i] + alpha * dt[i]) * (z[i] + alpha * dz[i])
                if _upper(lower[i], upper[i]):
                    after += (t[N + i] + alpha * dt[N + i]) * (z[N + i] + alpha * dz[N + i])
            sigma = min((after / count / mu) ** 3, 1.0) if mu > 0.0 else 0.0
            aim, second = max(sigma * mu, enough / count), 1.0
        else:
            reach = min(_reach(t, dt, lower, upper, np.inf), _reach(z, dz, lower, upper, np.inf))
            alpha = min(1.0, share * reach)
    for i in range(n):
        x[i] += alpha * dx[i]
    for i in range(N):
        if _lower(lower[i], upper[i]):
            t[i] += alpha * dt[i]
            z[i] += alpha * dz[i]
        if _upper(lower[i], upper[i]):
            t[N + i] += alpha * dt[N + i]
            z[N + i] += alpha * dz[N + i]
        if i >= n and lower[i] == upper[i]:
            y[i] -= alpha * v[i - n]
    return error


@njit(
    types.int64(
        *(CSR, CSR, DATA, DATA, DATA, types.float64, SYSTEM, ITERATE),
        *(types.float64, types.float64, types.float64, INT, OUT, types.int64),
    ),
    **COMPILED,
)
def advance(H, G, g, lower, upper, scale, system, iterate, share, near, enough, counts, sizes, until):
    """Make one step, and more until there is a reason to come back.

    Parameters
    ----------
    share : of the step to the boundary. near : of tᵀz, relative to its size. enough : tᵀz
        below which nothing is gained, relative as well. until : iterations.
    """
    x, y, t, z = iterate[:4]
    equations = False
    for i in range(x.size, y.size):
        equations = equations or lower[i] == upper[i]
    while True:
        if counts[DONE] >= until:
            return LIMIT
        least, best = np.inf, sizes[DELTA]
        while True:
            error = _step(H, G, g, lower, upper, system, iterate, sizes[DELTA], share, enough * sizes[SIZE], sizes)
            if error < sizes[LEFT]:
                break
            if error < least:
                least, best = error, sizes[DELTA]
            if sizes[DAMPING] == 0.0 and equations:
                sizes[DAMPING], sizes[DELTA] = PROXIMAL, min(sizes[DELTA], FINE)
                least = np.inf
            elif sizes[DELTA] < COARSEST and (least == error or least == np.inf):
                sizes[DELTA] *= COARSER
            elif least < USEFUL:
                sizes[DELTA], sizes[LEFT] = best, USEFUL
            else:
                return BROKEN
        counts[DONE] += 1
        _gather(H, G, g, lower, upper, scale, iterate, sizes)
        gap = _products(t, z, lower, upper) / sizes[SIZE]
        if gap < GAIN * sizes[BEST]:
            sizes[BEST], counts[SINCE] = gap, counts[DONE]
        if not gap > near:
            return NEAR
        if not gap < BLOWN_UP:
            return STALLED
        if counts[DONE] - counts[SINCE] > max(WINDOW, counts[DONE] // 2):
            return STALLED
        if max(largest(x), largest(y)) > sizes[BAR]:
            return LARGE


READY = True
