"""One contact with local velocity u = D r + v (v: all other contacts and q), solved exactly, in 2D and 3D.

Case by case: separation when v_N ≥ 0; else u_N = 0 gives r_N and leaves S r_T + b = u_T with the Schur complement S of
D, not symmetrised. Sticking is u_T = 0. Sliding is (S + λI) r_T = -b with λ > 0 such that ‖r_T‖ = μ r_N, found by
Newton's method on the secular equation 1/(μ r_N) = 1/‖r_T‖, kept inside a bracket. λ is the ratio ‖u_T‖/‖r_T‖ and is
remembered from sweep to sweep.
"""

import numpy as np

from cpbench.foundation.kernels import FAST, helper

PROJECT, INVERSE_NN, S11, S12, S21, S22, TN1, TN2, NT1, NT2, FLOOR, INDEFINITE = range(12)
"""Columns of `local`: 1 where the normal equation cannot be solved for r_N; 1/W_NN; S; W_TN/W_NN; W_NT/W_NN; the
least λ for which S + λI is safely invertible; 1 where S has a negative eigenvalue."""

NEWTON = 80
"""Steps on the secular equation; bisection, where it must, has found the root by then."""
SMALL = 1e-14
LINEAR = 1e-14
"""Square of the share of r_T by which a last step may change it and be as exact when it is linear."""


@helper(fast=FAST)
def projected(x0, x1, x2, mu):
    """Return P_K of one vector."""
    t = np.sqrt(x1 * x1 + x2 * x2)
    if mu * t <= -x0:  # first: without friction, (−1, 0, 0) meets the other condition, too
        return 0.0, 0.0, 0.0
    if t <= mu * x0:
        return x0, x1, x2
    normal = (mu * t + x0) / (1.0 + mu * mu)
    factor = mu * normal / t
    return normal, factor * x1, factor * x2


@helper(fast=FAST)
def natural_step(r0, r1, r2, u0, u1, u2, mu, rho):
    """Return P_K(r - ρ û): a fixed point is a solution, whatever the block is like."""
    hat = u0 + mu * np.sqrt(u1 * u1 + u2 * u2)
    return projected(r0 - rho * hat, r1 - rho * u1, r2 - rho * u2, mu)


@helper(fast=FAST)
def one_contact_3d(local, i, v0, v1, v2, mu, lam):
    """Return (found, r_N, r_T1, r_T2, λ) of u = D r + v; not found only for indefinite blocks."""
    if v0 >= 0.0:
        return True, 0.0, 0.0, 0.0, lam
    iw = local[i, INVERSE_NN]
    free = -v0 * iw
    if mu == 0.0:
        return True, free, 0.0, 0.0, lam
    a, b, c, d = local[i, S11], local[i, S12], local[i, S21], local[i, S22]
    b1 = v1 - local[i, TN1] * v0
    b2 = v2 - local[i, TN2] * v0
    h1, h2 = local[i, NT1], local[i, NT2]
    floor = local[i, FLOOR]
    # with the adjugate, x = y/det: quotients take longer than all the rest
    stick = 0.0 if local[i, INDEFINITE] != 0.0 else floor  # a singular S sticks by the shortest r_T
    al, dl = a + stick, d + stick
    det = al * dl - b * c
    y1, y2 = b * b2 - dl * b1, c * b1 - al * b2
    normal = free * det - h1 * y1 - h2 * y2
    if normal * det > 0.0 and y1 * y1 + y2 * y2 <= mu * mu * normal * normal:
        inverse = 1.0 / det
        return True, normal * inverse, y1 * inverse, y2 * inverse, lam
    if not lam > floor:  # exact for S = sI without coupling to the normal
        lam = np.sqrt(b1 * b1 + b2 * b2) / (mu * free) - 0.5 * (a + d)
        if not lam > floor:
            lam = floor + 0.05 * max(abs(a) + abs(d), abs(floor))
    low, high = floor, np.inf
    for _ in range(NEWTON):
        al, dl = a + lam, d + lam
        det = al * dl - b * c
        y1, y2 = b * b2 - dl * b1, c * b1 - al * b2
        t = np.sqrt(y1 * y1 + y2 * y2)
        m = mu * (free * det - h1 * y1 - h2 * y2)
        excess = t - m  # times det: the same sign, without a division
        if abs(excess) <= SMALL * (t + abs(m)):
            inverse = 1.0 / det
            return True, m / mu * inverse, y1 * inverse, y2 * inverse, lam
        if excess > 0.0:
            low = lam
        else:
            high = lam
        z1, z2 = dl * y1 - b * y2, al * y2 - c * y1  # dx/dλ = -z/det²
        yz, hz = y1 * z1 + y2 * z2, mu * (h1 * z1 + h2 * z2)  # derivatives of ‖r_T‖ and μ r_N, both times det²
        if m > 0.0:
            step = excess * t * t * m * det / (yz * m * m + hz * t * t * t)
            new = lam + step
            if new > low and step * step * (z1 * z1 + z2 * z2) <= LINEAR * det * det * t * t:
                x1, x2 = y1 * det - step * z1, y2 * det - step * z2
                inverse = 1.0 / (det * det)
                rn = free - (h1 * x1 + h2 * x2) * inverse
                m = mu * rn / np.sqrt(x1 * x1 + x2 * x2)
                return True, rn, m * x1, m * x2, new
        else:
            new = lam + excess * t * det / (yz + hz * t)  # r_N ≤ 0: its reciprocal has no meaning here
        if not (new > low and new < high):  # Newton left the bracket: bisect, or go on while there is no upper end
            new = 0.5 * (low + high) if high < np.inf else 4.0 * lam + SMALL * (abs(a) + abs(d))
        if abs(new - lam) <= 1e-16 * lam:
            break
        lam = new
    # rounding leaves r_T off the cone by a little where t cancels; off by more there is no root in the bracket
    if not (abs(excess) <= 1e-6 * (t + abs(m)) and m > 0.0):
        return False, 0.0, 0.0, 0.0, 0.0
    inverse, m = 1.0 / det, m / t
    return True, m * t / mu * inverse, y1 * m * inverse, y2 * m * inverse, lam


@helper(fast=FAST)
def one_contact_2d(a, h, g, c, v0, v1, mu):
    """Return (found, r_N, r_T) for D = [[a, h], [g, c]]: separation, sticking, and sliding to either side."""
    if v0 >= 0.0:
        return True, 0.0, 0.0
    if mu == 0.0:
        return a > 0.0, -v0 / a, 0.0
    determinant = a * c - h * g
    if abs(determinant) > SMALL * (abs(a * c) + abs(h * g)):
        rn = (h * v1 - c * v0) / determinant
        rt = (g * v0 - a * v1) / determinant
        if rn >= 0.0 and abs(rt) <= mu * rn:
            return True, rn, rt
    elif a > 0.0 and abs(v1 - g * v0 / a) <= SMALL * (abs(v1) + abs(g * v0 / a)):
        return True, -v0 / a, 0.0
    opposed = a * v1 - g * v0  # b times W_NN: the side on which r_T opposes the free sliding
    first = -1.0 if opposed > 0.0 else 1.0
    if a > 0.0 and determinant >= 0.0 and a + first * mu * h > 0.0:
        rn = -v0 / (a + first * mu * h)
        return True, rn, first * mu * rn
    for side in (first, -first):
        normal = a + side * mu * h
        if normal > 0.0:
            rn = -v0 / normal
            if side * (v1 + (g + side * mu * c) * rn) <= 0.0:
                return True, rn, side * mu * rn
    return False, 0.0, 0.0
