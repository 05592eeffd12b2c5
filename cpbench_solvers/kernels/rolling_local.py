"""One contact with rolling friction, solved exactly, and the step of its natural map.

One contact with local velocity u = D r + v separates when v_N ≥ 0. Else u_N = 0 gives r_N, and x = (r_T, m) solves

    (S + Λ) x = −b,  Λ = diag(λI, κI),   λ ≥ 0 ⟂ μ r_N − ‖r_T‖ ≥ 0,   κ ≥ 0 ⟂ μ_r r_N − ‖m‖ ≥ 0

with the Schur complement S of D: u_T = −λ r_T and ω = −κ m are the law, and λ = 0 or κ = 0 is sticking. These two
unknowns are found by Newton's method on 1/(μ r_N) = 1/‖r_T‖, which is nearly linear in λ, and the like for κ, each
equation only while its λ or κ is positive or its bound exceeded. λ and κ are remembered from sweep to sweep. Where
Newton cycles both are bracketed, one inside the other; where that fails, and where D_NN is not positive, the contact
takes a step of the natural map, P_K(r − ρ û).
"""

import numpy as np

from cpbench.foundation.kernels import helper

NEWTON, BISECTIONS, REFINEMENTS = 60, 60, 2
SMALL, ACCEPTED = 1e-14, 1e-8
"""Relative misfit of the bounds at which Newton ends, and at which what rounding has left is taken."""
GROWTH = 10.0


@helper()
def norms(x, k):
    t = m = 0.0
    for i in range(k):
        t += x[i] * x[i]
        m += x[k + i] * x[k + i]
    return np.sqrt(t), np.sqrt(m)


@helper()
def _factorize(A, pivots):
    """Return LU with row exchanges in place; False for a zero pivot."""
    n = pivots.size
    for j in range(n):
        p = j
        for i in range(j + 1, n):
            if abs(A[i, j]) > abs(A[p, j]):
                p = i
        pivots[j] = p
        if A[p, j] == 0.0:
            return False
        if p != j:
            for c in range(n):
                A[j, c], A[p, c] = A[p, c], A[j, c]
        for i in range(j + 1, n):
            A[i, j] /= A[j, j]
            for c in range(j + 1, n):
                A[i, c] -= A[i, j] * A[j, c]
    return True


@helper()
def _substitute(A, pivots, x):
    n = pivots.size
    for j in range(n):
        p = pivots[j]
        x[j], x[p] = x[p], x[j]
    for i in range(n):
        for j in range(i):
            x[i] -= A[i, j] * x[j]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            x[i] -= A[i, j] * x[j]
        x[i] /= A[i, i]


@helper()
def _at(S, h, shift, free, b, mu, mu_r, lam, kap, x, dx, A, pivots):
    """Return (regular, r_N, ‖r_T‖, ‖m‖) for given λ and κ, with x = (r_T, m) and the factors of S + Λ + shift I in
    place.

    Steps of refinement take the shift out of x where S + Λ is regular; elsewhere x stays nearly the shortest one.
    """
    n = x.size
    k = n // 2
    for i in range(n):
        still = mu == 0.0 if i < k else mu_r == 0.0
        for j in range(n):
            # without friction x_i = 0: a row of the identity keeps the size of the system
            A[i, j] = 0.0 if still else S[n * i + j]
        A[i, i] += 1.0 if still else (lam if i < k else kap) + shift
        x[i] = 0.0 if still else -b[i]
    if not _factorize(A, pivots):
        return False, 0.0, 0.0, 0.0
    _substitute(A, pivots, x)
    if shift > 0.0:
        for _ in range(REFINEMENTS):
            for i in range(n):
                dx[i] = 0.0
                if not (mu == 0.0 if i < k else mu_r == 0.0):
                    dx[i] = -b[i] - (lam if i < k else kap) * x[i]
                    for j in range(n):
                        dx[i] -= S[n * i + j] * x[j]
            _substitute(A, pivots, dx)
            for i in range(n):
                x[i] += dx[i]
    rn = free
    for i in range(n):
        rn -= h[i] * x[i]
    t, m = norms(x, k)
    return True, rn, t, m


@helper()
def _misfit(length, bound):
    """Return relative difference of a length and its bound, 0 where both are."""
    size = length + abs(bound)
    return abs(length - bound) / size if size > 0.0 else 0.0


