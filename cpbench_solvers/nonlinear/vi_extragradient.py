"""Extragradient: a trial step gives the direction of the real one; for sets that stay, and for sets that move."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cpbench.foundation.matrices import Vector
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


@dataclass(frozen=True)
class ExtragradientOptions(VIProjectionOptions):
    """Options of the methods here. `share` : the largest γL, below 1. `growth` : of γ after a much shorter step."""

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
