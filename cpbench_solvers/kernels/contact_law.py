"""By how much one contact misses its law, with or without rolling friction, and its velocity from W by rows."""

import numpy as np

from cpbench.foundation.kernels import helper
from cpbench_solvers.kernels.one_contact import natural_step as coulomb_step
from cpbench_solvers.kernels.rolling_local import natural_step


@helper()
def velocity(start, column, blocks, q, r, c, v):
    """Set v = q_c + Σ W_cb r_b over the other contacts; blocks by rows."""
    d = v.size
    for i in range(d):
        v[i] = q[d * c + i]
    for k in range(start[c], start[c + 1]):
        e, other = np.int64(k), d * np.int64(column[k])  # unsigned and signed numbers together would be floats
        for i in range(d):
            for j in range(d):
                v[i] += blocks[(e * d + i) * d + j] * r[other + j]


@helper()
def defect(r, u, mu, mu_r, rho, x):
    """Return ‖r − P_K(r − ρ û)‖² with rolling friction; x is room."""
    total = (r[0] - natural_step(r, u, mu, mu_r, rho, x)) ** 2
    for i in range(x.size):
        total += (r[1 + i] - x[i]) ** 2
    return total


@helper()
def miss(r, u, mu, mu_r, rolling, rho, x):
    """Return ‖r − P_K(r − ρ û)‖²; x is room."""
    if rolling:
        return defect(r, u, mu, mu_r, rho, x)
    r2, u2 = (r[2], u[2]) if r.size == 3 else (0.0, 0.0)  # the plane is the case of a tangent that does not move
    p0, p1, p2 = coulomb_step(r[0], r[1], r2, u[0], u[1], u2, mu, rho)
    return (r[0] - p0) ** 2 + (r[1] - p1) ** 2 + (r2 - p2) ** 2
