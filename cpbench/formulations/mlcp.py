"""Mixed linear complementarity problem, equation (14): Au + Cv + a = 0, 0 ≤ v ⟂ Du + Bv + b ≥ 0, u free."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from cpbench.formulations.base import (
    Point,
    Problem,
    Residuals,
    Term,
    formulations,
    matrix_field,
    scaled,
    vector_field,
)
from cpbench.formulations.lcp import unit_free_complementarity
from cpbench.foundation.factorization import Factorization
from cpbench.foundation.matrices import Matrix, Vector, max_abs, norm


@dataclass(frozen=True, eq=False)
class MLCPPoint(Point):
    """u (free), shape (n,); v (nonnegative), shape (m,)."""

    u: Vector
    v: Vector


@formulations.register("mlcp")
@dataclass(frozen=True, eq=False, kw_only=True)
class MLCP(Problem):
    """Au + Cv + a = 0, 0 ≤ v ⟂ w = Du + Bv + b ≥ 0.

    Measured: `natural` = ‖(Au+Cv+a, min(v, w))‖₂/‖(a, b)‖₂; `unit_free`, as for the LCP; `equality` =
    ‖Au+Cv+a‖/max(‖a‖, ‖Au‖, ‖Cv‖). Among the parts, `siconos_mlcp` is Siconos' mlcp_compute_error for one
    block of equalities.
    """

    node: ClassVar[str] = "mlcp"
    core: ClassVar[bool] = True
    title: ClassVar[str] = "mixed linear complementarity problem"
    equation: ClassVar[str] = "(14)"
    relations: ClassVar[tuple[str, ...]] = ("Au + Cv + a = 0", "0 ≤ v ⟂ w = Du + Bv + b ≥ 0")
    point_type: ClassVar[type[Point]] = MLCPPoint
    terms: ClassVar[tuple[Term, ...]] = (("a", 1, "A", "u"), ("a", 1, "C", "v"), ("b", 1, "D", "u"), ("b", 1, "B", "v"))

    A: Matrix = matrix_field("n", "n")
    B: Matrix = matrix_field("m", "m")
    C: Matrix = matrix_field("n", "m")
    D: Matrix = matrix_field("m", "n")
    a: Vector = vector_field("n")
    b: Vector = vector_field("m")

    @property
    def point_sizes(self) -> dict[str, int]:
        return {"u": self.a.size, "v": self.b.size}

    @cached_property
    def v_unit(self) -> float:
        """The least size of a v that can balance b, ‖b‖∞/max|B|; without b or B, the same for a and C.

        Not the larger of both: with a large a and a weak C, v has nothing to do with a/C, and would not be measured.
        """
        for x, X in ((self.b, self.B), (self.a, self.C)):
            if (top := max_abs(x)) > 0 and (size := max_abs(X)) > 0:
                return top / size
        return max_abs(self.b)

    @cached_property
    def equality_scale(self) -> float:
        """Effect of v_unit on the equalities: their scale where a = 0, or u = 1e-12 for 0 would be 100 % wrong."""
        return max_abs(self.C) * self.v_unit

    @cached_property
    def factorization(self) -> Factorization:
        """LU of A, shared by the test for singularity, the Schur complement and its lift."""
        return Factorization(self.A)

    def slacks(self, point: MLCPPoint) -> dict[str, Vector]:
        return {"w": self.D @ point.u + self.B @ point.v + self.b}

    def residuals(self, point: MLCPPoint, tolerance: float = 1e-6) -> Residuals:
        self.check_point(point)
        with np.errstate(all="ignore"):
            v = point.v
            Au, Cv = self.A @ point.u, self.C @ v
            Du, Bv = self.D @ point.u, self.B @ v
            equality = Au + Cv + self.a
            w = Du + Bv + self.b
            natural = norm(np.concatenate([equality, np.minimum(v, w)]))
            data = norm(np.concatenate([self.a, self.b]))
            return Residuals(
                measured={
                    "natural": scaled(natural, data),
                    "unit_free": natural
                    if data == 0.0
                    else unit_free_complementarity(
                        v, w, max(max_abs(v), self.v_unit), max(max_abs(self.b), max_abs(Du), max_abs(Bv))
                    ),
                    "equality": norm(equality)
                    if data == 0.0
                    else scaled(norm(equality), norm(self.a) or self.equality_scale, norm(Au), norm(Cv)),
                },
                parts={
                    "natural_absolute": natural,
                    "equality_absolute": norm(equality),
                    "min_v": float(v.min(initial=0.0)),
                    "min_w": float(w.min(initial=0.0)),
                    "complementarity": float(abs(v @ w)),
                    "siconos_mlcp": _siconos_error(equality, v, w, self.a),
                },
                flags=() if data > 0 else ("absolute",),
            )

    def certifies_infeasibility(self, certificate: Vector) -> bool:
        """Return whether (y, z) is a proof of Farkas: z ≥ 0, Aᵀy + Dᵀz = 0, Cᵀy + Bᵀz ≤ 0, aᵀy + bᵀz < 0 exclude every
        u, v ≥ 0 with Au + Cv + a = 0 and Du + Bv + b ≥ 0 (to rounding: 1e-12 of each column by itself)."""
        n = self.a.size
        if certificate.size != n + self.b.size or not np.isfinite(certificate).all() or not certificate.any():
            return False
        top = max_abs(certificate)
        y, z = certificate[:n] / top, np.maximum(certificate[n:], 0.0) / top
        by_u = self.A.T @ y + self.D.T @ z
        by_v = self.C.T @ y + self.B.T @ z
        u_rounding = 1e-12 * (abs(self.A).T @ abs(y) + abs(self.D).T @ z)
        v_rounding = 1e-12 * (abs(self.C).T @ abs(y) + abs(self.B).T @ z)
        gap, terms = self.a @ y + self.b @ z, abs(self.a) @ abs(y) + abs(self.b) @ z
        return bool((abs(by_u) <= u_rounding).all() and (by_v <= v_rounding).all() and gap < -1e-9 * max(terms, 1e-300))


def _siconos_error(equality: Vector, v: Vector, w: Vector, a: Vector) -> float:
    """Return mlcp_compute_error: the worse of the equality and the complementarity part, each over 1 + (1 + scale).

    The scale of the complementarity part is Σ‖w‖ of the answer, not of the data, as in Siconos 4.4.
    """
    e_eq = norm(equality)
    same_sign = ((v > 0) & (w > 0)) | ((v < 0) & (w < 0))
    e_ineq = float((np.maximum(-v, 0) + np.maximum(-w, 0) + np.where(same_sign, v * w, 0.0)).sum())
    n_eq, n_ineq = 1.0 + norm(a), 1.0 + norm(w)
    return e_ineq / (1.0 + n_ineq) if e_ineq / n_ineq >= e_eq / n_eq else e_eq / (1.0 + n_eq)
