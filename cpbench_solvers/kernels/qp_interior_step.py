"""One predictor and corrector step of Mehrotra's method (`qp_interior`), named as in Mehrotra (1992).

s = (x, Gx). Every finite side of an s that is no equation has a slack t > 0 and a multiplier z > 0. With the linear
system factored once, the predictor aims at tz = 0; it says how far tᵀz can fall, hence the centring σ, and the products
dt dz that the corrector takes off.

Reference in plain NumPy: `tests/solvers/references/interior_point_qp.py`.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit, types

from cpbench_solvers.kernels.array_types import COMPILED
from cpbench_solvers.kernels.qp_ldl import CSR, DATA, OUT
from cpbench_solvers.kernels.qp_system import SYSTEM, apply, factor_system, largest, solve_system, times
from cpbench_solvers.kernels.vectors import put

SIZE, BEST, BAR, DELTA, LEFT, DAMPING = 0, 1, 2, 3, 4, 5
"""Places of `sizes`: what tᵀz is compared with (the larger part of the objective), the least relative tᵀz, the size of
an iterate that may be on its way along a ray, the regularization, what a linear system may leave, the weight of
proximal steps of the multipliers of equations."""
FIXED = 1e12
"""What stands on the diagonal for an unknown whose bounds are equal."""
SHORT = 0.1
"""A shorter step is tried again, more centrally."""
ITERATE = types.Tuple((OUT, OUT, OUT, OUT, OUT, OUT))
"""x (n,), y (n + r,), t and z of the lower and then of the upper sides, each (2, n + r), stationarity (n,), work of
12 (n + r)."""


@njit(types.boolean(types.float64, types.float64), inline="always", **COMPILED)
def has_lower(low, high):
    """Return whether an s has a lower side."""
    return low > -np.inf and low < high


@njit(types.boolean(types.float64, types.float64), inline="always", **COMPILED)
def has_upper(low, high):
    """Return whether an s has an upper side."""
    return high < np.inf and low < high


@njit(types.float64(OUT, OUT, DATA, DATA, types.float64), **COMPILED)
def _reach(value, change, lower, upper, most):
    """Return the largest step up to `most` that keeps value + step·change ≥ 0 at all sides."""
    N, fastest = lower.size, 0.0
    for i in range(N):
        if has_lower(lower[i], upper[i]):
            # a maximum of quotients: one division for the step, none inside
            fastest = max(fastest, -change[i] / value[i])
        if has_upper(lower[i], upper[i]):
            fastest = max(fastest, -change[N + i] / value[N + i])
    return min(most, 1.0 / fastest) if fastest > 0.0 else most


@njit(types.float64(OUT, OUT, DATA, DATA), **COMPILED)
def products(t, z, lower, upper):
    """Return tᵀz over all sides."""
    N, total = lower.size, 0.0
    for i in range(N):
        if has_lower(lower[i], upper[i]):
            total += t[i] * z[i]
        if has_upper(lower[i], upper[i]):
            total += t[N + i] * z[N + i]
    return total


@njit(types.float64(OUT, OUT, OUT, OUT, types.float64, DATA, DATA), **COMPILED)
def _products_after(t, z, dt, dz, alpha, lower, upper):
    """Return (t + alpha dt)ᵀ(z + alpha dz) over all sides."""
    N, total = lower.size, 0.0
    for i in range(N):
        if has_lower(lower[i], upper[i]):
            total += (t[i] + alpha * dt[i]) * (z[i] + alpha * dz[i])
        if has_upper(lower[i], upper[i]):
            total += (t[N + i] + alpha * dt[N + i]) * (z[N + i] + alpha * dz[N + i])
    return total


class PathStep(NamedTuple):
    """A step and its linear system [H + diag w, Gᵀ; G, −diag theta](dx, −v) = (a, b), all of them views of the work.

    s : (N,) x and Gx. ds : (N,) their change. dt, dz : (2 N,) of slacks and multipliers. h : (N,) what sides give a.
    """

    w: Any
    theta: Any
    a: Any
    b: Any
    dx: Any
    v: Any
    s: Any
    ds: Any
    dt: Any
    dz: Any
    h: Any


STEP = types.NamedUniTuple(OUT, len(PathStep._fields), PathStep)


@njit(STEP(OUT, types.int64, types.int64), **COMPILED)
def _views(work, n, N):
    """Return the parts of a work of 12 N numbers."""
    return PathStep(
        work[:n],
        work[N : 2 * N - n],
        work[2 * N : 2 * N + n],
        work[3 * N : 4 * N - n],
        work[4 * N : 4 * N + n],
        work[4 * N + n : 5 * N],
        work[5 * N : 6 * N],
        work[6 * N : 7 * N],
        work[7 * N : 9 * N],
        work[9 * N : 11 * N],
        work[11 * N : 12 * N],
    )


@njit(types.int64(OUT, OUT, DATA, DATA, types.float64, STEP), **COMPILED)
def _scale(t, z, lower, upper, damping, step):
    """Write the weights w = z/t of the unknowns and theta = t/z of the rows; return the number of sides."""
    w, theta, n, N, count = step.w, step.theta, step.w.size, lower.size, 0
    for i in range(N):
        total = 0.0
        if has_lower(lower[i], upper[i]):
            total += z[i] / t[i]
            count += 1
        if has_upper(lower[i], upper[i]):
            total += z[N + i] / t[N + i]
            count += 1
        equal = lower[i] == upper[i]
        if i < n:
            w[i] = FIXED if equal else total  # so heavy that dx is 0 to rounding, in the same system
        else:
            # 0 for an exact equation: the system stays quasi-definite by δ
            theta[i - n] = damping if equal else 1.0 / total
    return count


@njit(types.void(OUT, OUT, OUT, DATA, DATA, types.float64, types.float64, STEP), **COMPILED)
def _right_side(t, z, left, lower, upper, aim, second, step):
    """Write (a, b) of t z + t dz + z dt + second dt dz = aim, with dt and dz of the step before in the last product."""
    n, N, s, dt, dz = step.w.size, lower.size, step.s, step.dt, step.dz
    a, b, h, theta = step.a, step.b, step.h, step.theta
    for i in range(N):
        total = 0.0
        if has_lower(lower[i], upper[i]):
            c = t[i] * z[i] + second * dt[i] * dz[i] - aim
            # dz eliminated: its equation, with dt from that of the slack
            total -= (c + z[i] * (s[i] - lower[i] - t[i])) / t[i]
        if has_upper(lower[i], upper[i]):
            k = N + i
            c = t[k] * z[k] + second * dt[k] * dz[k] - aim
            total += (c + z[k] * (upper[i] - s[i] - t[k])) / t[k]
        h[i] = total
        equal = lower[i] == upper[i]
        if i < n:
            a[i] = 0.0 if equal else total - left[i]
        else:
            b[i - n] = lower[i] - s[i] if equal else theta[i - n] * total


@njit(types.void(CSR, OUT, OUT, DATA, DATA, types.float64, types.float64, STEP), **COMPILED)
def _directions(G, t, z, lower, upper, aim, second, step):
    """Write ds, dt and dz that belong to dx and v.

    Of a row the larger of t and z comes from the other one: what is left of its equation would count z/t times.
    """
    n, N, s, dx, v = step.w.size, lower.size, step.s, step.dx, step.v
    ds, dt, dz = step.ds, step.dt, step.dz
    for i in range(n):
        if lower[i] == upper[i]:
            dx[i] = 0.0
    put(ds[:n], dx)
    times(G, dx, ds[n:])
    for i in range(N):
        if has_lower(lower[i], upper[i]):
            c = t[i] * z[i] + second * dt[i] * dz[i] - aim
            dt[i] = ds[i] + s[i] - lower[i] - t[i]
            if i < n or t[i] > z[i]:
                dz[i] = -(c + z[i] * dt[i]) / t[i]
            else:
                dz[i] = -v[i - n]
                dt[i] = -(c + t[i] * dz[i]) / z[i]
        if has_upper(lower[i], upper[i]):
            k = N + i
            c = t[k] * z[k] + second * dt[k] * dz[k] - aim
            dt[k] = -ds[i] + upper[i] - s[i] - t[k]
            if i < n or t[k] > z[k]:
                dz[k] = -(c + z[k] * dt[k]) / t[k]
            else:
                dz[k] = v[i - n]
                dt[k] = -(c + t[k] * dz[k]) / z[k]


@njit(types.void(OUT, OUT, OUT, OUT, DATA, DATA, types.float64, STEP), **COMPILED)
def _move(x, y, t, z, lower, upper, alpha, step):
    """Go the share `alpha` of the step; y of what is no equation follows from z."""
    n, N, dx, v, dt, dz = x.size, lower.size, step.dx, step.v, step.dt, step.dz
    for i in range(n):
        x[i] += alpha * dx[i]
    for i in range(N):
        if has_lower(lower[i], upper[i]):
            t[i] += alpha * dt[i]
            z[i] += alpha * dz[i]
        if has_upper(lower[i], upper[i]):
            t[N + i] += alpha * dt[N + i]
            z[N + i] += alpha * dz[N + i]
        if i >= n and lower[i] == upper[i]:
            y[i] -= alpha * v[i - n]


@njit(
    types.float64(CSR, CSR, DATA, DATA, DATA, SYSTEM, ITERATE, types.float64, types.float64, types.float64, OUT),
    **COMPILED,
)
def take_step(H, G, g, lower, upper, system, iterate, delta, share, enough, sizes):
    """Return the share that the linear system leaves, infinite where it breaks down; take one predictor and corrector
    step where that is less than `sizes[LEFT]`. enough : tᵀz that is small enough."""
    x, y, t, z, left, work = iterate
    n, N = x.size, y.size
    step = _views(work, n, N)
    put(step.s[:n], x)
    times(G, x, step.s[n:])
    count = _scale(t, z, lower, upper, sizes[DAMPING], step)
    if not (np.isfinite(largest(step.w)) and np.isfinite(largest(step.theta))):
        return np.inf
    if not factor_system(H, G, system, step.w, step.theta, delta):
        return np.inf
    step.dt[:] = 0.0  # what an attempt before this one has left may be no number
    step.dz[:] = 0.0
    error = 0.0
    mu = products(t, z, lower, upper) / max(count, 1)
    aim = second = alpha = 0.0
    if count:
        # predictor, at tz = 0: it only says how far to aim and what the products of its steps are, and is not refined
        _right_side(t, z, left, lower, upper, aim, second, step)
        apply(system, step.a, step.b, step.dx, step.v)
        _directions(G, t, z, lower, upper, aim, second, step)
        alpha = min(_reach(t, step.dt, lower, upper, 1.0), _reach(z, step.dz, lower, upper, 1.0))
        after = _products_after(t, z, step.dt, step.dz, alpha, lower, upper) / count
        # Mehrotra's heuristic: the further the predictor gets, the less centring
        sigma = min((after / mu) ** 3, 1.0) if mu > 0.0 else 0.0
        aim, second, alpha = max(sigma * mu, enough / count), 1.0, 0.0
    for _ in range(2 if count else 1):
        # corrector, at tz = aim less the products of the predictor
        _right_side(t, z, left, lower, upper, aim, second, step)
        error = solve_system(H, G, system, step.w, step.theta, step.a, step.b, step.dx, step.v)
        if not error < sizes[LEFT]:
            return error if np.isfinite(error) else np.inf
        _directions(G, t, z, lower, upper, aim, second, step)
        reach = min(_reach(t, step.dt, lower, upper, np.inf), _reach(z, step.dz, lower, upper, np.inf))
        alpha = min(1.0, share * reach)
        if alpha >= SHORT:
            break
        # what the predictor promised does not come: aim at the middle, without its second order
        aim, second = max(aim, 0.5 * mu), 0.0
    _move(x, y, t, z, lower, upper, alpha, step)
    return error
