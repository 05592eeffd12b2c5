"""One predictor and corrector step of Mehrotra's method (`qp_interior`), named as in Mehrotra (1992).

s = (x, Gx). Every finite side of an s that is no equation has a slack t > 0 and a multiplier z > 0. With the linear
system factored once, the predictor aims at tz = 0; it says how far tᵀz can fall, hence the centring σ, and the products
dt dz that the corrector takes off. Where that makes a short step, Gondzio's corrector (1996, Comput. Optim. Appl.
6:137) brings the products of a longer one nearer to the aim.

Reference in plain NumPy: `tests/solvers/references/interior_point_qp.py`.
"""

from typing import Any, NamedTuple

import numpy as np

from cpbench.foundation.kernels import DATA, boolean, float64, helper, tuple_of
from cpbench_solvers.kernels.qp_ldl import CSR, OUT
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
LONG, LONGER, FARTHER, NARROW, WIDE = 0.5, 1.5, 0.3, 0.1, 10.0
"""Up to a step of LONG a corrector looks at one of LONGER times it and FARTHER more, of which it brings the products
into [NARROW, WIDE] times the aim (Colombo and Gondzio 2008, Comput. Optim. Appl. 41:277)."""
GAINED = 0.1
"""Share of the difference of both steps that it must gain."""
ITERATE = tuple_of(OUT, OUT, OUT, OUT, OUT, OUT)
"""x (n,), y (n + r,), t and z of the lower and then of the upper sides, each (2, n + r), stationarity (n,), work of
21 (n + r)."""


@helper(boolean(float64, float64), inline=True)
def has_lower(low, high):
    """Return whether an s has a lower side."""
    return low > -np.inf and low < high


@helper(boolean(float64, float64), inline=True)
def has_upper(low, high):
    """Return whether an s has an upper side."""
    return high < np.inf and low < high


@helper(float64(OUT, OUT, DATA, DATA, float64))
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


@helper(float64(OUT, OUT, DATA, DATA))
def products(t, z, lower, upper):
    """Return tᵀz over all sides."""
    N, total = lower.size, 0.0
    for i in range(N):
        if has_lower(lower[i], upper[i]):
            total += t[i] * z[i]
        if has_upper(lower[i], upper[i]):
            total += t[N + i] * z[N + i]
    return total


@helper(float64(OUT, OUT, OUT, OUT, float64, DATA, DATA))
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
    e : (2 N,) what is added to the products tz that the step brings to the aim. change, kept : (7 N,) dx to dz, and
    such a step that may be better.
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
    e: Any
    change: Any
    kept: Any


@helper()
def _views(work, n, N):
    """Return the parts of a work of 21 N numbers."""
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
        work[12 * N : 14 * N],
        work[4 * N : 11 * N],
        work[14 * N :],
    )


@helper()
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


@helper()
def _right_side(t, z, left, lower, upper, aim, step):
    """Write (a, b) of tz + t dz + z dt + e = aim."""
    n, N, s, e = step.w.size, lower.size, step.s, step.e
    a, b, h, theta = step.a, step.b, step.h, step.theta
    for i in range(N):
        total = 0.0
        if has_lower(lower[i], upper[i]):
            c = t[i] * z[i] + e[i] - aim
            # dz eliminated: its equation, with dt from that of the slack
            total -= (c + z[i] * (s[i] - lower[i] - t[i])) / t[i]
        if has_upper(lower[i], upper[i]):
            k = N + i
            c = t[k] * z[k] + e[k] - aim
            total += (c + z[k] * (upper[i] - s[i] - t[k])) / t[k]
        h[i] = total
        equal = lower[i] == upper[i]
        if i < n:
            a[i] = 0.0 if equal else total - left[i]
        else:
            b[i - n] = lower[i] - s[i] if equal else theta[i - n] * total


@helper()
def _directions(G, t, z, lower, upper, aim, step):
    """Write ds, dt and dz that belong to dx and v.

    Of a row the larger of t and z comes from the other one: what is left of its equation would count z/t times.
    """
    n, N, s, dx, v = step.w.size, lower.size, step.s, step.dx, step.v
    ds, dt, dz, e = step.ds, step.dt, step.dz, step.e
    for i in range(n):
        if lower[i] == upper[i]:
            dx[i] = 0.0
    put(ds[:n], dx)
    times(G, dx, ds[n:])
    for i in range(N):
        if has_lower(lower[i], upper[i]):
            c = t[i] * z[i] + e[i] - aim
            dt[i] = ds[i] + s[i] - lower[i] - t[i]
            if i < n or t[i] > z[i]:
                dz[i] = -(c + z[i] * dt[i]) / t[i]
            else:
                dz[i] = -v[i - n]
                dt[i] = -(c + t[i] * dz[i]) / z[i]
        if has_upper(lower[i], upper[i]):
            k = N + i
            c = t[k] * z[k] + e[k] - aim
            dt[k] = -ds[i] + upper[i] - s[i] - t[k]
            if i < n or t[k] > z[k]:
                dz[k] = -(c + z[k] * dt[k]) / t[k]
            else:
                dz[k] = v[i - n]
                dt[k] = -(c + t[k] * dz[k]) / z[k]


