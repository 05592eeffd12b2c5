"""The equation Φ(z) = 0 that an NCP function makes of a box-constrained problem.

Between two bounds Φᵢ = ψ(zᵢ − lbᵢ, −ψ(ubᵢ − zᵢ, −Fᵢ)) (Billups 1995); for min that is the natural map.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from cpbench.formulations.ncp_functions import NCPFunction, Values, smoothed
from cpbench.foundation.matrices import Vector


class Reformulation:
    """Φ for lb ≤ z ≤ ub: Fᵢ without a bound, ψ for one, Billups' composition for two, zᵢ − lbᵢ for equal ones."""

    def __init__(self, lb: Vector, ub: Vector) -> None:
        self.fixed: NDArray[np.bool_] = lb == ub
        self._low = np.flatnonzero(np.isfinite(lb) & ~self.fixed)
        self._high = np.flatnonzero(np.isfinite(ub) & ~self.fixed)
        self._lb, self._ub, self._value = lb[self._low], ub[self._high], lb[self.fixed]

    def __call__(self, psi: NCPFunction, z: Vector, F: Vector) -> Values:
        """Return Φ, α and β: diag(α) + diag(β) F′(z) is an element of its generalized derivative."""
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
        """Return Φ_μ, α, β and ∂Φ/∂μ."""
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
