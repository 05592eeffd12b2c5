"""Mehrotra's predictor-corrector for min ½xᵀHx + gᵀx subject to lower ≤ (x, Gx) ≤ upper, data near size one.

s = (x, Gx). Every finite side of an s that is no equation has a slack t > 0 and a multiplier z > 0; y = z at lower less
z at upper. Unknowns may have two sides, rows have one, or are equations.
"""

import numpy as np

from cpbench.foundation.kernels import boolean, float64, helper, int64, kernel, void
from cpbench_solvers.kernels.qp_interior_step import (
    BAR,
    BEST,
    DAMPING,
    DELTA,
    FIXED,
    ITERATE,
    LEFT,
    SIZE,
    has_lower,
    has_upper,
    products,
    take_step,
)
from cpbench_solvers.kernels.qp_ldl import CSR, DATA, INT, OUT
from cpbench_solvers.kernels.qp_system import SYSTEM, add_transposed, factor_system, largest, solve_system, times
from cpbench_solvers.kernels.vectors import put

NEAR, LIMIT, BROKEN, STALLED, LARGE = 0, 1, 2, 3, 4
"""Why `advance` comes back: tᵀz is small enough for the error to be measured, iterations are done, the linear system
broke down, tᵀz does not fall, the iterate has grown to `bar`."""
DONE, SINCE = 0, 1
"""Places of `counts`: iterations done, when tᵀz was least."""
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
INSIDE = 0.1
"""Least slacks and multipliers at the start, data scaled to size one."""
GAIN, WINDOW = 0.99, 12
"""The relative tᵀz must fall below GAIN times its old value within a window of iterations, a stall else."""
BLOWN_UP = 1e12


@helper(void(CSR, CSR, DATA, DATA, DATA, float64, ITERATE, OUT))
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
            y[i] = left[i]  # the multiplier of a fixed unknown is whatever stationarity needs
            left[i] = 0.0
        else:
            left[i] -= y[i]
    sizes[SIZE] = max(scale, abs(quadratic), abs(linear))


@kernel(boolean(CSR, CSR, DATA, DATA, DATA, float64, SYSTEM, ITERATE, OUT))
def begin(H, G, g, lower, upper, scale, system, iterate, sizes):
    """Write the regularized least-squares point, its slacks and multipliers pushed inside; False where the system
    breaks down."""
    x, y, t, z, _, work = iterate
    n, N = x.size, y.size
    w, theta, a, b, v = work[:n], work[N : 2 * N - n], work[2 * N : 2 * N + n], work[3 * N : 4 * N - n], work[4 * N :]
    v = v[: N - n]
    for i in range(N):
        equal = lower[i] == upper[i]
        near = lower[i] if equal else min(max(0.0, lower[i]), upper[i])  # the point of the bounds that is next to 0
        if i < n:
            # unknowns without bounds are held by nothing but the objective
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
        if has_lower(lower[i], upper[i]):
            t[i], z[i] = s[i] - lower[i], y[i]
            short, wrong = max(short, -t[i]), max(wrong, -z[i])
        if has_upper(lower[i], upper[i]):
            t[N + i], z[N + i] = upper[i] - s[i], -y[i]
            short, wrong = max(short, -t[N + i]), max(wrong, -z[N + i])
    for i in range(N):
        for k in (i, N + i):
            has = has_lower(lower[i], upper[i]) if k == i else has_upper(lower[i], upper[i])
            # all by the same: near the boundary the first steps would be short
            t[k] = max(t[k], 0.0) + max(INSIDE, 0.5 * short) if has else 0.0
            z[k] = max(z[k], 0.0) + max(INSIDE, 0.5 * wrong) if has else 0.0
    _gather(H, G, g, lower, upper, scale, iterate, sizes)
    return bool(np.isfinite(largest(x)))


@kernel(
    int64(
        *(CSR, CSR, DATA, DATA, DATA, float64, SYSTEM, ITERATE),
        *(float64, float64, float64, INT, OUT, int64),
    )
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
            error = take_step(H, G, g, lower, upper, system, iterate, sizes[DELTA], share, enough * sizes[SIZE], sizes)
            if error < sizes[LEFT]:  # the step was taken
                break
            if error < least:
                least, best = error, sizes[DELTA]
            if sizes[DAMPING] == 0.0 and equations:
                # first remedy: dependent equations, where exact multipliers are not unique
                sizes[DAMPING], sizes[DELTA] = PROXIMAL, min(sizes[DELTA], FINE)
                least = np.inf
            elif sizes[DELTA] < COARSEST and (least == error or least == np.inf):
                sizes[DELTA] *= COARSER  # second: more regularization, as long as refinement then leaves less
            elif least < USEFUL:
                # third: take what there is, for the right side may be rounding
                sizes[DELTA], sizes[LEFT] = best, USEFUL
            else:
                return BROKEN
        counts[DONE] += 1
        _gather(H, G, g, lower, upper, scale, iterate, sizes)
        gap = products(t, z, lower, upper) / sizes[SIZE]
        if gap < GAIN * sizes[BEST]:
            sizes[BEST], counts[SINCE] = gap, counts[DONE]
        if not gap > near:  # also NaN: the caller measures and sees
            return NEAR
        if not gap < BLOWN_UP:
            return STALLED
        if counts[DONE] - counts[SINCE] > max(WINDOW, counts[DONE] // 2):  # long runs have the right to long pauses
            return STALLED
        if max(largest(x), largest(y)) > sizes[BAR]:  # perhaps along a ray that proves something
            return LARGE
