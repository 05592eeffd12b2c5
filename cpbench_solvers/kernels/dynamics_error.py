"""The error of an answer to a global contact problem: of norms, and of every connected part (`dynamics_rows`)."""

import numpy as np
from numba import boolean, float64, njit, types

from cpbench_solvers.kernels.array_types import COMPILED, DATA, DATA_2D, INDEX
from cpbench_solvers.kernels.contact_law import miss
from cpbench_solvers.kernels.dynamics_rows import felt_units
from cpbench_solvers.kernels.vectors import square

ROUNDING = 16.0 * np.finfo(np.float64).eps
"""Share of the sum of the sizes of its terms by which rounding may change a row."""
UNCERTAIN = 1.25
"""Units come from an iteration that ends early: they are known to 0.15 bits, and in an error are two of them."""
MATRIX = types.Tuple((INDEX, INDEX, DATA))
"""A matrix in CSR: row starts, columns, values."""
LAW = types.Tuple((DATA, DATA, DATA_2D, DATA))
"""μ, μ_r (nothing without rolling friction), the lengths of moments, ρ."""
ROWS = types.Tuple((INDEX, INDEX, DATA, DATA, INDEX, DATA))
"""The first arguments of `felt_units`."""


@njit(error_model="numpy")
def _product(A, x, y):
    """Write Ax."""
    start, column, value = A
    for i in range(y.size):
        total = 0.0
        for k in range(start[i], start[i + 1]):
            total += value[k] * x[column[k]]
        y[i] = total


@njit(error_model="numpy")
def _add_transposed(A, x, y, absolute):
    """Add Aᵀx to y; of sizes, where that is asked for."""
    start, column, value = A
    for i in range(x.size):
        for k in range(start[i], start[i + 1]):
            y[column[k]] += abs(value[k] * x[i]) if absolute else value[k] * x[i]


@njit(
    float64(MATRIX, MATRIX, MATRIX, DATA, DATA, DATA, DATA, LAW, ROWS, boolean, float64, float64, DATA, DATA, DATA),
    **COMPILED,
)
def judged(M, H, G, f, w, b, q, law, rows, absolute, impulse, velocity, v, r, lam):
    """Return the largest error; NaN when anything is.

    Parameters
    ----------
    q : velocities of the contacts for r = 0. absolute : whether f, w and b are 0. impulse, velocity : `units` of the
    problem, with f and b among them. v, r, lam : the answer.
    """
    mu, mu_r, lengths, rho = law
    nc, d = lengths.shape
    n, p, rolling = f.size, b.size, mu_r.size > 0
    Mv, Hr, Gl, force = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    _product(M, v, Mv)
    _product(H, r, Hr)
    _product(G, lam, Gl)
    for i in range(n):
        force[i] = Mv[i] - Hr[i] - Gl[i] - f[i]  # what is left of the dynamics
    joint, terms, u = b.copy(), np.zeros(p), w.copy()
    _add_transposed(G, v, joint, False)
    _add_transposed(G, v, terms, True)
    _add_transposed(H, v, u, False)

    # the norms, as `GlobalContact.residuals` has them
    off = np.sqrt(square(force))
    if impulse > 0.0:
        # the largest term, since each may be small
        largest = max(max(np.sqrt(square(Mv)), np.sqrt(square(Hr))), max(np.sqrt(square(Gl)), impulse))
        worst = max(off / largest, (off / impulse) ** 2)
    else:
        worst = max(off, off * off)
    if p:
        off = np.sqrt(square(joint))
        if velocity > 0.0:
            worst = max(worst, max(off / max(np.sqrt(square(terms)), velocity), (off / velocity) ** 2))
        else:
            worst = max(worst, max(off, off * off))
    natural = energy = opening = rr = uu = qq = rr_e = uu_e = qq_e = 0.0
    R, U, closing, carried = np.empty((nc, d)), np.empty((nc, d)), np.empty(nc), np.empty(nc)
    idle = np.zeros(nc, np.bool_)
    x, zero = np.empty(d - 1), np.zeros(d)
    for c in range(nc):
        own, moved, free = r[d * c : d * c + d], u[d * c : d * c + d], q[d * c : d * c + d]
        roll = mu_r[c] if rolling else 0.0
        natural += miss(own, moved, mu[c], roll, rolling, 1.0, x)
        rr += square(own)
        uu += square(moved)
        qq += square(free)
        size = 0.0
        for i in range(d):
            # moments in units of a length: forces and moments are comparable
            R[c, i], U[c, i] = own[i] / lengths[c, i], moved[i] * lengths[c, i]
            size += (free[i] * lengths[c, i]) ** 2
        roll /= lengths[c, d - 1]
        energy += miss(R[c], U[c], mu[c], roll, rolling, rho[c], x) / rho[c]
        closing[c] = np.sqrt(miss(zero, U[c], mu[c], roll, rolling, 1.0, x))
        opening += rho[c] * closing[c] ** 2
        carried[c] = np.sqrt(square(R[c]))
        rr_e += carried[c] ** 2 / rho[c]
        uu_e += rho[c] * square(U[c])
        qq_e += rho[c] * size
        idle[c] = square(U[c]) > 0.0  # it moves: nothing says how large its force should be
    if not absolute:
        scale, scale_e = max(qq, max(rr, uu)), max(qq_e, max(rr_e, uu_e))
        natural /= scale if scale > 0.0 else 1.0
        energy /= scale_e if scale_e > 0.0 else 1.0
        scale = qq_e if qq_e > 0.0 else uu_e
        opening /= scale if scale > 0.0 else 1.0
    worst = max(worst, max(max(np.sqrt(natural), np.sqrt(energy)), opening))

    # what every part feels
    sizes = np.concatenate((carried, np.abs(v), np.abs(lam)))
    per_unknown, per_row, per_constant, sums = np.empty(nc), sizes.copy(), sizes.copy(), sizes.copy()
    start, column, size, D, part, constants = rows
    felt_units(start, column, size, D, part, constants, nc, n, idle, sizes, per_unknown, per_row, per_constant, sums)
    squares, beyond = np.zeros(sizes.size), 0.0
    for i in range(sizes.size):
        if i < nc:
            for k in range(d):
                R[i, k] *= per_unknown[i]
                U[i, k] *= per_row[i]
            roll = mu_r[i] / lengths[i, d - 1] if rolling else 0.0
            off = closing[i]
            squares[part[i]] += miss(R[i], U[i], mu[i], roll, rolling, 1.0, x)
        else:
            off = abs(force[i - nc]) if i < nc + n else abs(joint[i - nc - n])
            squares[part[i]] += (off * per_row[i]) ** 2
        # rounding of terms that cancel does not count as growth
        beyond = max(beyond, (off - ROUNDING * (sums[i] + constants[i])) * per_constant[i])
    worst = max(worst, UNCERTAIN * np.sqrt(squares.max()) if squares.size else 0.0)
    worst = max(worst, min(UNCERTAIN * beyond * beyond, 1.0))
    total = natural + energy + opening + square(force) + square(joint)
    return worst if np.isfinite(total) else np.nan
