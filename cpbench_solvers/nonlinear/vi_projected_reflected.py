"""Projected reflected gradient: F at a reflected point, one projection an iteration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

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


@dataclass(frozen=True)
class ReflectedOptions(VIProjectionOptions):
    """Options of projected-reflected. `share` : λL is at most this, below √2 − 1. `growth` : the longest
    extrapolation τ that is tried."""

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
