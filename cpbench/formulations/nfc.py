"""Frictional contact with nonlinear dynamics, Acary's P: F(v) = Hr, u = Hᵀv + w, contact law of `fc`."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from cpbench.formulations.base import (
    Point,
    Residuals,
    formulations,
    map_field,
    matrix_field,
    scaled,
    squared,
    vector_field,
)
from cpbench.formulations.contact import ContactProblem
from cpbench.formulations.expressions import Map
from cpbench.formulations.gfc import GlobalFrictionContact
from cpbench.foundation.factorization import Factorization
from cpbench.foundation.matrices import Dense, Matrix, Vector, norm

FREE_STEPS = 50
"""Newton steps to the motion without contact; the start is taken where they do not get there."""


@dataclass(frozen=True, eq=False)
class NFCPoint(Point):
    """v, shape (n,): velocities of the bodies; r, shape (nc·d,): reactions."""

    v: Vector
    r: Vector


@formulations.register("nfc")
@dataclass(frozen=True, eq=False, kw_only=True)
class NonlinearFrictionContact(ContactProblem):
    """F(v) = Hr, u = Hᵀv + w, K*_μ ∋ û ⟂ r ∈ K_μ at every contact.

    Measured as `gfc`: `dynamics` = ‖F(v) − Hr‖/max(‖Hr‖, f₀), `imbalance` = (‖F(v) − Hr‖/f₀)², and the contact errors
    with u := Hᵀv + w. Their scales are those of the problem linearized at the motion v₀ without contact, F(v₀) = 0.
    """

    node: ClassVar[str] = "nfc"
    title: ClassVar[str] = "frictional contact, nonlinear dynamics"
    equation: ClassVar[str] = "P"
    relations: ClassVar[tuple[str, ...]] = (
        "F(v) = Hr",
        "u = Hᵀv + w",
        "û = u + μ‖u_T‖e_N",
        "K*_μ ∋ û ⟂ r ∈ K_μ",
    )
    point_type: ClassVar[type[Point]] = NFCPoint
    rows_of: ClassVar[str] = "w"

    F: Map = map_field("n", "n")
    H: Matrix = matrix_field("n", "m")
    w: Vector = vector_field("m")
    mu: Vector = vector_field("nc")
    start: Vector = vector_field("n", fill=0.0)

    @property
    def point_sizes(self) -> dict[str, int]:
        return {"v": self.start.size, "r": self.w.size}

    def linearized(self, v: Vector) -> GlobalFrictionContact:
        """Linearize at the velocities v, shape (n,): F(v) + F′(v)(x − v) = Hr in place of F(x) = Hr: M = F′(v), f = Mv
        − F(v)."""
        M = self.F.jacobian(v)
        return GlobalFrictionContact(
            M=M, H=self.H, f=M @ v - self.F(v), w=self.w, mu=self.mu, dimension=self.dimension,
            sequence=self.sequence, contacts=self.contacts,
        )  # fmt: skip

    @cached_property
    def free_motion(self) -> Vector:
        """v₀."""
        v = self.start
        with np.errstate(all="ignore"):
            for _ in range(FREE_STEPS):
                force = self.F(v)
                jacobian = self.F.jacobian(v)
                if not np.isfinite(force).all() or not np.isfinite(jacobian.data).all():
                    return self.start
                factors = Factorization(jacobian)
                if factors.singular:
                    return self.start
                step = np.asarray(factors.solve(force))
                v = v - step
                if norm(step) <= 1e-12 * max(norm(v), 1e-300):
                    return v
        return self.start

    @cached_property
    def reference(self) -> GlobalFrictionContact:
        """The problem linearized at v₀, whose sizes are the scales."""
        return self.linearized(self.free_motion)

    @cached_property
    def mobility(self) -> Dense:
        return self.reference.mobility

    def slacks(self, point: NFCPoint) -> dict[str, Vector]:
        return {"u": self.H.T @ point.v + self.w}

    def residuals(self, point: NFCPoint, tolerance: float = 1e-6) -> Residuals:
        self.check_point(point)
        with np.errstate(all="ignore"):
            Hr = self.H @ point.r
            dynamics = norm(self.F(point.v) - Hr) if point.finite else np.inf
            impulse, _ = self.reference.units
            impulse = max(impulse, norm(self.reference.f))
            free = self.reference.free_velocity
            absolute = not (impulse or free.any())
            measured, parts, flags = self.contact_residuals(
                point.r, self.H.T @ point.v + self.w, free, tolerance, absolute=absolute
            )
            measured["dynamics"] = scaled(dynamics, norm(Hr), impulse) if impulse else dynamics
            measured["imbalance"] = squared(scaled(dynamics, impulse))
            parts["dynamics_absolute [N s]"] = dynamics
            return Residuals(measured, parts, flags)
