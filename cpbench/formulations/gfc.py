"""Frictional contact in global form, Acary's P_LM: Mv = Hr + f, u = Hᵀv + w with the contact law of `fc`."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from cpbench import matrices
from cpbench.formulations.base import (
    Contacts,
    Point,
    Problem,
    Residuals,
    Sequence,
    formulations,
    matrix_field,
    scaled,
    vector_field,
)
from cpbench.formulations.fc import check_contacts, contact_residuals, natural_rho
from cpbench.matrices import Factorization, Matrix, Vector, norm


@dataclass(frozen=True, eq=False)
class GFCPoint(Point):
    """v, shape (n,): velocities of the bodies; r, shape (nc·d,): reactions."""

    v: Vector
    r: Vector


@formulations.register("gfc")
@dataclass(frozen=True, eq=False, kw_only=True)
class GlobalFrictionContact(Problem):
    """Mv = Hr + f, u = Hᵀv + w, K*_μ ∋ û ⟂ r ∈ K_μ at every contact.

    Judged: `dynamics` = ‖Mv − Hr − f‖/max(‖Mv‖, ‖Hr‖, ‖f‖), and the contact errors of `fc` with
    u := Hᵀv + w and ρ_c = d/tr(H_cᵀM⁻¹H_c); all absolute when f and w are 0.
    """

    node: ClassVar[str] = "gfc"
    title: ClassVar[str] = "frictional contact, global"
    equation: ClassVar[str] = "P_LM"
    point_type: ClassVar[type[Point]] = GFCPoint

    M: Matrix = matrix_field("n", "n")
    H: Matrix = matrix_field("n", "m")
    f: Vector = vector_field("n")
    w: Vector = vector_field("m")
    mu: Vector = vector_field("nc")
    dimension: int = 3
    sequence: Sequence | None = None
    contacts: Contacts | None = None

    def check(self) -> None:
        check_contacts(self.node, self.dimension, self.w.size, self.mu, "w", self.contacts)

    @property
    def nc(self) -> int:
        return self.mu.size

    @property
    def point_sizes(self) -> dict[str, int]:
        return {"v": self.f.size, "r": self.w.size}

    @cached_property
    def factorization(self) -> Factorization:
        """LU of M, shared by the residuals, the Delassus conversion and its lift."""
        return Factorization(self.M)

    @cached_property
    def rho(self) -> Vector:
        """ρ_c = d / tr(H_cᵀM⁻¹H_c); 1 where M is singular or the trace is not positive."""
        if self.factorization.singular or self.nc == 0:
            return matrices.freeze(np.ones(self.nc))
        diagonal = np.empty(self.w.size)
        columns: Any = matrices.sparse(self.H).tocsc() if matrices.is_sparse(self.H) else self.H
        for start in range(0, self.w.size, 512):  # bounded memory: M⁻¹H is dense
            chunk = matrices.dense(columns[:, start : start + 512])
            diagonal[start : start + 512] = np.einsum("ij,ij->j", chunk, self.factorization.solve(chunk))
        return natural_rho(diagonal.reshape(self.nc, -1).sum(axis=1), self.dimension)

    @cached_property
    def free_velocity(self) -> Vector:
        """q = HᵀM⁻¹f + w of the local form (w alone where M is singular): the scale of the contact errors."""
        if self.factorization.singular:
            return self.w
        return matrices.freeze(self.H.T @ self.factorization.solve(self.f) + self.w)

    def slacks(self, point: GFCPoint) -> dict[str, Vector]:
        return {"u": self.H.T @ point.v + self.w}

    def residuals(self, point: GFCPoint, tolerance: float = 1e-6) -> Residuals:
        self.check_point(point)
        with np.errstate(all="ignore"):
            Mv, Hr = self.M @ point.v, self.H @ point.r
            Hv = self.H.T @ point.v
            dynamics = norm(Mv - Hr - self.f)
            absolute = not (self.f.any() or self.w.any())
            judged, parts, flags = contact_residuals(
                point.r, Hv + self.w, self.free_velocity, self.mu, self.rho, tolerance, absolute=absolute
            )
            judged["dynamics"] = dynamics if absolute else scaled(dynamics, norm(Mv), norm(Hr), norm(self.f))
            parts["dynamics_absolute [N s]"] = dynamics
            return Residuals(judged, parts, flags)
