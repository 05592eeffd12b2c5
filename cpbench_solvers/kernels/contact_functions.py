"""Functions φ(x, v) of one contact whose zeros obey the law of Coulomb, and their derivatives A = ∂φ/∂x, B = ∂φ/∂v.

x is the reaction, v the velocity; A and B are exact where φ is differentiable, at a kink the limit from one side. A
contact in the plane is one in space whose second tangential components are 0.

    ALART_CURNIER        x_N − (y_N)₊, x_T − P_D(y_T), y = x − ϱv, D the disk of radius μ(y_N)₊
    JEAN_MOREAU          the same with the disk of radius μ(x_N)₊
    NATURAL_MAP          x − P_K(x − ϱ_N v̂), v̂ = v + μ‖v_T‖e_N
    FISCHER_BURMEISTER   a + b − (a∘a + b∘b)^½ in the Jordan algebra of the second-order cone, a = (μx_N, x_T) and
                         b = ϱ_N(v̂_N, μv_T); for μ = 0 the function of Fischer in (x_N, ϱ_N v_N), and x_T
"""

import numpy as np
from numba import njit

ALART_CURNIER, JEAN_MOREAU, NATURAL_MAP, FISCHER_BURMEISTER = range(4)

TINY = 1e-15
"""An eigenvalue in the Jordan algebra below this share of the other counts as so large: z has no inverse else."""


@njit(error_model="numpy")
def _disk(radius, y1, y2, e):
    """Return s of P_D(y_T) = s y_T; e gets y_T/‖y_T‖ where that is shortened, else 0."""
    t = np.sqrt(y1 * y1 + y2 * y2)
    e[0] = e[1] = 0.0  # inside of the disk the projection has no kink to follow
    if radius <= 0.0:  # an open contact: the disk is a point, and every direction is lost
        return 0.0
    if t <= radius:
        return 1.0
    e[0], e[1] = y1 / t, y2 / t
    return radius / t


@njit(error_model="numpy")
def projections(old_radius, x, v, mu, rho_n, rho_t, phi, A, B, e):
    """Evaluate Φ of Alart and Curnier, or Jean and Moreau (`old_radius`), at a contact; x, v, phi (3,), A, B (3, 3)."""
    A[:] = 0.0
    B[:] = 0.0
    y0, y1, y2 = x[0] - rho_n * v[0], x[1] - rho_t * v[1], x[2] - rho_t * v[2]
    closed = y0 > 0.0
    if closed:
        phi[0] = rho_n * v[0]
        B[0, 0] = rho_n
    else:
        phi[0] = x[0]
        A[0, 0] = 1.0
    base = x[0] if old_radius else y0
    s = _disk(mu * max(base, 0.0), y1, y2, e)
    phi[1], phi[2] = x[1] - s * y1, x[2] - s * y2
    # C = ∂P/∂y_T
    c11, c12, c22 = s * (1.0 - e[0] * e[0]), -s * e[0] * e[1], s * (1.0 - e[1] * e[1])
    A[1, 1], A[1, 2], A[2, 1], A[2, 2] = 1.0 - c11, -c12, -c12, 1.0 - c22
    B[1, 1], B[1, 2], B[2, 1], B[2, 2] = rho_t * c11, rho_t * c12, rho_t * c12, rho_t * c22
    if base > 0.0:
        A[1, 0], A[2, 0] = -mu * e[0], -mu * e[1]
        if not old_radius:
            B[1, 0], B[2, 0] = rho_n * mu * e[0], rho_n * mu * e[1]


@njit(error_model="numpy")
def _shifted(v, mu, e):
    """Return v̂_N; e gets the derivative of ‖v_T‖, 0 at its kink."""
    t = np.sqrt(v[1] * v[1] + v[2] * v[2])
    e[0] = v[1] / t if t > 0.0 else 0.0
    e[1] = v[2] / t if t > 0.0 else 0.0
    return v[0] + mu * t


@njit(error_model="numpy")
def natural(x, v, mu, rho, phi, A, B, e):
    """Evaluate Φ of the natural map at one contact."""
    A[:] = 0.0
    B[:] = 0.0
    hat = _shifted(v, mu, e)  # De Saxcé's shift moves the law into the cone: û_N = v_N + μ‖v_T‖
    y0, y1, y2 = x[0] - rho * hat, x[1] - rho * v[1], x[2] - rho * v[2]
    t = np.sqrt(y1 * y1 + y2 * y2)
    if t <= mu * y0 and mu > 0.0:
        phi[0], phi[1], phi[2] = rho * hat, rho * v[1], rho * v[2]
        B[0, 0] = B[1, 1] = B[2, 2] = rho
    elif mu * t <= -y0:
        phi[0], phi[1], phi[2] = x[0], x[1], x[2]
        A[0, 0] = A[1, 1] = A[2, 2] = 1.0
        return
    else:
        share = 1.0 / (1.0 + mu * mu)
        normal = (y0 + mu * t) * share
        inverse = 1.0 / t if t > 0.0 else 0.0
        t1, t2, s = y1 * inverse, y2 * inverse, mu * normal * inverse
        phi[0], phi[1], phi[2] = x[0] - normal, x[1] - s * y1, x[2] - s * y2
        # C = ggᵀ/(1 + μ²) + s (I − t tᵀ) on T, g = (1, μt)
        B[0, 0] = share
        B[0, 1] = B[1, 0] = share * mu * t1
        B[0, 2] = B[2, 0] = share * mu * t2
        B[1, 1] = share * mu * mu * t1 * t1 + s * t2 * t2
        B[1, 2] = B[2, 1] = (share * mu * mu - s) * t1 * t2
        B[2, 2] = share * mu * mu * t2 * t2 + s * t1 * t1
        for a in range(3):
            for b in range(3):
                A[a, b] = -B[a, b]
                B[a, b] *= rho
            A[a, a] += 1.0
    for a in range(3):
        B[a, 1] += mu * e[0] * B[a, 0]
        B[a, 2] += mu * e[1] * B[a, 0]


