"""Projections and distances, vectorised over contacts.

The friction cone of a contact is K_μ = {r : ‖r_T‖ ≤ μ r_N}, normal first; its dual is K*_μ = {û : û_N ≥ μ‖û_T‖}
(the cone K_{1/μ} for μ > 0, a half space for μ = 0). Arrays of contacts have shape (nc, d), d = 2 or 3.
"""

from __future__ import annotations

import numpy as np

from cpbench.matrices import Dense, Vector


def tangential_norm(x: Dense) -> Vector:
    """‖x_T‖ of every row (normal component first)."""
    return np.abs(x[:, 1]) if x.shape[1] == 2 else np.sqrt(np.einsum("ij,ij->i", x[:, 1:], x[:, 1:]))


def project_friction_cone(x: Dense, mu: Vector) -> Dense:
    """Euclidean projection of every row on K_μ; shape (nc, d)."""
    t = tangential_norm(x)
    xn = x[:, 0]
    outside = t > mu * xn
    polar = mu * t <= -xn
    with np.errstate(divide="ignore", invalid="ignore"):
        normal = (mu * t + xn) / (1.0 + mu * mu)
        factor = np.where(t > 0, mu * normal / t, 0.0)
    result = x.copy()
    result[outside, 0] = normal[outside]
    result[outside, 1:] = factor[outside, None] * x[outside, 1:]
    result[polar] = 0.0
    return result


def distance_to_friction_cone(x: Dense, mu: Vector) -> Vector:
    """Distance of every row to K_μ."""
    return np.linalg.norm(x - project_friction_cone(x, mu), axis=1)


def distance_to_dual_cone(x: Dense, mu: Vector) -> Vector:
    """Distance of every row to K*_μ, by Moreau: x - P_{K*}(x) = -P_K(-x)."""
    return np.linalg.norm(project_friction_cone(-x, mu), axis=1)


def de_saxce(u: Dense, mu: Vector) -> Dense:
    """û = u + μ‖u_T‖ e_N, De Saxcé's change of variable (De Saxcé and Feng 1998)."""
    shifted = u.copy()
    shifted[:, 0] += mu * tangential_norm(u)
    return shifted


def project_box(x: Vector, lower: Vector, upper: Vector) -> Vector:
    """Projection on lower ≤ x ≤ upper (infinite bounds allowed)."""
    return np.minimum(np.maximum(x, lower), upper)
