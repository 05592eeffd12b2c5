"""Ways to solve one contact, u = Dr + w with the law, other than the exact one of `gauss_seidel`.

A contact in the plane is one in space whose second tangent is apart from the rest: D and w are (3, 3) and (3,) always.
"""

import numpy as np
from numba import njit

from cpbench_solvers.kernels.contact_functions import projections
from cpbench_solvers.kernels.one_contact import natural_step

EPS = 1e-15
NEWTON_STEPS, HALVINGS = 25, 10
PROJECTIONS = 100
CHANGE = 1e-12
"""Relative change of r that ends projections of one contact."""
FAST, SLOW, SHORTER = 0.9, 0.3, 2.0 / 3.0
"""Above FAST ρ is shortened, below SLOW lengthened (He and Liao 2002)."""
BISECTIONS = 60


@njit(error_model="numpy")
def solve_3(M, b, x):
    """Return x = M⁻¹b by Cramer's rule; False where M is singular."""
    c0 = M[1, 1] * M[2, 2] - M[1, 2] * M[2, 1]
    c1 = M[1, 2] * M[2, 0] - M[1, 0] * M[2, 2]
    c2 = M[1, 0] * M[2, 1] - M[1, 1] * M[2, 0]
    determinant = M[0, 0] * c0 + M[0, 1] * c1 + M[0, 2] * c2
    # relative to what cancels in it, so that units do not matter
    if not abs(determinant) > EPS * (abs(M[0, 0] * c0) + abs(M[0, 1] * c1) + abs(M[0, 2] * c2)):
        return False
    i = 1.0 / determinant
    x[0] = i * (b[0] * c0 + M[0, 1] * (M[1, 2] * b[2] - b[1] * M[2, 2]) + M[0, 2] * (b[1] * M[2, 1] - M[1, 1] * b[2]))
    x[1] = i * (b[0] * c1 + M[0, 0] * (b[1] * M[2, 2] - M[1, 2] * b[2]) + M[0, 2] * (M[1, 0] * b[2] - b[1] * M[2, 0]))
    x[2] = i * (b[0] * c2 + M[0, 0] * (M[1, 1] * b[2] - b[1] * M[2, 1]) + M[0, 1] * (b[1] * M[2, 0] - M[1, 0] * b[2]))
    return True


@njit(error_model="numpy")
def _velocity(D, w, r, u):
    for a in range(3):
        u[a] = w[a] + D[a, 0] * r[0] + D[a, 1] * r[1] + D[a, 2] * r[2]


@njit(error_model="numpy")
def project(D, w, mu, rho, r, u):
    """Take one step of the natural map from r, in place."""
    _velocity(D, w, r, u)
    r[0], r[1], r[2] = natural_step(r[0], r[1], r[2], u[0], u[1], u[2], mu, rho)


@njit(error_model="numpy")
def project_often(D, w, mu, rho, r, room):
    """Take steps of the natural map from r, in place, until r stays; return the last ρ, which adapts to û."""
    u, y, uy = room[0], room[1], room[2]
    _velocity(D, w, r, u)
    for _ in range(PROJECTIONS):
        hat = u[0] + mu * np.sqrt(u[1] * u[1] + u[2] * u[2])
        ratio = change = size = 0.0
        for _ in range(HALVINGS):
            y[0], y[1], y[2] = natural_step(r[0], r[1], r[2], u[0], u[1], u[2], mu, rho)
            _velocity(D, w, y, uy)
            hat_y = uy[0] + mu * np.sqrt(uy[1] * uy[1] + uy[2] * uy[2])
            change = (y[0] - r[0]) ** 2 + (y[1] - r[1]) ** 2 + (y[2] - r[2]) ** 2
            size = y[0] * y[0] + y[1] * y[1] + y[2] * y[2]
            if change <= CHANGE * CHANGE * size:
                break
            moved = (hat_y - hat) ** 2 + (uy[1] - u[1]) ** 2 + (uy[2] - u[2]) ** 2
            ratio = rho * np.sqrt(moved / change)  # a Lipschitz estimate of û times ρ: above 1 the map may expand
            if ratio <= FAST:
                break
            rho *= SHORTER * min(1.0, 1.0 / ratio)  # far above, one reduction is enough
        for a in range(3):
            r[a], u[a] = y[a], uy[a]
        if change <= CHANGE * CHANGE * size:
            break
        if ratio < SLOW:  # for the next step alone: this one is done
            rho /= SHORTER
    return rho