@njit(error_model="numpy")
def jordan(x, v, mu, rho, phi, A, B, e):
    """Evaluate Φ of Fischer and Burmeister at one contact (Fukushima, Luo and Tseng 2001).

    With z = (a∘a + b∘b)^½ = √λ₁c₁ + √λ₂c₂ and L_x the multiplication by x: ∂φ/∂a = I − L_z⁻¹L_a, the same for b.
    λ₁ is a sum of squares here: the difference of the norm would lose half of the digits.
    """
    A[:] = 0.0
    B[:] = 0.0
    hat = _shifted(v, mu, e)
    if mu == 0.0:
        b0 = rho * v[0]
        length = np.sqrt(x[0] * x[0] + b0 * b0)
        phi[0], phi[1], phi[2] = x[0] + b0 - length, x[1], x[2]
        A[0, 0] = 1.0 - (x[0] / length if length > 0.0 else np.sqrt(0.5))
        B[0, 0] = rho * (1.0 - (b0 / length if length > 0.0 else np.sqrt(0.5)))
        A[1, 1] = A[2, 2] = 1.0
        return
    a0, a1, a2 = mu * x[0], x[1], x[2]
    b0, b1, b2 = rho * hat, rho * mu * v[1], rho * mu * v[2]
    w1, w2 = a0 * a1 + b0 * b1, a0 * a2 + b0 * b2  # half of the tangential part of a∘a + b∘b
    half = np.sqrt(w1 * w1 + w2 * w2)
    size = np.sqrt(a0 * a0 + a1 * a1 + a2 * a2 + b0 * b0 + b1 * b1 + b2 * b2)
    if half > 0.0:
        e1, e2 = w1 / half, w2 / half
    else:
        e1, e2 = 1.0, 0.0
    along_a, along_b = e1 * a1 + e2 * a2, e1 * b1 + e2 * b2
    across = (e1 * a2 - e2 * a1) ** 2 + (e1 * b2 - e2 * b1) ** 2  # what is orthogonal to e counts in both eigenvalues
    first = np.sqrt((a0 - along_a) ** 2 + (b0 - along_b) ** 2 + across)
    second = np.sqrt((a0 + along_a) ** 2 + (b0 + along_b) ** 2 + across)
    z0, zt = 0.5 * (second + first), 0.5 * (second - first)
    phi[0], phi[1], phi[2] = a0 + b0 - z0, a1 + b1 - zt * e1, a2 + b2 - zt * e2
    if size == 0.0:  # of the elements there, that of a = b = e
        a0 = b0 = np.sqrt(0.5)
        first = second = z0 = 1.0
    elif first < TINY * second:
        first = TINY * second
        z0 = 0.5 * (second + first)
    # L_z⁻¹ has the eigenvalues 1/√λ₁, 1/√λ₂ on (1, ∓e)/√2, and 1/z₀ on what is orthogonal to both
    even, odd, rest = 0.5 / second + 0.5 / first, 0.5 / second - 0.5 / first, 1.0 / z0
    i01, i02 = odd * e1, odd * e2
    i11 = even * e1 * e1 + rest * e2 * e2
    i22 = even * e2 * e2 + rest * e1 * e1
    i12 = (even - rest) * e1 * e2
    for pair in range(2):
        if pair == 0:
            p0, p1, p2, M = a0, a1, a2, A
        else:
            p0, p1, p2, M = b0, b1, b2, B
        M[0, 0] = 1.0 - (even * p0 + i01 * p1 + i02 * p2)
        M[0, 1] = -(even * p1 + i01 * p0)
        M[0, 2] = -(even * p2 + i02 * p0)
        M[1, 0] = -(i01 * p0 + i11 * p1 + i12 * p2)
        M[1, 1] = 1.0 - (i01 * p1 + i11 * p0)
        M[1, 2] = -(i01 * p2 + i12 * p0)
        M[2, 0] = -(i02 * p0 + i12 * p1 + i22 * p2)
        M[2, 1] = -(i02 * p1 + i12 * p0)
        M[2, 2] = 1.0 - (i02 * p2 + i22 * p0)
    # from a and b to x and v
    for r in range(3):
        A[r, 0] *= mu
        B[r, 0] *= rho
        B[r, 1] = rho * mu * B[r, 1] + mu * e[0] * B[r, 0]
        B[r, 2] = rho * mu * B[r, 2] + mu * e[1] * B[r, 0]


@njit(error_model="numpy")
def one_contact(kind, x, v, mu, rho_n, rho_t, phi, A, B, e):
    """Evaluate Φ, A and B of that kind at one contact."""
    if kind == NATURAL_MAP:
        natural(x, v, mu, rho_n, phi, A, B, e)
    elif kind == FISCHER_BURMEISTER:
        jordan(x, v, mu, rho_n, phi, A, B, e)
    else:
        projections(kind == JEAN_MOREAU, x, v, mu, rho_n, rho_t, phi, A, B, e)
