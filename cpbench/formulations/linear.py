"""Problems with an affine map: linear complementarity (Acary's equation (13)), mixed (14), relays, and affine
variational inequalities over a polyhedron with bounds."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from cpbench.formulations.base import (
    Point,
    Problem,
    Residuals,
    Term,
    formulations,
    matrix_field,
    point_field,
    scaled,
    vector_field,
)
from cpbench.formulations.sizes import (
    box_residuals,
    check_bounds,
    largest_in_box,
    least,
    own_scale,
    ratio,
    row_sizes,
    top,
)
from cpbench.foundation import matrices
from cpbench.foundation.cones import box_defect, project_box
from cpbench.foundation.factorization import Factorization
from cpbench.foundation.matrices import Matrix, Vector, max_abs, norm


class _HasMap:
    """Declared by the nodes, in the order of their data."""

    M: Matrix


@dataclass(frozen=True, eq=False, kw_only=True)
class AffineProblem(_HasMap, Problem):
    """A problem in terms of Mz + q."""

    @cached_property
    def symmetric(self) -> bool:
        """M = Mᵀ (matrices.is_symmetric)."""
        return matrices.is_symmetric(self.M)

    @cached_property
    def monotone(self) -> bool:
        """M + Mᵀ positive semidefinite (matrices.is_psd): the solution set is convex, and not empty if feasible."""
        return matrices.is_psd(self.M)


@dataclass(frozen=True, eq=False)
class LCPPoint(Point):
    """z, shape (n,)."""

    z: Vector = point_field("n")


@formulations.register("lcp")
@dataclass(frozen=True, eq=False, kw_only=True)
class LCP(AffineProblem):
    """0 ≤ z ⟂ Mz + q ≥ 0.

    Residuals (both measured): `natural` = ‖min(z, w)‖₂/‖q‖₂, Siconos' lcp_compute_error, and `unit_free` =
    ‖min(z/max(‖z‖∞, ‖q‖∞/max|M|), w/max(‖q‖∞, ‖Mz‖∞))‖₂, which does not change with the units of z or w. Without
    ‖q‖∞/max|M|, the size of a z that could balance q, an answer a rounding error away from z = 0 would have error 1.
    """

    node: ClassVar[str] = "lcp"
    core: ClassVar[bool] = True
    title: ClassVar[str] = "linear complementarity problem"
    equation: ClassVar[str] = "(13)"
    relations: ClassVar[tuple[str, ...]] = ("0 ≤ z ⟂ w = Mz + q ≥ 0",)
    point_type: ClassVar[type[Point]] = LCPPoint
    terms: ClassVar[tuple[Term, ...]] = (("q", 1, "M", "z"),)

    M: Matrix = matrix_field("n", "n")
    q: Vector = vector_field("n")

    @cached_property
    def z_unit(self) -> float:
        """‖q‖∞/max|M|, the least size of a z that can balance q (‖q‖∞ for M = 0)."""
        return max_abs(self.q) / (max_abs(self.M) or 1.0)

    def slacks(self, point: LCPPoint) -> dict[str, Vector]:
        return {"w": self.M @ point.z + self.q}

    def measure(self, point: LCPPoint, tolerance: float) -> Residuals:
        z, Mz = point.z, self.M @ point.z
        w = Mz + self.q
        natural, size, largest = norm(np.minimum(z, w)), norm(self.q), max_abs(self.q)
        return Residuals(
            measured={
                "natural": scaled(natural, size),
                "unit_free": natural
                if not largest
                else unit_free_complementarity(z, w, max(max_abs(z), self.z_unit), max(largest, max_abs(Mz))),
            },
            parts={
                "natural_absolute": natural,
                "min_z": float(z.min(initial=0.0)),
                "min_w": float(w.min(initial=0.0)),
                "complementarity": float(abs(z @ w)),
            },
            flags=() if size > 0 else ("absolute",),
        )

    def certifies_infeasibility(self, certificate: Vector) -> bool:
        """Return whether y is a proof of Farkas: y ≥ 0, Mᵀy ≤ 0, qᵀy < 0 exclude every z ≥ 0 with Mz + q ≥ 0 (to
        rounding: 1e-12)."""
        y = np.maximum(certificate, 0.0)
        if y.size != self.q.size or not np.isfinite(y).all() or not y.any():
            return False
        y = y / y.max()
        My = self.M.T @ y
        rounding = 1e-12 * (abs(self.M).T @ y)  # of each column by itself: a small column may decide
        return bool((My <= rounding).all() and self.q @ y < -1e-9 * max(max_abs(self.q), 1e-300))


def unit_free_complementarity(z: Vector, w: Vector, z_scale: float, w_scale: float) -> float:
    """Return ‖min(z/z_scale, w/w_scale)‖₂ with 0/0 = 0; z and w (n,), the scales are numbers, the result has no
    unit."""
    return norm(np.minimum(z / z_scale if z_scale > 0 else z, w / w_scale if w_scale > 0 else w))


@dataclass(frozen=True, eq=False)
class MLCPPoint(Point):
    """u (free), shape (n,); v (nonnegative), shape (m,)."""

    u: Vector = point_field("n")
    v: Vector = point_field("m")


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

    def measure(self, point: MLCPPoint, tolerance: float) -> Residuals:
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


@formulations.register("relay")
@dataclass(frozen=True, eq=False, kw_only=True)
class Relay(AffineProblem):
    """w = Mz + q, lb ≤ z ≤ ub finite: w ≥ 0 where z = lb, w ≤ 0 where z = ub, w = 0 between, any w where lb = ub.

    Measured: `natural` = ‖z − P_[lb,ub](z − w)‖/(1 + ‖q‖), and `unit_free`, the same with z and w over their own sizes:
    max(‖z‖∞, z_unit) and max(‖q‖∞, ‖Mz‖∞, max|M| z_unit), over the unknowns that can move.
    """

    node: ClassVar[str] = "relay"
    title: ClassVar[str] = "relay problem"
    equation: ClassVar[str] = "(22), affine over a box"
    relations: ClassVar[tuple[str, ...]] = ("w = Mz + q", "lb ≤ z ≤ ub", "−w ∈ N_[lb,ub](z)")
    point_type: ClassVar[type[Point]] = LCPPoint
    terms: ClassVar[tuple[Term, ...]] = (("q", 1, "M", "z"),)

    M: Matrix = matrix_field("n", "n")
    q: Vector = vector_field("n")
    lb: Vector = vector_field("n")
    ub: Vector = vector_field("n")

    def check(self) -> None:
        check_bounds(self.node, self.lb, self.ub)

    @cached_property
    def moving(self) -> NDArray[np.bool_]:
        """Whether lb < ub, so that the unknown is not fixed, shape (n,)."""
        return self.lb < self.ub

    @cached_property
    def z_unit(self) -> float:
        """The lesser of ‖q‖∞/max|M|, a z that balances q, and the largest z in the box.

        Bounds alone would not do: a bound of 1e20 stands for none. Nor would q: forces may be beyond any z allowed.
        """
        box = largest_in_box(self.lb, self.ub, self.moving)
        return least(ratio(top(self.q, self.moving), max_abs(self.M)), box)

    def slacks(self, point: LCPPoint) -> dict[str, Vector]:
        return {"w": self.M @ point.z + self.q}

    def measure(self, point: LCPPoint, tolerance: float) -> Residuals:
        z, Mz = point.z, self.M @ point.z
        w = Mz + self.q
        natural = norm(box_defect(z, w, self.lb, self.ub))
        z_scale = own_scale(max(top(z, self.moving), self.z_unit), self.lb, self.moving)
        w_scale = max(top(self.q, self.moving), top(Mz, self.moving), max_abs(self.M) * self.z_unit)
        return Residuals(
            measured={
                "natural": natural / (1.0 + norm(self.q)),
                "unit_free": box_residuals(z, w, self.lb, self.ub, z_scale, w_scale),
            },
            parts={
                "natural_absolute": natural,
                "infeasibility": norm(z - project_box(z, self.lb, self.ub)),
            },
        )


@dataclass(frozen=True, eq=False)
class AVIPoint(Point):
    """z (n,), λ ≥ 0 of Az ≥ b (m,), μ of Cz = d (k,)."""

    z: Vector = point_field("n")
    lam: Vector = point_field("m", optional=True)
    mu: Vector = point_field("k", optional=True)


@formulations.register("avi")
@dataclass(frozen=True, eq=False, kw_only=True)
class AVI(AffineProblem):
    """X = {z : Az ≥ b, Cz = d, lb ≤ z ≤ ub}, each part of which may be left out; −(Mz + q) ∈ N_X(z).

    With multipliers: F = Mz + q − Aᵀλ − Cᵀμ satisfies z = P_[lb,ub](z − F), 0 ≤ λ ⟂ Az − b ≥ 0, Cz = d; for a box
    alone that is the natural map. The multipliers are part of an answer: without them, every measurement
    would have to project on a polyhedron, which is a separate program. Measured: `natural`, the norm of all that over
    ‖(q, b, d, lb where it is ub)‖; and without units, every row of A and C divided by its largest entry: `unit_free`,
    the box part with z over max(‖z‖∞, z_unit) and F over forces = max(‖q‖∞, ‖Mz‖∞, max|M| z_unit); `complementarity`,
    min(λ, Az − b) with λ over forces and a row over max(|b_i|, the scale of z); `equality`, Cz − d in the same way.
    The scales leave out multipliers (they may be large and cancel), rows of others (they may be idle) and unknowns
    with lb = ub.
    """

    node: ClassVar[str] = "avi"
    title: ClassVar[str] = "affine variational inequality"
    equation: ClassVar[str] = "(22), affine"
    relations: ClassVar[tuple[str, ...]] = (
        "X = {z : Az ≥ b, Cz = d, lb ≤ z ≤ ub}",
        "z ∈ X",
        "(Mz + q)ᵀ(y − z) ≥ 0 for all y ∈ X",
    )
    point_type: ClassVar[type[Point]] = AVIPoint
    primal: ClassVar[str] = "z"
    terms: ClassVar[tuple[Term, ...]] = (
        ("q", 1, "M", "z"),
        ("q", -1, "Aᵀ", "lam"),
        ("q", -1, "Cᵀ", "mu"),
        ("b", -1, "A", "z"),
        ("d", -1, "C", "z"),
    )

    M: Matrix = matrix_field("n", "n")
    q: Vector = vector_field("n")
    A: Matrix = matrix_field("m", "n", optional=True)
    b: Vector = vector_field("m", fill=0.0)
    C: Matrix = matrix_field("k", "n", optional=True)
    d: Vector = vector_field("k", fill=0.0)
    lb: Vector = vector_field("n", finite=False, fill=-np.inf)
    ub: Vector = vector_field("n", finite=False, fill=np.inf)

    def check(self) -> None:
        check_bounds(self.node, self.lb, self.ub)

    @property
    def only_box(self) -> bool:
        """No rows beside the bounds."""
        return not (self.b.size or self.d.size)

    @cached_property
    def moving(self) -> NDArray[np.bool_]:
        """lb < ub."""
        return self.lb < self.ub

    @cached_property
    def z_unit(self) -> float:
        """The least of ‖q‖∞/max|M|, the largest z in the box, and the z that b and d ask for; 0 without any."""
        return least(
            ratio(top(self.q, self.moving), max_abs(self.M)),
            largest_in_box(self.lb, self.ub, self.moving),
            max_abs(self.b / row_sizes(self.A)),
            max_abs(self.d / row_sizes(self.C)),
        )

    def slacks(self, point: AVIPoint) -> dict[str, Vector]:
        return {"w": self.M @ point.z + self.q - self.A.T @ point.lam - self.C.T @ point.mu}

    def measure(self, point: AVIPoint, tolerance: float) -> Residuals:
        z, lam = point.z, point.lam
        Mz = self.M @ z
        F = Mz + self.q - self.A.T @ lam - self.C.T @ point.mu
        rows, equality = self.A @ z - self.b, self.C @ z - self.d
        box = box_defect(z, F, self.lb, self.ub)
        natural = norm(np.concatenate([box, np.minimum(lam, rows), equality]))
        if not point.finite:  # which the bounds would clip
            natural = np.inf
        data = norm(np.concatenate([self.q, self.b, self.d, self.lb[~self.moving]]))
        measured = {"natural": scaled(natural, data)}
        if self.z_unit > 0:
            measured |= self._without_units(z, F, Mz, lam, rows, equality)
        return Residuals(
            measured=measured,
            parts={
                "natural_absolute": natural,
                "infeasibility": norm(
                    np.concatenate([z - project_box(z, self.lb, self.ub), np.minimum(rows, 0.0), equality])
                ),
            },
            flags=() if data > 0 else ("absolute",),
        )

    def _without_units(
        self, z: Vector, F: Vector, Mz: Vector, lam: Vector, rows: Vector, equality: Vector
    ) -> dict[str, float]:
        z_scale = max(top(z, self.moving), self.z_unit)
        forces = max(top(self.q, self.moving), top(Mz, self.moving), max_abs(self.M) * self.z_unit) or 1.0
        scale = own_scale(z_scale, self.lb, self.moving)
        measured = {"unit_free": box_residuals(z, F, self.lb, self.ub, scale, forces)}
        if self.b.size:
            sizes = row_sizes(self.A)
            row_scale = np.maximum(np.abs(self.b) / sizes, z_scale)
            measured["complementarity"] = norm(np.minimum(rows / sizes / row_scale, lam * sizes / forces))
        if self.d.size:
            sizes = row_sizes(self.C)
            measured["equality"] = norm(equality / sizes / np.maximum(np.abs(self.d) / sizes, z_scale))
        return measured
