"""Functions φ(x, v) of one contact whose zeros obey the law of Coulomb, and their derivatives A = ∂φ/∂x, B = ∂φ/∂v.

x is the reaction, v the velocity; A and B are exact where φ is differentiable, at a kink the limit from one side. A
contact in the plane is one in space whose second tangential components are 0.

    ALART_CURNIER        x_N − (y_N)₊, x_T − P_D(y_T), y = x − ϱv, D the disk of radius μ(y_N)₊
    NATURAL_MAP          x − P_K(x − ϱ_N v̂), v̂ = v + μ‖v_T‖e_N
"""

import numpy as np

from cpbench.foundation.kernels import helper

ALART_CURNIER, NATURAL_MAP = range(2)


@helper()
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


@helper()
def projections(x, v, mu, rho_n, rho_t, phi, A, B, e):
    """Evaluate Φ of Alart and Curnier at one contact; x, v, phi : (3,). A, B : (3, 3)."""
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
    s = _disk(mu * max(y0, 0.0), y1, y2, e)
    phi[1], phi[2] = x[1] - s * y1, x[2] - s * y2
    # C = ∂P/∂y_T
    c11, c12, c22 = s * (1.0 - e[0] * e[0]), -s * e[0] * e[1], s * (1.0 - e[1] * e[1])
    A[1, 1], A[1, 2], A[2, 1], A[2, 2] = 1.0 - c11, -c12, -c12, 1.0 - c22
    B[1, 1], B[1, 2], B[2, 1], B[2, 2] = rho_t * c11, rho_t * c12, rho_t * c12, rho_t * c22
    if closed:
        A[1, 0], A[2, 0] = -mu * e[0], -mu * e[1]
        B[1, 0], B[2, 0] = rho_n * mu * e[0], rho_n * mu * e[1]


@helper()
def _shifted(v, mu, e):
    """Return v̂_N; e gets the derivative of ‖v_T‖, 0 at its kink."""
    t = np.sqrt(v[1] * v[1] + v[2] * v[2])
    e[0] = v[1] / t if t > 0.0 else 0.0
    e[1] = v[2] / t if t > 0.0 else 0.0
    return v[0] + mu * t


@helper()
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


@helper()
def one_contact(kind, x, v, mu, rho_n, rho_t, phi, A, B, e):
    """Evaluate Φ, A and B of that kind at one contact."""
    if kind == NATURAL_MAP:
        natural(x, v, mu, rho_n, phi, A, B, e)
    else:
        projections(x, v, mu, rho_n, rho_t, phi, A, B, e)