@njit(error_model="numpy")
def newton(D, w, mu, rho, r, room, A, B, J):
    """Take damped Newton steps on Alart and Curnier's function from r, in place; False without convergence."""
    u, phi, d, trial, e = room[0], room[1], room[2], room[3], room[4]
    _velocity(D, w, r, u)
    projections(False, r, u, mu, rho, rho, phi, A, B, e)
    size = np.sqrt(phi[0] ** 2 + phi[1] ** 2 + phi[2] ** 2)
    free = rho * np.sqrt(w[0] ** 2 + w[1] ** 2 + w[2] ** 2)  # ‖Φ(0)‖ or so: what the residual is small beside
    for _ in range(NEWTON_STEPS):
        if size <= CHANGE * free:
            return True
        for a in range(3):
            for b in range(3):
                # Φ depends on r by x = r and by v = Dr + w
                J[a, b] = A[a, b] + B[a, 0] * D[0, b] + B[a, 1] * D[1, b] + B[a, 2] * D[2, b]
        if not solve_3(J, phi, d):
            return False
        t, found = 1.0, False
        for _ in range(HALVINGS):
            for a in range(3):
                trial[a] = r[a] - t * d[a]
            _velocity(D, w, trial, u)
            projections(False, trial, u, mu, rho, rho, phi, A, B, e)
            new = np.sqrt(phi[0] ** 2 + phi[1] ** 2 + phi[2] ** 2)
            if new <= (1.0 - 1e-4 * t) * size:
                found = True
                break
            t *= 0.5
        if not found:
            return False
        for a in range(3):
            r[a] = trial[a]
        size = new
    return False


@njit(error_model="numpy")
def _value(c, order, x):
    """Return the derivative of that order of c₀ + c₁x + … + c₄x⁴."""
    total = 0.0
    for k in range(4, order - 1, -1):
        factor = 1.0
        for m in range(order):
            factor *= k - m
        total = total * x + factor * c[k]  # Horner
    return total


@njit(error_model="numpy")
def roots_in_unit(c, roots, split):
    """Write the roots in (0, 1] of a polynomial of degree 4 where it changes its sign; return how many.

    roots : (4,), split : (6,).

    Between two neighbouring roots of its derivative a polynomial is monotone: the roots of the third derivative split
    (0, 1] for those of the second, and so on.
    """
    count = 0
    for order in range(3, -1, -1):
        split[0] = 0.0
        for k in range(count):
            split[k + 1] = roots[k]
        split[count + 1] = 1.0
        intervals, count = count + 1, 0
        for k in range(intervals):
            low, high = split[k], split[k + 1]
            below, above = _value(c, order, low), _value(c, order, high)
            if above == 0.0 and below != 0.0:  # a root at the end of an interval would be lost between both
                roots[count] = high
                count += 1
            elif below * above < 0.0:
                x = 0.5 * (low + high)
                for _ in range(BISECTIONS):
                    value = _value(c, order, x)
                    if value * below > 0.0:
                        low = x
                    else:
                        high = x
                    slope = _value(c, order + 1, x)
                    new = x - value / slope if slope != 0.0 else low
                    if not (new > low and new < high):  # Newton left the bracket
                        new = 0.5 * (low + high)
                    if abs(new - x) <= EPS * x:
                        break
                    x = new
                roots[count] = x
                count += 1
    return count


