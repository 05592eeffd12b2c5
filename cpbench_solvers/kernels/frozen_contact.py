"""Convex contact problems with something held fixed: accelerated projected gradients and projected Gauss–Seidel.

min ½xᵀWx + pᵀx over a product of sets, one for each contact: the friction cone (De Saxcé's term is in p) or the
cylinder ℝ₊ × disk (a friction threshold is given).
W is block-CSR with its diagonal blocks, rows of a block one after the other; d = 2 or 3 numbers a contact.
"""

import numpy as np

from cpbench.foundation.kernels import DATA, FAST, INDEX, VECTOR, float64, helper, int64, kernel, void
from cpbench_solvers.kernels.one_contact import projected

CONE, CYLINDER = 0, 1
"""Sets: ‖x_T‖ ≤ μ x_N; x_N ≥ 0 and ‖x_T‖ ≤ radius."""
THETA, STEP = 0, 1
"""Places in `state`."""
GROW, HALVINGS, LONGEST = 1.05, 60, 100.0
"""Of the step length, which grows in the null space of W up to LONGEST, where W has diagonal 1."""
LOCAL, LOCAL_GAIN = 20, 1e-2
"""Projected gradient steps on one contact in a sweep, at most, and the share of the first change that ends them."""


@helper(fast=FAST)
def project(kind, y0, y1, y2, mu, radius):
    """Return the nearest point of the set to y."""
    if kind == CONE:
        return projected(y0, y1, y2, mu)
    square = y1 * y1 + y2 * y2
    normal = max(y0, 0.0)
    if square <= radius * radius:
        return normal, y1, y2
    factor = radius / np.sqrt(square)
    return normal, factor * y1, factor * y2


@kernel(void(INDEX, INDEX, DATA, int64, VECTOR, VECTOR), fast=FAST)
def product(start, column, blocks, d, x, out):
    """Set out = Wx."""
    for i in range(start.size - 1):
        if d == 3:
            u0 = u1 = u2 = 0.0
            for k in range(start[i], start[i + 1]):
                j, p = 3 * column[k], 9 * k
                x0, x1, x2 = x[j], x[j + 1], x[j + 2]
                u0 += blocks[p] * x0 + blocks[p + 1] * x1 + blocks[p + 2] * x2
                u1 += blocks[p + 3] * x0 + blocks[p + 4] * x1 + blocks[p + 5] * x2
                u2 += blocks[p + 6] * x0 + blocks[p + 7] * x1 + blocks[p + 8] * x2
            out[3 * i], out[3 * i + 1], out[3 * i + 2] = u0, u1, u2
        else:
            u0 = u1 = 0.0
            for k in range(start[i], start[i + 1]):
                j, p = 2 * column[k], 4 * k
                u0 += blocks[p] * x[j] + blocks[p + 1] * x[j + 1]
                u1 += blocks[p + 2] * x[j] + blocks[p + 3] * x[j + 1]
            out[2 * i], out[2 * i + 1] = u0, u1


@helper(fast=FAST)
def projected_step(kind, z, step, gradient, mu, radius, d, x):
    """Set x = P(z − step·gradient)."""
    for i in range(mu.size):
        f = d * i
        z2 = z[f + 2] if d == 3 else 0.0
        g2 = gradient[f + 2] if d == 3 else 0.0
        y0, y1, y2 = z[f] - step * gradient[f], z[f + 1] - step * gradient[f + 1], z2 - step * g2
        n, a, b = project(kind, y0, y1, y2, mu[i], radius[i])
        x[f], x[f + 1] = n, a
        if d == 3:
            x[f + 2] = b


@kernel(float64(INDEX, INDEX, DATA, int64, DATA, DATA, DATA, int64, VECTOR, VECTOR, VECTOR), fast=FAST)
def gap(start, column, blocks, kind, p, mu, radius, d, x, Wx, work):
    """Return ‖x − P(x − (Wx + p))‖ / max(‖x‖, ‖Wx + p‖, ‖p‖); Wx and `work` are written."""
    product(start, column, blocks, d, x, Wx)
    gradient = Wx + p
    projected_step(kind, x, 1.0, gradient, mu, radius, d, work)
    apart = xx = gg = pp = 0.0
    for k in range(x.size):
        apart += (x[k] - work[k]) ** 2
        xx += x[k] * x[k]
        gg += gradient[k] * gradient[k]
        pp += p[k] * p[k]
    scale = max(xx, max(gg, pp))
    return np.sqrt(apart / scale) if scale > 0.0 else 0.0


