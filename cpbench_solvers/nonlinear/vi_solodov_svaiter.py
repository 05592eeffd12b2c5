"""Hyperplane projection of Solodov and Svaiter (1999): a plane that separates z from all solutions, then P_S∩H(z)."""

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
    projection_spec,
)

SHORTER, LONGER = 0.5, 1.5
"""Factors of γ: where the line search had to halve, and where it took the whole step."""
WIDENING, CLOSENESS = 16.0, 1.1
"""t is sought by this factor, then down to this one: it may be 10⁶ times the t of the plane alone."""


@dataclass(frozen=True)
class HyperplaneOptions(VIProjectionOptions):
    """Options of solodov-svaiter. `sigma` : share of the decrease that the line search asks for."""

    sigma: float = 0.3


class _Hyperplane(ProjectionMethod):
    """r = z − P_S(z − γF(z)); y = z − ηr with η = 1, ½, … such that F(y)ᵀr ≥ σ‖r‖²/γ; then z⁺ = P_S∩H(z) with
    H = {x : F(y)ᵀ(x − y) ≤ 0}. Needs F monotone and continuous, not Lipschitz.

    On a curved boundary F is nearly normal to r, so that F(y)ᵀr, about ‖r‖²/γ, is lost in rounding where ‖r‖ is about
    the square root of that of ‖F‖‖z‖: smaller errors are not reached there."""

    options: HyperplaneOptions

    def begin(self, z: Vector, F: Vector) -> None:
        self.z, self.F = z, F
        self._step = self.field.first_step(z, F)

    def step(self) -> bool:
        r = self.z - self.field.project(self.z - self._step * self.F, self.z)
        if not r.any():  # γF is lost in the rounding of z
            return False
        asked = self.options.sigma * float(r @ r) / self._step
        eta = 1.0
        for halved in range(SHRINKS):
            y = self.z - eta * r
            F_y = self.field.F(y)
            if np.isfinite(F_y).all() and float(F_y @ r) >= asked:
                z = self._nearest(F_y, y)
                F = self.field.F(z)
                if not np.isfinite(F).all():
                    return False
                self._step *= SHORTER if halved else LONGER
                self.z, self.F = z, F
                return True
            eta *= 0.5
        return False

    def _nearest(self, a: Vector, y: Vector) -> Vector:
        """Return P_S(z − ta) for a t ≥ 0 just below the root of aᵀ(P_S(z − ta) − y), which falls with t; at the root
        it is P_S∩H(z). From below, ‖z⁺ − x*‖² ≤ ‖z − x*‖² − ‖z⁺ − z‖² holds for every solution x* without the root
        being exact; the t that takes z to H, as if S were the whole space, is below it."""

        def moved(t: float) -> Vector:
            return self.field.project(self.z - t * a, self.z)

        low = high = float(a @ (self.z - y)) / float(a @ a)
        nearest = moved(low)
        for _ in range(SHRINKS):
            high *= WIDENING
            trial = moved(high)
            if float(a @ (trial - y)) < 0.0:
                break
            low, nearest = high, trial
        while high > CLOSENESS * low:
            middle = float(np.sqrt(low * high))
            trial = moved(middle)
            if float(a @ (trial - y)) < 0.0:
                high = middle
            else:
                low, nearest = middle, trial
        return nearest


@register
class VISolodovSvaiter(ProjectionSolver):
    """Every step comes nearer to every solution of a monotone problem; the step of the trial adapts."""

    method = _Hyperplane
    spec: ClassVar[SolverSpec] = projection_spec(
        name="solodov-svaiter",
        summary="hyperplane projection, projected on S and the half space at once",
        citation="Solodov and Svaiter 1999, SIAM J. Control Optim. 37:765",
        options=HyperplaneOptions,
    )
