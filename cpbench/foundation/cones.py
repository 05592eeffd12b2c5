"""Projections and distances, vectorised over contacts.

The friction cone of a contact is K_μ = {r : ‖r_T‖ ≤ μ r_N}, normal first; its dual is K*_μ = {û : û_N ≥ μ‖û_T‖}
(the cone K_{1/μ} for μ > 0, a half space for μ = 0). Arrays of contacts have shape (nc, d), d = 2 or 3.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:  # guests in another interpreter project by this module, and have NumPy alone
    from cpbench.foundation.matrices import Dense, Vector


def tangential_norm(x: Dense) -> Vector:
    """Return ‖x_T‖ of every row (normal component first)."""
    return np.abs(x[:, 1]) if x.shape[1] == 2 else np.sqrt(np.einsum("ij,ij->i", x[:, 1:], x[:, 1:]))


def project_friction_cone(x: Dense, mu: Vector) -> Dense:
    """Project every row on K_μ (Euclidean); shape (nc, d)."""
    t = tangential_norm(x)
    xn = x[:, 0]
    outside = t > mu * xn
    polar = mu * t <= -xn
    with np.errstate(divide="ignore", invalid="ignore"):
        normal = (mu * t + xn) / (1.0 + mu * mu)
        factor = np.where(t > 0, mu * normal / t, 0.0)
    result = x * np.where(outside, factor, 1.0)[:, None]
    result[:, 0] = np.where(outside, normal, xn)
    result[polar] = 0.0
    return result


def de_saxce(u: Dense, mu: Vector) -> Dense:
    """Return û = u + μ‖u_T‖ e_N, De Saxcé's change of variable (De Saxcé and Feng 1998)."""
    shifted = u.copy()
    shifted[:, 0] += mu * tangential_norm(u)
    return shifted


def project_box(x: Vector, lower: Vector, upper: Vector) -> Vector:
    """Project on lower ≤ x ≤ upper (infinite bounds allowed)."""
    return np.minimum(np.maximum(x, lower), upper)


def box_defect(z: Vector, w: Vector, lower: Vector, upper: Vector) -> Vector:
    """Return z − P(z − w), P the projection on the box, without forming z − w: no w is lost below the last digit of
    z."""
    return np.maximum(np.minimum(w, z - lower), z - upper)


def rolling_norms(x: Dense) -> tuple[Vector, Vector]:
    """Return ‖x_T‖ and ‖x_M‖ of rows (N, T, M) or (N, T1, T2, M1, M2)."""
    k = (x.shape[1] - 1) // 2
    return np.linalg.norm(x[:, 1 : 1 + k], axis=1), np.linalg.norm(x[:, 1 + k :], axis=1)


def project_rolling_cone(x: Dense, mu: Vector, mu_r: Vector) -> Dense:
    """Project every row on {r : ‖r_T‖ ≤ μ r_N, ‖m‖ ≤ μ_r r_N} (Euclidean); shape (nc, 3) or (nc, 5).

    For a given r_N the nearest r_T and m are x_T and x_M clipped, so r_N is the root of an increasing piecewise linear
    g(r) = r − x_N − μ(‖x_T‖ − μr)₊ − μ_r(‖x_M‖ − μ_r r)₊, and its signs at the two kinks tell which clips are active.
    Comparing distances instead would lose half of the digits.
    """
    k = (x.shape[1] - 1) // 2
    xn = x[:, 0]
    t, m = rolling_norms(x)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        kink_t, kink_m = np.where(mu > 0, t / mu, np.inf), np.where(mu_r > 0, m / mu_r, np.inf)
        swap = kink_m < kink_t
        first, second = np.minimum(kink_t, kink_m), np.maximum(kink_t, kink_m)
        c, size = np.where(swap, mu, mu_r), np.where(swap, t, m)  # of the clip that ends at the second kink
        both = (xn + mu * t + mu_r * m) / (1.0 + mu**2 + mu_r**2)
        one = (xn + c * size) / (1.0 + c**2)
        before_first = first - xn - np.where(c > 0, c * (size - c * first), 0.0) >= 0
    best = np.maximum(np.where(before_first, both, np.where(second >= xn, one, xn)), 0.0)
    result = np.empty_like(x)
    result[:, 0] = best
    for part, size, bound in ((slice(1, 1 + k), t, mu * best), (slice(1 + k, None), m, mu_r * best)):
        result[:, part] = x[:, part] * _shrink(size, bound)[:, None]
    return result


def rolling_de_saxce(u: Dense, mu: Vector, mu_r: Vector) -> Dense:
    """Return û = u + (μ‖u_T‖ + μ_r‖ω‖) e_N, the change of variable for rolling friction (Acary and Bourrier 2021)."""
    t, m = rolling_norms(u)
    shifted = u.copy()
    shifted[:, 0] += mu * t + mu_r * m
    return shifted


def project_cylinder(x: Dense, radius: Vector) -> Dense:
    """Project every row on ℝ₊ × disk of that radius (Tresca's friction with a given threshold)."""
    result = x.copy()
    result[:, 0] = np.maximum(x[:, 0], 0.0)
    result[:, 1:] *= _shrink(np.linalg.norm(x[:, 1:], axis=1), radius)[:, None]
    return result


def _shrink(size: Vector, bound: Vector) -> Vector:
    """Factor that takes a length `size` to at most `bound`."""
    outside = size > bound
    return np.where(outside, bound / np.where(outside, size, 1.0), 1.0)


class Law(Protocol):
    """Friction law of all contacts: De Saxcé's shift, and the cone of the reactions."""

    def shift(self, u: Dense) -> Dense:
        """Return û of velocities u, shape (nc, d)."""
        ...

    def project(self, r: Dense) -> Dense:
        """Project every row on the cone K of its contact."""
        ...

    def in_units(self, lengths: Dense) -> Law:
        """Return the law of r/lengths and u·lengths, shape (nc, d), constant over the moments of a contact, 1
        elsewhere."""
        ...


@dataclass(frozen=True, eq=False)
class Coulomb:
    """‖r_T‖ ≤ μ r_N, û = u + μ‖u_T‖e_N."""

    mu: Vector

    def shift(self, u: Dense) -> Dense:
        return de_saxce(u, self.mu)

    def project(self, r: Dense) -> Dense:
        return project_friction_cone(r, self.mu)

    def in_units(self, lengths: Dense) -> Coulomb:
        return self


@dataclass(frozen=True, eq=False)
class RollingCoulomb:
    """‖r_T‖ ≤ μ r_N and ‖m‖ ≤ μ_r r_N, û = u + (μ‖u_T‖ + μ_r‖ω‖)e_N."""

    mu: Vector
    mu_r: Vector

    def shift(self, u: Dense) -> Dense:
        return rolling_de_saxce(u, self.mu, self.mu_r)

    def project(self, r: Dense) -> Dense:
        return project_rolling_cone(r, self.mu, self.mu_r)

    def in_units(self, lengths: Dense) -> RollingCoulomb:
        return RollingCoulomb(self.mu, self.mu_r / lengths[:, -1])