@kernel(
    int64(INDEX, INDEX, DATA, int64, DATA, DATA, DATA, int64, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, int64), fast=FAST
)
def accelerate(start, column, blocks, kind, p, mu, radius, d, x, Wx, z, Wz, state, iterations):
    """Make `iterations` of Nesterov's method from (x, z), moving all vectors; return the products with W.

    The step is halved until the quadratic bound holds and grows a little in every iteration, the momentum is dropped
    where it points uphill.
    """
    new, Wnew, gradient = np.empty(x.size), np.empty(x.size), np.empty(x.size)
    products = 0
    for _ in range(iterations):
        step = min(GROW * state[STEP], LONGEST)  # longer steps are tried every time: the bound is local
        for k in range(x.size):
            gradient[k] = Wz[k] + p[k]
        for _ in range(HALVINGS):
            projected_step(kind, z, step, gradient, mu, radius, d, new)
            product(start, column, blocks, d, new, Wnew)
            products += 1
            bent = square = 0.0
            for k in range(x.size):
                change = new[k] - z[k]
                bent += change * (Wnew[k] - Wz[k])  # changeᵀW change by differences: no further product
                square += change * change
            if bent * step <= square:  # the quadratic bound of a step 1/L holds along this change
                break
            step *= 0.5
        state[STEP] = step
        uphill = 0.0
        for k in range(x.size):
            uphill += gradient[k] * (new[k] - x[k])  # O'Donoghue and Candès' test, free of evaluations
        theta, beta = 1.0, 0.0  # restart
        if uphill <= 0.0:
            old = state[THETA]
            theta = 0.5 * (-old * old + old * np.sqrt(old * old + 4.0))
            beta = old * (1.0 - old) / (old * old + theta)
        state[THETA] = theta
        for k in range(x.size):
            z[k] = new[k] + beta * (new[k] - x[k])
            Wz[k] = Wnew[k] + beta * (Wnew[k] - Wx[k])
            x[k], Wx[k] = new[k], Wnew[k]
    return products


@kernel(void(INDEX, INDEX, DATA, DATA, DATA, int64, DATA, DATA, DATA, int64, VECTOR, int64), fast=FAST)
def sweeps(start, column, blocks, diagonal, step, kind, p, mu, radius, d, x, count):
    """Make `count` Gauss–Seidel sweeps, in place on x: each contact by projected gradient steps of its length.

    diagonal : (nc·d·d,) blocks W_cc. step : (nc,) 1 over the largest eigenvalue of their symmetric parts.
    """
    for _ in range(count):
        for i in range(mu.size):
            f = d * i
            v0, v1, v2 = p[f], p[f + 1], 0.0
            x0, x1, x2 = x[f], x[f + 1], 0.0
            if d == 3:
                v2, x2 = p[f + 2], x[f + 2]
                for k in range(start[i], start[i + 1]):
                    j, b = 3 * column[k], 9 * k
                    v0 += blocks[b] * x[j] + blocks[b + 1] * x[j + 1] + blocks[b + 2] * x[j + 2]
                    v1 += blocks[b + 3] * x[j] + blocks[b + 4] * x[j + 1] + blocks[b + 5] * x[j + 2]
                    v2 += blocks[b + 6] * x[j] + blocks[b + 7] * x[j + 1] + blocks[b + 8] * x[j + 2]
            else:
                for k in range(start[i], start[i + 1]):
                    j, b = 2 * column[k], 4 * k
                    v0 += blocks[b] * x[j] + blocks[b + 1] * x[j + 1]
                    v1 += blocks[b + 2] * x[j] + blocks[b + 3] * x[j + 1]
            first = 0.0
            for trial in range(LOCAL):
                y0, y1, y2 = x0 - step[i] * v0, x1 - step[i] * v1, x2 - step[i] * v2
                n, a, b2 = project(kind, y0, y1, y2, mu[i], radius[i])
                c0, c1, c2 = n - x0, a - x1, b2 - x2
                x0, x1, x2 = n, a, b2
                square = c0 * c0 + c1 * c1 + c2 * c2
                if trial == 0:
                    first = square
                # solved further, it would be changed by the others again
                if square <= LOCAL_GAIN * LOCAL_GAIN * first:
                    break
                if d == 3:
                    at = 9 * i
                    v0 += diagonal[at] * c0 + diagonal[at + 1] * c1 + diagonal[at + 2] * c2
                    v1 += diagonal[at + 3] * c0 + diagonal[at + 4] * c1 + diagonal[at + 5] * c2
                    v2 += diagonal[at + 6] * c0 + diagonal[at + 7] * c1 + diagonal[at + 8] * c2
                else:
                    at = 4 * i
                    v0 += diagonal[at] * c0 + diagonal[at + 1] * c1
                    v1 += diagonal[at + 2] * c0 + diagonal[at + 3] * c1
            x[f], x[f + 1] = x0, x1
            if d == 3:
                x[f + 2] = x2