@helper()
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


@helper()
def _predict(G, system, iterate, lower, upper, mu, count, step):
    """Return the aim σμ of the corrector; write as e the second order of the predictor, which aims at tz = 0."""
    t, z, left = iterate[2], iterate[3], iterate[4]
    N, dt, dz, e = lower.size, step.dt, step.dz, step.e
    # it only says how far to aim and what the products of its steps are, and is not refined
    _right_side(t, z, left, lower, upper, 0.0, step)
    apply(system, step.a, step.b, step.dx, step.v)
    _directions(G, t, z, lower, upper, 0.0, step)
    alpha = min(_reach(t, dt, lower, upper, 1.0), _reach(z, dz, lower, upper, 1.0))
    after = _products_after(t, z, dt, dz, alpha, lower, upper) / count
    for i in range(N):
        e[i] = dt[i] * dz[i] if has_lower(lower[i], upper[i]) else 0.0
        e[N + i] = dt[N + i] * dz[N + i] if has_upper(lower[i], upper[i]) else 0.0
    # Mehrotra's heuristic: the further the predictor gets, the less centring
    return min((after / mu) ** 3, 1.0) * mu if mu > 0.0 else 0.0


@helper()
def _correct(H, G, system, iterate, lower, upper, aim, share, most, step):
    """Write the step of tz + t dz + z dt + e = aim; return what the linear system leaves and how far it may go, 0 where
    that is no less than `most`."""
    t, z, left = iterate[2], iterate[3], iterate[4]
    _right_side(t, z, left, lower, upper, aim, step)
    error = solve_system(H, G, system, step.w, step.theta, step.a, step.b, step.dx, step.v)
    if not error < most:
        return error if np.isfinite(error) else np.inf, 0.0
    _directions(G, t, z, lower, upper, aim, step)
    reach = min(_reach(t, step.dt, lower, upper, np.inf), _reach(z, step.dz, lower, upper, np.inf))
    return error, min(1.0, share * reach)


@helper()
def _bring_nearer(t, z, lower, upper, aim, trial, step):
    """Take from e what products after the step `trial` are too small or too large by, the latter up to WIDE · aim."""
    N, dt, dz, e = lower.size, step.dt, step.dz, step.e
    for k in range(2 * N):
        i = k - N if k >= N else k
        if has_upper(lower[i], upper[i]) if k >= N else has_lower(lower[i], upper[i]):
            product = (t[k] + trial * dt[k]) * (z[k] + trial * dz[k])
            e[k] -= max(min(max(product, NARROW * aim), WIDE * aim) - product, -WIDE * aim)


@helper(float64(CSR, CSR, DATA, DATA, DATA, SYSTEM, ITERATE, float64, float64, float64, OUT))
def take_step(H, G, g, lower, upper, system, iterate, delta, share, enough, sizes):
    """Return the share that the linear system leaves, infinite where it breaks down; take one predictor and corrector
    step where that is less than `sizes[LEFT]`. enough : tᵀz that is small enough."""
    x, y, t, z, _, work = iterate
    n, N, most = x.size, y.size, sizes[LEFT]
    step = _views(work, n, N)
    put(step.s[:n], x)
    times(G, x, step.s[n:])
    count = _scale(t, z, lower, upper, sizes[DAMPING], step)
    if not (np.isfinite(largest(step.w)) and np.isfinite(largest(step.theta))):
        return np.inf
    if not factor_system(H, G, system, step.w, step.theta, delta):
        return np.inf
    step.e[:] = 0.0
    mu = products(t, z, lower, upper) / max(count, 1)
    aim = max(_predict(G, system, iterate, lower, upper, mu, count, step), enough / count) if count else 0.0
    error, alpha = _correct(H, G, system, iterate, lower, upper, aim, share, most, step)
    if count and error < most and alpha < SHORT:
        # what the predictor promised does not come: aim at the middle, without its second order
        aim = max(aim, 0.5 * mu)
        step.e[:] = 0.0
        error, alpha = _correct(H, G, system, iterate, lower, upper, aim, share, most, step)
    if not error < most:
        return error
    if count and alpha < LONG:
        trial = min(1.0, LONGER * alpha + FARTHER)
        put(step.kept, step.change)
        _bring_nearer(t, z, lower, upper, aim, trial, step)
        _, now = _correct(H, G, system, iterate, lower, upper, aim, share, most, step)
        if now >= alpha + GAINED * (trial - alpha):
            alpha = now
        else:
            put(step.change, step.kept)
    _move(x, y, t, z, lower, upper, alpha, step)
    return error
