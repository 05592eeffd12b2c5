"""Malitsky's methods, one evaluation of F and one projection an iteration: golden ratio, and reflected gradients."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cpbench.foundation.matrices import Vector, norm
from cpbench.solvers.base import SolverSpec, register
from cpbench_solvers.nonlinear.projection_run import (
    SHRINKS,
    ProjectionMethod,
    ProjectionSolver,
    VIProjectionOptions,
    lipschitz,
    projection_spec,
)

LONGEST = 1e8
"""Longest step, relative to the first."""


@dataclass(frozen=True)
class GoldenRatioOptions(VIProjectionOptions):
    """Options of golden-ratio. `phi` : φ of the paper, above 1, at most (1 + √5)/2; its experiments take 1.5."""

    phi: float = 1.5


class _GoldenRatio(ProjectionMethod):
    """λₖ = min(ρλₖ₋₁, φθₖ₋₁/(4λₖ₋₁L²)), z̄ ← ((φ − 1)z + z̄)/φ, z⁺ = P_S(z̄ − λₖF(z)), θₖ = φλₖ/λₖ₋₁, ρ = 1/φ + 1/φ²
    (Malitsky 2020, algorithm 1), L that of the last step."""

    options: GoldenRatioOptions

    def begin(self, z: Vector, F: Vector) -> None:
        self.z, self.F, self._mean = z, F, z
        self._step = self.field.first_step(z, F)
        self._longest, self._theta = LONGEST * self._step, 1.0
        self._L = 1.0 / self._step

    def step(self) -> bool:
        phi, before = self.options.phi, self._step
        length = min((1.0 / phi + 1.0 / phi**2) * before, self._longest)
        if self._L > 0:
            length = min(length, phi * self._theta / (4.0 * before * self._L**2))
        mean = ((phi - 1.0) * self.z + self._mean) / phi
        for _ in range(SHRINKS):
            z = self.field.project(mean - length * self.F, self.z)
            F = self.field.F(z)
            if np.isfinite(F).all():
                self._L = lipschitz(z, F, self.z, self.F)
                self._theta, self._step = phi * length / before, length
                self.z, self.F, self._mean = z, F, mean
                return True
            length *= 0.1  # the paper's F is defined everywhere
        return False


@register
class VIGoldenRatio(ProjectionSolver):
    """Explicit, with steps from local Lipschitz constants alone."""

    method = _GoldenRatio
    spec: ClassVar[SolverSpec] = projection_spec(
        name="golden-ratio",
        summary="adaptive golden ratio algorithm",
        citation="Malitsky 2020, Math. Program. 184:383",
        options=GoldenRatioOptions,
    )


@dataclass(frozen=True)
class ReflectedOptions(VIProjectionOptions):
    """Options of projected-reflected. `share` : the largest λL, below √2 − 1. `growth` : the longest τ tried."""

    share: float = 0.4
    growth: float = 1.2


class _Reflected(ProjectionMethod):
    """y = x + τ(x − x₋), λ = τλ₋ with λ‖F(y) − F(y₋)‖ ≤ share·‖y − y₋‖, x⁺ = P_S(x − λF(y)) (Malitsky 2015: τ = 1, and
    section 4 for steps that change). Measured and answered is y, whose F is at hand; it may be outside S by what the
    error, which counts that, allows."""

    options: ReflectedOptions

    def begin(self, z: Vector, F: Vector) -> None:
        self.z, self.F = z, F
        self._x = self._before = z
        self._step = self.options.share * self.field.first_step(z, F)
        self._next()

    def _next(self) -> None:
        self._x, self._before = self.field.project(self._x - self._step * self.F, self._x), self._x

    def step(self) -> bool:
        tau, way = self.options.growth, self._x - self._before
        if not norm(way):
            return False
        for _ in range(SHRINKS):
            y = self._x + tau * way
            F = self.field.F(y)
            reached = tau * self._step * lipschitz(y, F, self.z, self.F)
            if reached <= self.options.share:
                self.z, self.F, self._step = y, F, tau * self._step
                self._next()
                return True
            tau *= 0.7
        return False


@register
class VIProjectedReflected(ProjectionSolver):
    """One evaluation and one projection an iteration, unless the step must become shorter."""

    method = _Reflected
    spec: ClassVar[SolverSpec] = projection_spec(
        name="projected-reflected",
        summary="projected reflected gradient with adaptive steps",
        citation="Malitsky 2015, SIAM J. Optim. 25:502",
        options=ReflectedOptions,
    )
