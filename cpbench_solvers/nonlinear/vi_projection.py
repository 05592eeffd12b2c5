"""Projection with one evaluation of F an iteration: z ← P_S(z − γF(z))."""

from __future__ import annotations

import math
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

SHARE = 0.9
"""A step must have γL ≤ SHARE for the L that it meets."""
GROWTH = 1.1
WORSE = 2.0
"""An error above WORSE times the least halves the longest step: with F that turns, short steps converge only."""


@dataclass(frozen=True)
class VIFixedPointOptions(VIProjectionOptions):
    """Options of projection-vi. `step` : γ, 0 for one that adapts to the Lipschitz constants met."""

    step: float = 0.0


class _FixedPoint(ProjectionMethod):
    options: VIFixedPointOptions

    def begin(self, z: Vector, F: Vector) -> None:
        self.z, self.F = z, F
        self._step = self.options.step or SHARE * self.field.first_step(z, F)
        self._longest, self._least = math.inf, math.inf

    def step(self) -> bool:
        z, F = self.z, self.F
        fixed = self.options.step > 0
        now = norm(self.field.defect(z, F))
        if now > WORSE * self._least and not fixed:
            self._longest, self._least = 0.5 * self._step, now
            self._step = self._longest
        self._least = min(self._least, now)
        for _ in range(SHRINKS):
            near = self.field.project(z - self._step * F, z)
            F_near = self.field.F(near)
            L = lipschitz(near, F_near, z, F)
            if self._step * L <= SHARE or (fixed and math.inf > L):
                self.z, self.F = near, F_near
                if not fixed and self._step * L < 0.7 * SHARE:
                    self._step = min(GROWTH * self._step, self._longest)
                return True
            if fixed:
                return False
            self._step *= max(0.1, 0.9 * SHARE / (self._step * L))
        return False


@register
class VIProjection(ProjectionSolver):
    """The fixed-point iteration of the natural map. It converges where F is cocoercive, as gradients of convex
    functions are, or strongly monotone and γ short enough; a monotone F that only turns defeats it."""

    method = _FixedPoint
    spec: ClassVar[SolverSpec] = projection_spec(
        name="projection-vi",
        summary="fixed point of z = P(z − γF(z)), γ adapts",
        citation="Goldstein 1964, Bull. Amer. Math. Soc. 70; Facchinei and Pang 2003, section 12.1",
        options=VIFixedPointOptions,
    )
