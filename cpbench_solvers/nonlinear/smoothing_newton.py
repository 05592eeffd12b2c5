"""Smoothing Newton: the smoothed Fischer–Burmeister equation, its smoothing an unknown that goes to zero."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cpbench.formulations.ncp_functions import fischer_burmeister
from cpbench.foundation.matrices import Vector, norm
from cpbench.solvers.base import Budget, SolverSpec, register
from cpbench_solvers.nonlinear.box_newton import BoxMethod, BoxNewton, CountedBox
from cpbench_solvers.nonlinear.merit_search import ARMIJO, Descent, MeritPoint, fall_back_afresh
from cpbench_solvers.traits import ITERATIVE

BACKTRACKS = 25
LEAST = 1e-14
"""μ does not become smaller: the smoothed root is then the root."""


@dataclass(frozen=True)
class SmoothingOptions:
    """Options of smoothing-newton. `mu` : the first smoothing, over the size of the first ‖Φ‖∞, at most 1. `memory`
    : merits that the line search compares with. `max_iterations` : steps. `restarts` : other starts that are tried
    in the end."""

    mu: float = 0.5
    memory: int = 3
    max_iterations: int = 1000
    restarts: int = 20


@register
class SmoothingNewton(BoxNewton):
    """H(μ, z) = (μ, Φ_μ(z)), Φ_μ of ψ_μ(a, b) = a + b − √(a² + b² + 2μ²): smooth for μ > 0.

    Each step solves H′(μ, z) Δ = −H + β (μ⁰, 0) with β = γ min(1, ‖H‖²), so that μ stays positive and goes to zero
    as fast as ‖H‖²; a line search on ‖H‖². Where the Jacobian is singular, a Levenberg–Marquardt or gradient step on
    the unsmoothed merit is taken.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="smoothing-newton",
        node="micp",
        summary="Newton on the smoothed Fischer-Burmeister equation, the smoothing an unknown",
        method="smoothing Newton",
        citation="Kanzow 1996, SIAM J. Matrix Anal. Appl. 17:851; Qi, Sun and Zhou 2000, Math. Program. 87:1",
        traits=ITERATIVE,
        options=SmoothingOptions,
    )

    def method(self, box: CountedBox, options: SmoothingOptions, budget: Budget) -> BoxMethod:
        return _Smoothing(box, options)


class _Smoothing(BoxMethod):
    strategies = 2

    def __init__(self, box: CountedBox, options: SmoothingOptions) -> None:
        super().__init__(box)
        self._options = options
        self._merits: deque[float] = deque(maxlen=options.memory)
        self._descent = Descent(box, fischer_burmeister, 1, project=True)

    def begin(self, z: Vector, F: Vector, strategy: int) -> None:
        """Begin; the other strategy smooths more."""
        at = self._descent.at(z, F)
        size = min(1.0, float(np.abs(at.phi).max(initial=0.0))) if math.isfinite(at.merit) else 1.0
        self._first = self._mu = max(self._options.mu * (size if strategy == 0 else 10.0), LEAST)
        # ‖H‖ must begin at γ μ⁰ < 1 times itself for μ to stay positive (Qi, Sun and Zhou, section 3)
        self._gamma = min(0.2, 0.5 / self._first)
        self._merits.clear()
        self._stand(z, F)

    def _stand(self, z: Vector, F: Vector) -> None:
        self.z, self.F = z, F
        self._merits.append(self._merit(self._mu, z, F)[0])

    def _merit(self, mu: float, z: Vector, F: Vector) -> tuple[float, MeritPoint, Vector]:
        """Return ‖H‖², Φ_μ with its derivatives, ∂Φ_μ/∂μ."""
        with np.errstate(all="ignore"):
            phi, alpha, beta, by_mu = self.box.equation.smoothed(z, F, mu)
            merit = mu * mu + float(phi @ phi)
        merit = merit if math.isfinite(merit) else math.inf
        return merit, MeritPoint(z, F, phi, alpha, beta, 0.5 * merit), by_mu

    def step(self) -> bool:
        J = self.box.jacobian(self.z)
        if J is None:
            return False
        merit, at, by_mu = self._merit(self._mu, self.z, self.F)
        shrink = self._gamma * min(1.0, merit) * self._first - self._mu
        target = MeritPoint(at.z, at.F, at.phi + by_mu * shrink, at.alpha, at.beta, at.merit)
        d = self._descent.newton(target, J)
        if d is not None and self._search(d, shrink, merit):
            return True
        found = fall_back_afresh(self._descent, self.z, self.F, J)
        if found is None:
            return False
        self._merits.clear()
        self._stand(found.z, found.F)
        return True

    def _search(self, d: Vector, shrink: float, merit: float) -> bool:
        reference = max(self._merits)
        t = 1.0
        for _ in range(BACKTRACKS):
            z, mu = self.z + t * d, max(self._mu + t * shrink, LEAST)
            F = self.box.F(z)
            if self._merit(mu, z, F)[0] <= reference - 2.0 * ARMIJO * t * merit and norm(z - self.z) > 0.0:
                self._mu = mu
                self._stand(z, F)
                return True
            t *= 0.5
        return False
