"""Projection methods on frictional contact as the variational inequality of û over the cones, with one step length.

F(x) = Wx + q + μ‖u_T‖e_N over K. From x the trial is y = P_K(x − ρF(x)), with ρ reduced until

    ρ‖F(x) − F(y)‖ ≤ L‖x − y‖

(Khobotov), and raised where the left side is much the smaller. Then the next x is y itself (De Saxcé's fixed point)
or P_K(x − ρF(y)) (Korpelevich's extragradient).
"""

import numpy as np

from cpbench.foundation.kernels import DATA, FAST, INDEX, VECTOR, helper, int64, kernel
from cpbench_solvers.kernels.frozen_contact import CONE, product, projected_step
from cpbench_solvers.kernels.vectors import put

FIXED_POINT, EXTRAGRADIENT = 0, 1
LARGE, SMALL = 0.9, 0.3
"""L, and the ratio below which ρ is raised."""
SHORTER, REDUCTIONS, LONGEST = 2.0 / 3.0, 60, 100.0
"""ρ grows in the null space of W up to LONGEST, where W has diagonal 1."""


@helper(fast=FAST)
def _shifted(start, column, blocks, q, mu, d, x, F):
    """Set F = û(x)."""
    product(start, column, blocks, d, x, F)
    for i in range(mu.size):
        f = d * i
        square = 0.0
        for k in range(f, f + d):
            F[k] += q[k]
            if k > f:
                square += F[k] * F[k]
        F[f] += mu[i] * np.sqrt(square)  # De Saxcé's shift makes the law a variational inequality over the cones


@kernel(int64(INDEX, INDEX, DATA, DATA, DATA, int64, int64, VECTOR, VECTOR, int64), fast=FAST)
def iterate(start, column, blocks, q, mu, d, method, x, rho, iterations):
    """Make `iterations` in place on x and ρ, shape (1,); return the evaluations of F."""
    F, G, y = np.empty(x.size), np.empty(x.size), np.empty(x.size)
    _shifted(start, column, blocks, q, mu, d, x, F)
    evaluations = 1
    for _ in range(iterations):
        ratio = 0.0
        for _ in range(REDUCTIONS):
            projected_step(CONE, x, rho[0], F, mu, mu, d, y)  # cones have no radius
            _shifted(start, column, blocks, q, mu, d, y, G)
            evaluations += 1
            way = change = 0.0
            for k in range(x.size):
                way += (x[k] - y[k]) ** 2
                change += (F[k] - G[k]) ** 2
            ratio = rho[0] * np.sqrt(change / way) if way > 0.0 else 0.0  # x is a fixed point where y = x
            if ratio <= LARGE:
                break
            rho[0] *= SHORTER * min(1.0, 1.0 / ratio)
        if method != FIXED_POINT:
            projected_step(CONE, x, rho[0], G, mu, mu, d, y)
            _shifted(start, column, blocks, q, mu, d, y, G)
            evaluations += 1
        put(x, y)
        put(F, G)
        if ratio < SMALL:
            rho[0] = min(rho[0] / SHORTER, LONGEST)  # raised only now: the step that was taken is justified
    return evaluations
