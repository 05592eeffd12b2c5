"""Modified proportioning with reduced gradient projections: min ½xᵀAx + qᵀx over lower ≤ x ≤ upper, A symmetric.

The gradient g = Ax + q has two parts that must vanish: the free one φ, of unknowns between their bounds, and the
chopped one β, of those at a bound that g pushes inwards. A step is one of conjugate gradients on the face of x, an
expansion of the face when that would leave the bounds, or a release of unknowns along β when ‖β‖ outweighs φ.

A by rows: values[start[i]:start[i+1]] are in `column`; dense, n rows of n, where `start` is empty.
"""

import numpy as np

from cpbench.foundation.kernels import DATA, INDEX, VECTOR, boolean, float64, helper, int64, kernel, void
from cpbench_solvers.kernels.lcp_error import FAST

LIMIT, SETTLED, RAY, NOT_FINITE = 0, 1, 2, 3
"""Outcomes: as many iterations as asked; a projected gradient that is small enough; −p descends for ever; no number."""
CODES = 4
"""`run` returns iterations * CODES + outcome."""
FLAT = 1e-14
"""pᵀAp/(‖A‖ pᵀp) up to which p has no curvature."""
LENGTH, LARGEST, PRODUCTS, EXPANSIONS, RELEASES = 0, 1, 2, 3, 4
"""In `state`: the step of an expansion times ‖A‖, ‖A‖ from below, and counters."""
STATES = 5
POWERS = 6


@kernel(void(INDEX, INDEX, DATA, DATA, VECTOR, VECTOR), fast=FAST)
def multiply(start, column, values, x, out, state):
    """Set out = Ax; zeros of x cost nothing where A is dense."""
    n = x.size
    state[PRODUCTS] += 1
    if start.size == 0:  # dense, by columns: sparse directions cost only what they move
        out[:] = 0.0
        for j in range(n):
            factor = x[j]
            if factor != 0.0:  # row j is column j
                for i in range(n):
                    out[i] += values[j * n + i] * factor
        return
    for i in range(n):
        total = 0.0
        for e in range(start[i], start[i + 1]):
            total += values[e] * x[column[e]]
        out[i] = total


@kernel(void(INDEX, INDEX, DATA, VECTOR, VECTOR, VECTOR), fast=FAST)
def power(start, column, values, x, work, state):
    """Make a few steps of the power method from x, which is overwritten: state[LARGEST]."""
    for _ in range(POWERS):
        top = square = product = 0.0
        for i in range(x.size):
            top = max(top, abs(x[i]))
        if top == 0.0:
            return
        for i in range(x.size):
            x[i] /= top
            square += x[i] * x[i]
        multiply(start, column, values, x, work, state)
        for i in range(x.size):
            product += work[i] * work[i]
            x[i] = work[i]
        state[LARGEST] = max(state[LARGEST], np.sqrt(product / square))  # from below: any product says more about ‖A‖


@kernel(float64(float64, float64, float64, float64))
def free(x, g, low, high):
    """Return φ of one unknown."""
    return g if low < x < high else 0.0


@helper(float64(float64, float64, float64, float64))
def chopped(x, g, low, high):
    """Return β of one unknown; 0 where its bounds are the same."""
    if x <= low:  # at or, by rounding, beyond it
        return min(g, 0.0) if x < high else 0.0
    return max(g, 0.0) if x >= high else 0.0


@helper(float64(DATA, DATA, DATA, DATA))
def longest(x, p, lower, upper):
    """Return the largest t with x − tp within the bounds."""
    t = np.inf
    for i in range(x.size):
        if p[i] > 0.0:
            t = min(t, (x[i] - lower[i]) / p[i])
        elif p[i] < 0.0:
            t = min(t, (x[i] - upper[i]) / p[i])
    return max(t, 0.0)


@kernel(
    boolean(INDEX, INDEX, DATA, DATA, DATA, DATA, VECTOR, VECTOR, VECTOR, float64, float64[:, ::1], VECTOR), fast=FAST
)
def project(start, column, values, q, lower, upper, x, g, d, t, work, state):
    """Return x ← P(x − td) and g afresh; False, with x and g as they were, where the objective would rise."""
    old_x, old_g = work[1], work[2]
    before = after = size = 0.0
    for i in range(x.size):
        old_x[i], old_g[i] = x[i], g[i]
        before += x[i] * (g[i] + q[i])
        x[i] = min(max(x[i] - t * d[i], lower[i]), upper[i])
    multiply(start, column, values, x, g, state)
    for i in range(x.size):
        g[i] += q[i]
        term = x[i] * (g[i] + q[i])  # xᵀ(Ax + 2q) is twice the objective
        after += term
        size += abs(term)
    if after <= before + 1e-12 * size:  # equal to rounding is not a rise: near the solution everything is
        return True
    for i in range(x.size):
        x[i], g[i] = old_x[i], old_g[i]
    return False


