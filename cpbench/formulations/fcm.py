"""Frictional contact in local mixed form (FCLIB local with V, R, s): bilateral constraints stay unknown beside r."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from cpbench.formulations.base import Point, Residuals, Term, formulations, matrix_field, scaled, squared, vector_field
from cpbench.formulations.contact import DelassusContact
from cpbench.formulations.sizes import least_squares
from cpbench.foundation import matrices
from cpbench.foundation.factorization import Factorization
from cpbench.foundation.matrices import Dense, Matrix, Vector, norm


@dataclass(frozen=True, eq=False)
class FCMPoint(Point):
    """r, shape (nc·d,): reactions of the contacts; lam, shape (p,): reactions λ of the bilateral constraints."""

    r: Vector
    lam: Vector


@formulations.register("fcm")
@dataclass(frozen=True, eq=False, kw_only=True)
class MixedFrictionContact(DelassusContact):
    """u = Wr + Vλ + q, Vᵀr + Rλ + s = 0, K*_μ ∋ û ⟂ r ∈ K_μ at every contact.

    Measured: the contact errors with u recomputed and q − VR⁺s for q; `constraint` = ‖e‖/max(‖Vᵀr‖, ‖Rλ‖, ‖s‖, ‖e₀‖),
    e = Vᵀr + Rλ + s; and `drift` = (‖e‖/max(‖s‖, ‖e₀‖))², which reactions that cancel cannot make small. e₀ = |Vᵀ|r₀
    with the reactions r₀ = ρ|q − VR⁺s| that the free velocities ask for: s alone is 0 in a problem without drift.
    Absolute when q and s are 0.
    """

    node: ClassVar[str] = "fcm"
    title: ClassVar[str] = "frictional contact, local mixed"
    equation: ClassVar[str] = "P_L, mixed"
    relations: ClassVar[tuple[str, ...]] = (
        "u = Wr + Vλ + q",
        "Vᵀr + Rλ + s = 0",
        "û = u + μ‖u_T‖e_N",
        "K*_μ ∋ û ⟂ r ∈ K_μ",
    )
    point_type: ClassVar[type[Point]] = FCMPoint
    terms: ClassVar[tuple[Term, ...]] = (
        ("q", 1, "W", "r"),
        ("q", 1, "V", "lam"),
        ("s", 1, "Vᵀ", "r"),
        ("s", 1, "R", "lam"),
    )

    W: Matrix = matrix_field("m", "m")
    V: Matrix = matrix_field("m", "p")
    R: Matrix = matrix_field("p", "p")
    q: Vector = vector_field("m")
    s: Vector = vector_field("p")
    mu: Vector = vector_field("nc")

    @property
    def point_sizes(self) -> dict[str, int]:
        return {"r": self.q.size, "lam": self.s.size}

    @cached_property
    def factorization(self) -> Factorization:
        """LU of R."""
        return Factorization(self.R)

    @cached_property
    def pseudo_inverse(self) -> Dense:
        """R⁺, dense, with the rank of an R known to about 12 digits."""
        return matrices.freeze(np.linalg.pinv(matrices.dense(self.R), rcond=1e-12))

    @cached_property
    def free_velocity(self) -> Vector:
        """q − VR⁻¹s, the velocities for r = 0: the scale of the contact errors (R⁺s where R is singular)."""
        R, s = self.factorization, self.s
        lam = least_squares(self.R, s) if R.singular and s.size else R.solve(s)
        return matrices.freeze(self.q - self.V @ lam)

    @cached_property
    def drift_unit(self) -> float:
        """max(‖s‖, ‖e₀‖)."""
        return max(norm(self.s), norm(abs(self.V).T @ (self.effective_mass * np.abs(self.free_velocity))))

    def slacks(self, point: FCMPoint) -> dict[str, Vector]:
        return {"u": self.W @ point.r + self.V @ point.lam + self.q}

    def residuals(self, point: FCMPoint, tolerance: float = 1e-6) -> Residuals:
        self.check_point(point)
        with np.errstate(all="ignore"):
            Vr, Rl = self.V.T @ point.r, self.R @ point.lam
            u = self.W @ point.r + self.V @ point.lam + self.q
            constraint = norm(Vr + Rl + self.s)
            absolute = not (self.q.any() or self.s.any())
            measured, parts, flags = self.contact_residuals(
                point.r, u, self.free_velocity, tolerance, absolute=absolute
            )
            unit = 0.0 if absolute else self.drift_unit
            measured["constraint"] = constraint if unit == 0 else scaled(constraint, norm(Vr), norm(Rl), unit)
            measured["drift"] = squared(scaled(constraint, unit))
            parts["constraint_absolute [m/s]"] = constraint
            return Residuals(measured, parts, flags)
