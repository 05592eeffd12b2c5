"""Projection, z ← P_S(z − γF(z)), and extragradient, where a trial step gives the direction of the real one; for sets
that stay, and for sets that move."""

from __future__ import annotations

import math
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

KORPELEVICH = "Korpelevich 1976, Matecon 12; Khobotov 1987, USSR Comput. Math. Math. Phys. 27; Marcotte 1991, INFOR 29"
SHARE = 0.9
"""A step must have γL ≤ SHARE for the L that it meets."""
GROWTH = 1.1
WORSE = 2.0
"""An error above WORSE times the least halves the longest step: with F that turns, short steps converge only."""


@dataclass(frozen=True)
class ExtragradientOptions(VIProjectionOptions):
    """Options of extragradients. `share` : the largest γL, below 1. `growth` : of γ after a much shorter step."""

    share: float = 0.9
    growth: float = 1.5


class Extragradient(ProjectionMethod):
    """y = P_S(z)(z − γF(z)), z⁺ = P_S(y)(z − γF(y)), with γ‖F(z) − F(y)‖ ≤ share·‖z − y‖ (Khobotov 1987)."""

    options: ExtragradientOptions

    def begin(self, z: Vector, F: Vector) -> None:
        self.z, self.F = z, F
        self._step = self.options.share * self.field.first_step(z, F)

    def step(self) -> bool:
        field, share = self.field, self.options.share
        for _ in range(SHRINKS):
            near = field.project(self.z - self._step * self.F, self.z)
            F_near = field.F(near)
            reached = self._step * lipschitz(near, F_near, self.z, self.F)
            if reached <= share:
                z = field.project(self.z - self._step * F_near, near)
                F = field.F(z)
                if np.isfinite(F).all():
                    self.z, self.F = z, F
                    if reached < 0.5 * share:
                        self._step *= self.options.growth
                    return True
                reached = np.inf
            self._step *= max(0.1, min(0.5, share / reached))  # Marcotte 1991 takes the smaller of the two
        return False


@register
class VIExtragradient(ProjectionSolver):
    """Korpelevich's method with the step length of Khobotov and Marcotte, which may grow again."""

    method = Extragradient
    spec: ClassVar[SolverSpec] = projection_spec(
        name="extragradient-vi",
        summary="extragradient with self-adaptive steps",
        citation=KORPELEVICH,
        options=ExtragradientOptions,
    )


@register
class QVIProjection(ProjectionSolver):
    """The same on a set that moves: each projection is on the set of the point before. It converges where the set
    moves little for how strongly monotone F is."""

    method = Extragradient
    spec: ClassVar[SolverSpec] = projection_spec(
        name="projection-qvi",
        summary="extragradient on the moving set, self-adaptive steps",
        citation="Chan and Pang 1982, Math. Oper. Res. 7:211; Noor 1988, Appl. Math. Lett. 1:367",
        node="qvi",
        options=ExtragradientOptions,
    )


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