@kernel(void(VECTOR, VECTOR, DATA, DATA, float64, DATA, DATA))
def advance(x, g, p, Ap, t, lower, upper):
    """Move by x −= tp, kept within the bounds, and g −= tAp."""
    for i in range(x.size):
        x[i] = min(max(x[i] - t * p[i], lower[i]), upper[i])  # rounding of a step to a bound ends on it
        g[i] -= t * Ap[i]


@kernel(
    int64(
        *(INDEX, INDEX, DATA, DATA, DATA, DATA, DATA, VECTOR, VECTOR, VECTOR, float64[:, ::1], VECTOR),
        *(float64, boolean, float64, int64),
    ),
    fast=FAST,
)
def run(start, column, values, q, lower, upper, weight, x, g, p, work, state, gamma, projected, threshold, most):
    """Make at most `most` steps, in place on x, g, p and `state`; returns steps * CODES + outcome.

    Parameters
    ----------
    weight : (n,), ‖weight (φ + β)‖ ≤ threshold ends it. g : Ax + q. p : the last direction, φ at the beginning.
    work : (3, n). gamma : Γ of the test for proportional iterates. projected : expand by projecting the whole step of
    conjugate gradients, as long as that descends, instead of one of fixed length.
    """
    n = x.size
    Ap = work[0]
    for done in range(most + 1):
        step = state[LENGTH] / state[LARGEST] if state[LARGEST] > 0.0 else 1.0
        reduced = released = residual = 0.0
        for i in range(n):
            phi, beta = free(x[i], g[i], lower[i], upper[i]), chopped(x[i], g[i], lower[i], upper[i])
            released += beta * beta
            if phi > 0.0:
                # the reduced free gradient: what a step of this length can use
                reduced += phi * min((x[i] - lower[i]) / step, phi)
            elif phi < 0.0:
                reduced += phi * max((x[i] - upper[i]) / step, phi)
            residual += (weight[i] * (phi + beta)) ** 2
        if not np.isfinite(residual):
            return done * CODES + NOT_FINITE
        if residual <= threshold * threshold:
            return done * CODES + SETTLED
        if done == most:
            break
        # not proportional: more is to be gained by leaving bounds than in this face
        release = released > gamma * gamma * reduced
        if release:
            for i in range(n):
                p[i] = chopped(x[i], g[i], lower[i], upper[i])
            state[RELEASES] += 1
        multiply(start, column, values, p, Ap, state)
        curvature = slope = square = 0.0
        for i in range(n):
            curvature += p[i] * Ap[i]
            slope += p[i] * g[i]
            square += p[i] * p[i]
        state[LARGEST] = max(state[LARGEST], curvature / square if square > 0.0 else 0.0)
        most_t = longest(x, p, lower, upper)
        t = slope / curvature if curvature > FLAT * state[LARGEST] * square else np.inf
        momentum = 0.0
        if slope <= 0.0:  # rounding has spoiled p
            t = 0.0
        elif min(t, most_t) == np.inf:
            return done * CODES + RAY
        elif release:
            advance(x, g, p, Ap, min(t, most_t), lower, upper)
        elif t <= most_t:
            advance(x, g, p, Ap, t, lower, upper)
            for i in range(n):
                momentum += free(x[i], g[i], lower[i], upper[i]) * Ap[i]
            momentum /= curvature
        else:
            state[EXPANSIONS] += 1
            whole = projected and t < np.inf
            if not (whole and project(start, column, values, q, lower, upper, x, g, p, t, work, state)):
                # the part of the step that is feasible; the new face starts afresh
                advance(x, g, p, Ap, most_t, lower, upper)
                for i in range(n):
                    p[i] = free(x[i], g[i], lower[i], upper[i])
                if not project(start, column, values, q, lower, upper, x, g, p, step, work, state):
                    state[LENGTH] *= 0.5  # ‖A‖ was known from below only: the step was too long
        for i in range(n):
            inside = lower[i] < x[i] < upper[i]
            p[i] = g[i] - momentum * p[i] if inside else 0.0  # conjugate within the face only
    return most * CODES + LIMIT
