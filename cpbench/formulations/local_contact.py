"""Contact in terms of reactions, Acary's P_L, with the Delassus operator W: Coulomb's friction, rolling, an elliptic
cone, and with bilateral constraints that stay unknown (FCLIB local with V, R, s)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from cpbench.formulations.base import (
    Point,
    Residuals,
    Term,
    formulations,
    matrix_field,
    point_field,
    scaled,
    squared,
    vector_field,
)
from cpbench.formulations.contact import DelassusContact, FCPoint, LocalContact
from cpbench.formulations.sizes import least_squares
from cpbench.foundation import matrices
from cpbench.foundation.cones import Coulomb, Law
from cpbench.foundation.factorization import Factorization
from cpbench.foundation.matrices import Dense, Matrix, Vector, dense, freeze, norm


@formulations.register("fc")
@dataclass(frozen=True, eq=False, kw_only=True)
class FrictionContact(LocalContact):
    """u = Wr + q, and for every contact K*_μ ∋ û ⟂ r ∈ K_μ with û = u + μ‖u_T‖e_N (De Saxcé and Feng).

    Rows of a contact are consecutive, normal first: (N, T) for dimension 2, (N, T1, T2) for dimension 3.
    W need not be symmetric. Residuals: see :func:`cpbench.formulations.contact.contact_residuals`.
    """

    node: ClassVar[str] = "fc"
    core: ClassVar[bool] = True
    title: ClassVar[str] = "frictional contact, local"
    equation: ClassVar[str] = "P_L"
    relations: ClassVar[tuple[str, ...]] = ("u = Wr + q", "û = u + μ‖u_T‖e_N", "K*_μ ∋ û ⟂ r ∈ K_μ")
    point_type: ClassVar[type[Point]] = FCPoint
    no_slip: ClassVar[str] = (
        "with T its tangential rows, use fcm with mu = 0 there, V = W[:, T], R = W[T, T], s = q[T], whose lam is r_T; "
        "where no other contact has friction, mlcp with A = W[T, T], C = W[T, N], D = W[N, T], B = W[N, N]"
    )

    W: Matrix = matrix_field("m", "m")
    q: Vector = vector_field("m")
    mu: Vector = vector_field("nc")


@formulations.register("rfc")
@dataclass(frozen=True, eq=False, kw_only=True)
class RollingFrictionContact(LocalContact):
    """u = Wr + q; K = {‖r_T‖ ≤ μ r_N, ‖m‖ ≤ μ_r r_N}, K* ∋ û ⟂ r ∈ K with û = u + (μ‖u_T‖ + μ_r‖ω‖)e_N.

    Rows of a contact: (N, T1, T2, M1, M2) for dimension 5, (N, T, M) for dimension 3 (plane problems). The law
    is that of Acary and Bourrier, Coulomb friction with rolling resistance as a cone complementarity problem (2021).
    """

    node: ClassVar[str] = "rfc"
    title: ClassVar[str] = "rolling frictional contact, local"
    equation: ClassVar[str] = "P_L, rolling"
    relations: ClassVar[tuple[str, ...]] = (
        "u = Wr + q",
        "û = u + (μ‖u_T‖ + μ_r‖ω‖)e_N",
        "K* ∋ û ⟂ r ∈ K = {‖r_T‖ ≤ μ r_N, ‖m‖ ≤ μ_r r_N}",
    )
    point_type: ClassVar[type[Point]] = FCPoint
    dimensions: ClassVar[tuple[int, ...]] = (3, 5)

    W: Matrix = matrix_field("m", "m")
    q: Vector = vector_field("m")
    mu: Vector = vector_field("nc")
    mu_r: Vector = vector_field("nc")
    dimension: int = 5


@formulations.register("afc")
@dataclass(frozen=True, eq=False, kw_only=True)
class AnisotropicFrictionContact(LocalContact):
    """u = Wr + q, K = {‖(r₁/μ₁, r₂/μ₂)‖ ≤ r_N}, û = u + ‖(μ₁u₁, μ₂u₂)‖e_N, K* ∋ û ⟂ r ∈ K: associated slip.

    `mu` has shape (nc, 2). With S = diag(1, μ₁, μ₂) a contact and r = Sr′, u′ = Su, the law is Coulomb's with μ = 1 in
    (r′, u′); answers are measured there, where the projection on the cone has a formula. Where a μ_i is 0, r_i is 0 and
    may be no larger than rounding: it is divided by 1e-12 of the other coefficient.
    """

    node: ClassVar[str] = "afc"
    title: ClassVar[str] = "anisotropic frictional contact, local"
    equation: ClassVar[str] = "P_L, elliptic cone"
    relations: ClassVar[tuple[str, ...]] = (
        "u = Wr + q",
        "û = u + ‖(μ₁u₁, μ₂u₂)‖e_N",
        "K* ∋ û ⟂ r ∈ K = {‖(r₁/μ₁, r₂/μ₂)‖ ≤ r_N}",
    )
    point_type: ClassVar[type[Point]] = FCPoint
    dimensions: ClassVar[tuple[int, ...]] = (3,)

    W: Matrix = matrix_field("m", "m")
    q: Vector = vector_field("m")
    mu: Dense = matrix_field("nc", "2")

    @cached_property
    def friction(self) -> Dense:
        """`mu` as an array (nc, 2), however it is stored."""
        return dense(self.mu)

    @property
    def law(self) -> Law:
        return Coulomb(np.ones(self.nc))

    @cached_property
    def scaling(self) -> Vector:
        """Diagonal of S, shape (3nc,)."""
        return freeze(np.column_stack([np.ones(self.nc), self.friction]).ravel())

    @cached_property
    def divisor(self) -> Vector:
        """S where it is not 0, and what reactions are divided by where it is, shape (3nc,)."""
        least = 1e-12 * np.maximum(self.friction.max(axis=1, initial=0.0), 1e-6)
        return freeze(np.where(self.scaling > 0.0, self.scaling, np.repeat(least, 3)))

    @cached_property
    def mobility(self) -> Dense:
        """Diagonal of SWS, shape (nc, 3)."""
        return freeze(np.einsum("cii->ci", self.diagonal_blocks) * self.scaling.reshape(-1, 3) ** 2)

    def measure(self, point: FCPoint, tolerance: float) -> Residuals:
        S, u, r = self.scaling, self.W @ point.r + self.q, point.r / self.divisor
        return Residuals(*self.contact_residuals(r, S * u, S * self.q, tolerance, absolute=not self.q.any()))


@dataclass(frozen=True, eq=False)
class FCMPoint(Point):
    """r, shape (nc·d,): reactions of the contacts; lam, shape (p,): reactions λ of the bilateral constraints."""

    r: Vector = point_field("m")
    lam: Vector = point_field("p")


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

    def measure(self, point: FCMPoint, tolerance: float) -> Residuals:
        Vr, Rl = self.V.T @ point.r, self.R @ point.lam
        u = self.W @ point.r + self.V @ point.lam + self.q
        constraint = norm(Vr + Rl + self.s)
        absolute = not (self.q.any() or self.s.any())
        measured, parts, flags = self.contact_residuals(point.r, u, self.free_velocity, tolerance, absolute=absolute)
        unit = 0.0 if absolute else self.drift_unit
        measured["constraint"] = constraint if unit == 0 else scaled(constraint, norm(Vr), norm(Rl), unit)
        measured["drift"] = squared(scaled(constraint, unit))
        parts["constraint_absolute [m/s]"] = constraint
        return Residuals(measured, parts, flags)