@njit(error_model="numpy")
def enumerate_modes(D, w, mu, r, room, roots, split):
    """Choose, of all r that solve the contact, open, sticking and sliding, the one nearest to r, in place; False for
    none.

    Sliding with u_T = −λr_T: (S + λI)r_T = −b, S = D_TT − D_TN D_NT/D_NN, so that ‖r_T‖² = μ²r_N² times det(S + λI)²
    is a polynomial of degree 4 in λ (Bonnefon and Daviet 2011). It is solved for λ ≤ 1 in units of S, and backwards
    for 1/λ.
    """
    best, x, c, back = room[0], room[1], room[2], room[3]
    least = np.inf
    if w[0] >= 0.0:
        best[:] = 0.0
        least = r[0] ** 2 + r[1] ** 2 + r[2] ** 2
    if mu == 0.0:
        if D[0, 0] > 0.0 and w[0] < 0.0:
            best[0], best[1], best[2] = -w[0] / D[0, 0], 0.0, 0.0
            least = 0.0
    elif solve_3(D, w, x) and x[0] <= 0.0 and x[1] ** 2 + x[2] ** 2 <= (mu * x[0]) ** 2:  # sticking: r = −D⁻¹w = −x
        distance = (r[0] + x[0]) ** 2 + (r[1] + x[1]) ** 2 + (r[2] + x[2]) ** 2
        if distance < least:
            least = distance
            best[0], best[1], best[2] = -x[0], -x[1], -x[2]
    if mu > 0.0 and D[0, 0] > 0.0:
        free, h1, h2 = -w[0] / D[0, 0], D[0, 1] / D[0, 0], D[0, 2] / D[0, 0]
        s11, s12 = D[1, 1] - D[1, 0] * h1, D[1, 2] - D[1, 0] * h2
        s21, s22 = D[2, 1] - D[2, 0] * h1, D[2, 2] - D[2, 0] * h2
        b1, b2 = w[1] + D[1, 0] * free, w[2] + D[2, 0] * free
        unit = max(abs(s11) + abs(s12), abs(s21) + abs(s22))
        if unit == 0.0:
            unit = D[0, 0]  # S = 0: any positive unit does
        s11, s12, s21, s22, b1, b2 = s11 / unit, s12 / unit, s21 / unit, s22 / unit, b1 / unit, b2 / unit
        trace, det = s11 + s22, s11 * s22 - s12 * s21
        # numerators of r_T1, r_T2 (degree 1) and r_N (degree 2) over det(S + λI)
        p0, p1 = s12 * b2 - s22 * b1, -b1
        m0, m1 = s21 * b1 - s11 * b2, -b2
        n0 = mu * (free * det - h1 * p0 - h2 * m0)
        n1, n2 = mu * (free * trace - h1 * p1 - h2 * m1), mu * free
        c[0] = p0 * p0 + m0 * m0 - n0 * n0
        c[1] = 2.0 * (p0 * p1 + m0 * m1 - n0 * n1)
        c[2] = p1 * p1 + m1 * m1 - n1 * n1 - 2.0 * n0 * n2
        c[3] = -2.0 * n1 * n2
        c[4] = -n2 * n2
        for k in range(5):
            back[k] = c[4 - k]  # roots beyond 1 are 1/roots of this: bisection needs a bounded interval
        for side in range(2):
            count = roots_in_unit(c if side == 0 else back, roots, split)
            for k in range(count):
                lam = roots[k] if side == 0 else 1.0 / roots[k]
                inverse = 1.0 / ((s11 + lam) * (s22 + lam) - s12 * s21)
                t1, t2 = (p0 + p1 * lam) * inverse, (m0 + m1 * lam) * inverse
                normal = free - h1 * t1 - h2 * t2
                length = np.sqrt(t1 * t1 + t2 * t2)
                # squaring has made roots with r_N < 0
                if not (normal > 0.0 and abs(length - mu * normal) <= 1e-6 * length):
                    continue
                t1, t2 = t1 * mu * normal / length, t2 * mu * normal / length
                distance = (r[0] - normal) ** 2 + (r[1] - t1) ** 2 + (r[2] - t2) ** 2
                if distance < least:
                    least = distance
                    best[0], best[1], best[2] = normal, t1, t2
    if not least < np.inf:
        return False
    r[0], r[1], r[2] = best[0], best[1], best[2]
    return True
