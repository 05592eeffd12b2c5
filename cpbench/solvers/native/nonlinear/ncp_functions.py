"""NCP functions ψ(a, b) = 0 ⇔ 0 ≤ a ⟂ b ≥ 0, signed so that both derivatives are ≥ 0 near a solution, and the equation
Φ(z) = 0 that they make of a box-constrained problem.

    min   min(a, b)                                         (35)
    fb    a + b − √(a² + b²)                                 (36), Fischer–Burmeister, negated
    pfb   λ fb + (1 − λ) max(0, a) max(0, b)                 (37), Chen, Chen and Kanzow, negated
    ep    ab − ½ min(0, a + b)²                              (38), Evtushenko–Purtov, its sign mended

Between two bounds Φᵢ = ψ(zᵢ − lbᵢ, −ψ(ubᵢ − zᵢ, −Fᵢ)) (Billups 1995); for min that is the natural map.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from cpbench.matrices import Vector

Values: TypeAlias = tuple[Vector, Vector, Vector]
"""ψ and its two (generalized) partial derivatives, each as long as a and b."""
NCPFunction: TypeAlias = Callable[[Vector, Vector], Values]

PENALTY_SHARE = 0.95
"""λ of the penalized function, as in Chen, Chen and Kanzow 2000."""


def minimum(a: Vector, b: Vector) -> Values:
    """min(a, b); at a tie the derivative is that of b."""
    first = a < b
    return np.where(first, a, b), first.astype(float), (~first).astype(float)


def fischer_burmeister(a: Vector, b: Vector) -> Values:
    """a + b − √(a² + b²); at (0, 0) the derivative is the limit from the direction (1, 1)."""
    root = np.hypot(a, b)
    at_zero = root == 0.0
    safe = np.where(at_zero, 1.0, root)
    kink = 1.0 - np.sqrt(0.5)
    both = (a > 0) & (b > 0)
    # without cancellation when both are positive
    phi = np.where(both, 2.0 * a * (b / np.where(both, a + b + root, 1.0)), a + b - root)
    return phi, np.where(at_zero, kink, 1.0 - a / safe), np.where(at_zero, kink, 1.0 - b / safe)


def penalized(a: Vector, b: Vector, share: float = PENALTY_SHARE) -> Values:
    """λ fb(a, b) + (1 − λ) a₊b₊."""
    phi, by_a, by_b = fischer_burmeister(a, b)
    rest, a_plus, b_plus = 1.0 - share, np.maximum(a, 0.0), np.maximum(b, 0.0)
    return (
        share * phi + rest * a_plus * b_plus,
        share * by_a + rest * b_plus * (a > 0),
        share * by_b + rest * a_plus * (b > 0),
    )


def evtushenko_purtov(a: Vector, b: Vector) -> Values:
    """ab − ½ min(0, a + b)²: differentiable, with derivative 0 at (0, 0)."""
    low = np.minimum(0.0, a + b)
    return a * b - 0.5 * low * low, b - low, a - low


def smoothed(a: Vector, b: Vector, mu: float) -> Values:
    """a + b − √(a² + b² + 2μ²), whose zeros have ab = μ² (Kanzow 1996); for μ > 0 it has no kink."""
    root = np.sqrt(a * a + b * b + 2.0 * mu * mu)
    both = (a > 0) & (b > 0)
    phi = np.where(both, 2.0 * (a * b - mu * mu) / np.where(both, a + b + root, 1.0), a + b - root)
    return phi, 1.0 - a / root, 1.0 - b / root


class Reformulation:
    """Φ for bounds lb ≤ z ≤ ub: Fᵢ where there is none, ψ for one, Billups' composition for two, zᵢ − lbᵢ where they
    are equal."""

    def __init__(self, lb: Vector, ub: Vector) -> None:
        self.fixed: NDArray[np.bool_] = lb == ub
        self._low = np.flatnonzero(np.isfinite(lb) & ~self.fixed)
        self._high = np.flatnonzero(np.isfinite(ub) & ~self.fixed)
        self._lb, self._ub, self._value = lb[self._low], ub[self._high], lb[self.fixed]

    def __call__(self, psi: NCPFunction, z: Vector, F: Vector) -> Values:
        """Φ, α and β: diag(α) + diag(β) F′(z) is an element of its generalized derivative."""
        phi, alpha, beta = np.array(F), np.zeros_like(F), np.ones_like(F)
        with np.errstate(all="ignore"):
            at = self._high
            value, by_a, by_b = psi(self._ub - z[at], -F[at])
            phi[at], alpha[at], beta[at] = -value, by_a, by_b
            at = self._low
            value, by_a, by_b = psi(z[at] - self._lb, phi[at])
            phi[at], alpha[at], beta[at] = value, by_a + by_b * alpha[at], by_b * beta[at]
            at = self.fixed
            phi[at], alpha[at], beta[at] = z[at] - self._value, 1.0, 0.0
        return phi, alpha, beta

    def smoothed(self, z: Vector, F: Vector, mu: float) -> tuple[Vector, Vector, Vector, Vector]:
        """Φ_μ, α, β and ∂Φ/∂μ."""
        phi, alpha, beta = self(partial(smoothed, mu=mu), z, F)
        by_mu = np.zeros_like(F)
        inner = np.array(F)
        at = self._high
        high = self._ub - z[at]
        inner[at] = -smoothed(high, -F[at], mu)[0]
        by_mu[at] = 2.0 * mu / np.sqrt(high * high + F[at] ** 2 + 2.0 * mu * mu)
        at = self._low
        low = z[at] - self._lb
        root = np.sqrt(low * low + inner[at] ** 2 + 2.0 * mu * mu)
        by_mu[at] = -2.0 * mu / root + (1.0 - inner[at] / root) * by_mu[at]
        by_mu[self.fixed] = 0.0
        return phi, alpha, beta, by_mu