@helper()
def _far(S, b, bound_t, bound_m, n):
    """Return λ and κ from ‖b_T‖ = (s + λ)·bound with s the mean of the diagonal of S, 0 where that is negative."""
    t, m = norms(b, n // 2)
    s_t = s_m = 0.0
    for i in range(n // 2):
        s_t += S[(n + 1) * i]
        s_m += S[(n + 1) * (n // 2 + i)]
    return max(t / bound_t - 2.0 * s_t / n, 0.0), max(m / bound_m - 2.0 * s_m / n, 0.0)


@helper()
def _newton(S, h, shift, free, b, mu, mu_r, warm, x, dx, A, pivots):
    """Return (found, r_N, λ, κ) from λ, κ = `warm` unless both groups stick."""
    n = x.size
    k = n // 2
    lam, kap = 0.0, 0.0
    size = abs(S[0]) + abs(S[n * n - 1])
    for attempt in range(NEWTON):
        regular, rn, t, m = _at(S, h, shift, free, b, mu, mu_r, lam, kap, x, dx, A, pivots)
        if not regular:
            return False, 0.0, 0.0, 0.0
        slides = mu > 0.0 and (lam > 0.0 or t > mu * rn)
        rolls = mu_r > 0.0 and (kap > 0.0 or m > mu_r * rn)
        worst = max(_misfit(t, mu * rn) if slides else 0.0, _misfit(m, mu_r * rn) if rolls else 0.0)
        if rn >= 0.0 and worst <= SMALL:
            return True, rn, lam, kap
        if attempt == 0 and (warm[0] > 0.0 or warm[1] > 0.0):
            lam, kap = warm[0], warm[1]
            continue
        if attempt == 0 and slides and rolls and free > 0.0:
            # exact for Λ ≫ S: without it a step from 0 takes one of both far and the other back, for ever
            lam, kap = _far(S, b, mu * free, mu_r * free, n)
            if lam > 0.0 or kap > 0.0:
                continue
        # the equations g = 0 of what slides and rolls, their derivatives by λ (first column) and κ
        J11, J12, J21, J22 = 1.0, 0.0, 0.0, 1.0
        for column in range(2):
            if not (slides if column == 0 else rolls):
                continue
            for i in range(n):
                dx[i] = -x[i] if (i < k) == (column == 0) else 0.0
            _substitute(A, pivots, dx)
            drn = dt = dm = 0.0
            for i in range(n):
                drn -= h[i] * dx[i]
                if i < k:
                    dt += x[i] * dx[i] / t
                else:
                    dm += x[i] * dx[i] / m
            # reciprocals are nearly linear in λ; beyond r_N = 0 they have a pole
            first = dt / (t * t) - drn / (mu * rn * rn) if rn > 0.0 else mu * drn - dt
            second = dm / (m * m) - drn / (mu_r * rn * rn) if rn > 0.0 else mu_r * drn - dm
            if column == 0:
                J11, J21 = first, second if rolls else 0.0
            else:
                J12, J22 = first if slides else 0.0, second
        g1 = g2 = 0.0
        if slides:
            g1 = 1.0 / (mu * rn) - 1.0 / t if rn > 0.0 else mu * rn - t
        if rolls:
            g2 = 1.0 / (mu_r * rn) - 1.0 / m if rn > 0.0 else mu_r * rn - m
        determinant = J11 * J22 - J12 * J21
        new_lam = lam - (J22 * g1 - J12 * g2) / determinant
        new_kap = kap - (J11 * g2 - J21 * g1) / determinant
        if not (np.isfinite(new_lam) and np.isfinite(new_kap)):
            return False, 0.0, 0.0, 0.0
        new_lam = min(max(new_lam, 0.0), GROWTH * (lam + size))  # far steps come from a derivative that vanishes
        new_kap = min(max(new_kap, 0.0), GROWTH * (kap + size))
        # no step is left: what rounding allows
        if abs(new_lam - lam) <= 1e-16 * lam and abs(new_kap - kap) <= 1e-16 * kap:
            return rn >= 0.0 and worst <= ACCEPTED, rn, lam, kap
        lam, kap = new_lam, new_kap
    return False, 0.0, 0.0, 0.0


@helper()
def _slide(S, h, shift, free, b, mu, mu_r, kap, x, dx, A, pivots):
    """Return (found, λ) for a given κ, by bisection; none where r_N < 0 for λ → ∞: where κ is too small."""
    regular, rn, t, _ = _at(S, h, shift, free, b, mu, mu_r, 0.0, kap, x, dx, A, pivots)
    if not regular:
        return False, 0.0
    if mu == 0.0 or t <= mu * rn:
        return True, 0.0
    low, high, bracketed = 0.0, abs(S[0]), False
    for _ in range(2 * BISECTIONS):
        lam = 0.5 * (low + high) if bracketed else high
        if bracketed and (lam <= low or lam >= high):
            break
        regular, rn, t, _ = _at(S, h, shift, free, b, mu, mu_r, lam, kap, x, dx, A, pivots)
        if regular and t <= mu * rn:
            high, bracketed = lam, True
        elif bracketed:
            low = lam
        else:
            low, high = high, GROWTH * high
    return bracketed, high


@helper()
def _nested(S, h, shift, free, b, mu, mu_r, x, dx, A, pivots):
    """Return (found, r_N, λ, κ) by bisection on κ, and for each on λ; for strong coupling, where Newton cycles."""
    found, lam = _slide(S, h, shift, free, b, mu, mu_r, 0.0, x, dx, A, pivots)
    regular, rn, t, m = _at(S, h, shift, free, b, mu, mu_r, lam, 0.0, x, dx, A, pivots)
    kap = 0.0
    if mu_r > 0.0 and not (found and regular and m <= mu_r * rn):
        low, high, bracketed = 0.0, abs(S[S.size - 1]), False
        for _ in range(2 * BISECTIONS):
            kap = 0.5 * (low + high) if bracketed else high
            if bracketed and (kap <= low or kap >= high):
                break
            found, lam = _slide(S, h, shift, free, b, mu, mu_r, kap, x, dx, A, pivots)
            regular, rn, t, m = _at(S, h, shift, free, b, mu, mu_r, lam, kap, x, dx, A, pivots)
            if found and regular and m <= mu_r * rn:
                high, bracketed = kap, True
            elif bracketed:
                low = kap
            else:
                low, high = high, GROWTH * high
        kap = high
        found, lam = _slide(S, h, shift, free, b, mu, mu_r, kap, x, dx, A, pivots)
        regular, rn, t, m = _at(S, h, shift, free, b, mu, mu_r, lam, kap, x, dx, A, pivots)
    right = found and regular and rn >= 0.0
    if lam > 0.0 or t > mu * rn:
        right = right and _misfit(t, mu * rn) <= ACCEPTED
    if kap > 0.0 or m > mu_r * rn:
        right = right and _misfit(m, mu_r * rn) <= ACCEPTED
    return right, rn, lam, kap


@helper()
def one_contact(S, h, shift, monotone, free, b, mu, mu_r, warm, x, dx, A, pivots):
    """Return (found, by Newton, r_N); x = (r_T, m), `warm` = (λ, κ) in place. h = D_NX/D_NN, free = −v_N/D_NN."""
    found, rn, lam, kap = _newton(S, h, shift, free, b, mu, mu_r, warm, x, dx, A, pivots)
    easy = found
    if not found and monotone:
        found, rn, lam, kap = _nested(S, h, shift, free, b, mu, mu_r, x, dx, A, pivots)
    if not found:
        return False, False, 0.0
    n = x.size
    t, m = norms(x, n // 2)
    for i in range(n):  # rounding leaves x off the cone by a little
        length, bound = (t, mu * rn) if i < n // 2 else (m, mu_r * rn)
        if length > bound:
            x[i] *= bound / length
    warm[0], warm[1] = lam, kap
    return True, easy, rn


@helper()
def natural_step(r, u, mu, mu_r, rho, x):
    """Return P_K(r − ρ û): r_N is returned, (r_T, m) put into x; the formula of `cones.project_rolling_cone`."""
    n = x.size
    k = n // 2
    for i in range(n):
        x[i] = u[1 + i]
    slip, spin = norms(x, k)
    xn = r[0] - rho * (u[0] + mu * slip + mu_r * spin)
    for i in range(n):
        x[i] = r[1 + i] - rho * u[1 + i]
    t, m = norms(x, k)
    kink_t = t / mu if mu > 0.0 else np.inf  # the height from which each cone contains its part
    kink_m = m / mu_r if mu_r > 0.0 else np.inf
    first, second = min(kink_t, kink_m), max(kink_t, kink_m)
    c, size = (mu, t) if kink_m < kink_t else (mu_r, m)
    # the derivative of the distance at the first kink decides the piece
    rest = c * (size - c * first) if c > 0.0 else 0.0
    if first - xn - rest >= 0.0:
        rn = (xn + mu * t + mu_r * m) / (1.0 + mu * mu + mu_r * mu_r)
    elif second >= xn:
        rn = (xn + c * size) / (1.0 + c * c)
    else:
        rn = xn
    rn = max(rn, 0.0)
    for i in range(n):
        length, bound = (t, mu * rn) if i < k else (m, mu_r * rn)
        if length > bound:
            x[i] *= bound / length
    return rn
