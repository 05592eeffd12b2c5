"""What the global contact nodes share: dynamics, bilateral constraints, and how their answers are measured."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from cpbench import matrices
from cpbench.formulations.base import Point, Residuals, scaled
from cpbench.formulations.contact import ContactProblem, contact_residuals, natural_rho
from cpbench.matrices import Factorization, Matrix, Vector, norm


@dataclass(frozen=True, eq=False)
class GFCPoint(Point):
    """v, shape (n,): velocities of the bodies; r, shape (nc·d,): reactions; lam, shape (p,): joint reactions λ."""

    v: Vector
    r: Vector
    lam: Vector = field(default_factory=lambda: np.zeros(0))


class _HasDynamics:
    M: Matrix
    H: Matrix
    G: Matrix
    f: Vector
    w: Vector
    b: Vector


@dataclass(frozen=True, eq=False, kw_only=True)
class GlobalContact(_HasDynamics, ContactProblem):
    """Mv = Hr + Gλ + f, Gᵀv + b = 0, u = Hᵀv + w and a contact law.

    Judged: `dynamics` = ‖Mv − Hr − Gλ − f‖/max(‖Mv‖, ‖Hr‖, ‖Gλ‖, ‖f‖), `constraint` = ‖Gᵀv + b‖/max(‖Gᵀv‖, ‖b‖)
    where there is a G, and the contact errors with u := Hᵀv + w and ρ_c = d/tr(H_cᵀM⁻¹H_c); all absolute when
    f, w and b are 0.
    """

    rows_of: ClassVar[str] = "w"

    @property
    def point_sizes(self) -> dict[str, int]:
        return {"v": self.f.size, "r": self.w.size, "lam": self.b.size}

    @cached_property
    def factorization(self) -> Factorization:
        """LU of M."""
        return Factorization(self.M)

    @cached_property
    def saddle(self) -> Factorization:
        """LU of K = [[M, −G], [Gᵀ, 0]], the equations of v and λ for given r; that of M where G is empty."""
        if not self.b.size:
            return self.factorization
        corner = matrices.zeros(self.b.size, self.b.size, self.G)
        return Factorization(matrices.block([[self.M, -self.G], [matrices.transpose(self.G), corner]]))

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
        """u for r = 0, which is q of the local form: the scale of the contact errors.

        w + [Hᵀ 0] K⁻¹ [f; −b]; without the constraints where K is singular, w alone where M is.
        """
        if not self.saddle.singular:
            v = self.saddle.solve(np.concatenate([self.f, -self.b]))[: self.f.size]
        elif not self.factorization.singular:
            v = self.factorization.solve(self.f)
        else:
            return self.w
        return matrices.freeze(self.H.T @ v + self.w)

    def slacks(self, point: GFCPoint) -> dict[str, Vector]:
        return {"u": self.H.T @ point.v + self.w}

    def residuals(self, point: GFCPoint, tolerance: float = 1e-6) -> Residuals:
        self.check_point(point)
        with np.errstate(all="ignore"):
            Mv, Hr, Gl = self.M @ point.v, self.H @ point.r, self.G @ point.lam
            Hv, Gv = self.H.T @ point.v, self.G.T @ point.v
            dynamics, constraint = norm(Mv - Hr - Gl - self.f), norm(Gv + self.b)
            absolute = not (self.f.any() or self.w.any() or self.b.any())
            judged, parts, flags = contact_residuals(
                point.r, Hv + self.w, self.free_velocity, self.law, self.rho, tolerance, absolute=absolute
            )
            judged["dynamics"] = dynamics if absolute else scaled(dynamics, *map(norm, (Mv, Hr, Gl, self.f)))
            parts["dynamics_absolute [N s]"] = dynamics
            if self.b.size:
                judged["constraint"] = constraint if absolute else scaled(constraint, norm(Gv), norm(self.b))
                parts["constraint_absolute [m/s]"] = constraint
            return Residuals(judged, parts, flags)
