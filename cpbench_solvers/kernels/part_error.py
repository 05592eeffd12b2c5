"""The error of reactions of every connected part of a contact problem, over the free velocities of the part.

Signorini's and Coulomb's laws are equations (Alart and Curnier 1991), min(r_N/ρ, u_N) = 0 and r_T/ρ = P(r_T/ρ − u_T), P
the projection on the ball of radius μ r_N/ρ. What reactions leave of them are velocities, compared with the largest
free velocity of the part, and each with a tenth of the contact's own, q or r/ρ, from `SMALL` of that on. No more is
compared with the reactions: norms that have these in their scale pass where reactions cancel.
"""

import numpy as np

from cpbench.foundation.kernels import COLUMN, DATA, DATA_2D, INDEX, START, VECTOR, helper, int64, kernel, void
from cpbench_solvers.kernels.contact_error import velocity_2d, velocity_3d
from cpbench_solvers.kernels.contact_law import velocity
from cpbench_solvers.kernels.vectors import square

OWN = 0.1
SMALL = 1e-4
FAR_BELOW = 2.0**-40
"""A part whose free velocities are this share of the largest of all is at rest: they are rounding."""


@helper()
def _velocity(start, column, blocks, diagonal, q, r, c, rolling, u):
    """Set u to row c of Wr + q."""
    d = u.size
    if rolling:
        velocity(start, column, blocks, q, r, c, u)
    elif d == 3:
        u[0], u[1], u[2] = velocity_3d(start, column, blocks, q, r, c)  # the fast one, for blocks by columns
    else:
        u[0], u[1] = velocity_2d(start, column, blocks, q, r, c)
    for a in range(d):
        for b in range(d):
            u[a] += diagonal[c, d * a + b] * r[d * c + b]


@helper()
def _slip(r, u, rho, radius):
    """Return ‖r/ρ − P(r/ρ − u)‖."""
    length = 0.0
    for a in range(u.size):
        length += (r[a] / rho - u[a]) ** 2
    length = np.sqrt(length)
    if length <= radius:  # within the ball it is u, which must not be lost beside r
        return np.sqrt(square(u))
    total = 0.0
    for a in range(u.size):
        total += (r[a] / rho - (r[a] / rho - u[a]) * radius / length) ** 2
    return np.sqrt(total)


@helper()
def _error(u, off, r, q, rho, mu, mu_r, size):
    """Return the error of a contact: of its reaction r at the velocity u, which is wrong by `off`, over the free
    velocities of its part."""
    d, radius = u.size, max(r[0], 0.0) / rho
    last = d if mu_r < 0.0 else 1 + (d - 1) // 2  # moments come after the friction
    worst = 0.0
    missed, own, away = abs(min(r[0] / rho, u[0])), max(abs(q[0]), abs(r[0]) / rho), abs(off[0])
    for kind in range(2 if mu_r < 0.0 else 3):
        if kind == 1:
            missed, away = _slip(r[1:last], u[1:last], rho, mu * radius), np.sqrt(square(off[1:last]))
            own = max(np.sqrt(square(q[1:last])), np.sqrt(square(r[1:last])) / rho)
        elif kind == 2:
            missed, away = _slip(r[last:], u[last:], rho, mu_r * radius), np.sqrt(square(off[last:]))
            own = max(np.sqrt(square(q[last:])), np.sqrt(square(r[last:])) / rho)
        missed += away
        error = missed / size
        if own > SMALL * size:
            error = max(error, OWN * missed / own)
        worst = worst if worst >= error else error  # NaN stays
    return worst


@helper()
def _sizes(q, d, part, sizes):
    """Write the largest free velocity of every part; of a part at rest, where others move, that of all."""
    sizes[:] = 0.0
    for i in range(part.size):
        sizes[part[i]] = max(sizes[part[i]], np.sqrt(square(q[d * i : d * i + d])))
    most = sizes.max() if sizes.size else 0.0
    for p in range(sizes.size):
        sizes[p] = sizes[p] if sizes[p] > FAR_BELOW * most else most
        sizes[p] = sizes[p] if sizes[p] > 0.0 else 1.0


@kernel(void(DATA, DATA, DATA, DATA, DATA, DATA, DATA, int64, INDEX, VECTOR, VECTOR))
def velocity_error(u, off, r, q, mu, mu_r, rho, dimension, part, sizes, errors):
    """Write the free velocity and the error of every part, of reactions at given velocities; NaN when anything is.
    Arguments are those of `part_error`, and `off`, by how much the velocities are wrong."""
    _sizes(q, dimension, part, sizes)
    errors[:] = 0.0
    for i in range(mu.size):
        own, p = slice(dimension * i, dimension * (i + 1)), part[i]
        error = _error(u[own], off[own], r[own], q[own], rho[i], mu[i], mu_r[i] if mu_r.size else -1.0, sizes[p])
        errors[p] = errors[p] if errors[p] >= error else error  # NaN stays


@kernel(void(START, COLUMN, DATA, DATA_2D, DATA, DATA, DATA, DATA, DATA, int64, INDEX, VECTOR))
def part_error(start, column, blocks, diagonal, q, mu, mu_r, rho, r, dimension, part, errors):
    """Write the error of r in every part; NaN when anything is. Parts without free velocities are measured as they are.

    Parameters
    ----------
    blocks : by columns for contacts in space, else by rows. mu_r : (nc,), none without rolling friction. q, r : with
    moments in units of a length of the contact. part : (nc,), the number of the part of each contact. errors : as many
    as there are parts.
    """
    nc, d, rolling = mu.size, dimension, mu_r.size > 0
    sizes, u, none = np.empty(errors.size), np.empty(d), np.zeros(d)
    _sizes(q, d, part, sizes)
    errors[:] = 0.0
    for i in range(nc):
        p, at, free = part[i], r[d * i : d * i + d], q[d * i : d * i + d]
        _velocity(start, column, blocks, diagonal, q, r, i, rolling, u)
        error = _error(u, none, at, free, rho[i], mu[i], mu_r[i] if rolling else -1.0, sizes[p])
        errors[p] = errors[p] if errors[p] >= error else error
