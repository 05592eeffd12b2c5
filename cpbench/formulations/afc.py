"""Frictional contact with an elliptic cone: another coefficient along each of the two tangents."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from cpbench.errors import ProblemError
from cpbench.formulations.base import Point, Residuals, formulations, matrix_field, vector_field
from cpbench.formulations.contact import FCPoint, LocalContact
from cpbench.foundation.cones import Coulomb, Law
from cpbench.foundation.matrices import Dense, Matrix, Vector, dense, freeze


@formulations.register("afc")
@dataclass(frozen=True, eq=False, kw_only=True)
class AnisotropicFrictionContact(LocalContact):
    """u = Wr + q, K = {‖(r₁/μ₁, r₂/μ₂)‖ ≤ r_N}, û = u + ‖(μ₁u₁, μ₂u₂)‖e_N, K* ∋ û ⟂ r ∈ K: associated slip.

    `mu` has shape (nc, 2), positive. With S = diag(1, μ₁, μ₂) a contact and r = Sr′, u′ = Su, the law is
    Coulomb's with μ = 1 in (r′, u′); answers are measured there, where the projection on the cone has a formula.
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

    def check(self) -> None:
        super().check()
        if not (self.friction > 0).all():
            i = int(np.argwhere(~(self.friction > 0))[0][0])
            raise ProblemError(
                "afc.mu",
                f"is 0 at contact {i}: an elliptic cone needs two positive coefficients, fc takes one that is 0",
            )

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
    def mobility(self) -> Dense:
        """Diagonal of SWS, shape (nc, 3)."""
        return freeze(np.einsum("cii->ci", self.diagonal_blocks) * self.scaling.reshape(-1, 3) ** 2)

    def residuals(self, point: FCPoint, tolerance: float = 1e-6) -> Residuals:
        self.check_point(point)
        with np.errstate(all="ignore"):
            S, u = self.scaling, self.W @ point.r + self.q
            return Residuals(
                *self.contact_residuals(point.r / S, S * u, S * self.q, tolerance, absolute=not self.q.any())
            )
