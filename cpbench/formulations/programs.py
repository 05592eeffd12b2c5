"""Programs: quadratic (1) and nonlinear (10)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp

from cpbench.errors import ProblemError
from cpbench.formulations.base import (
    Point,
    Problem,
    Residuals,
    Term,
    formulations,
    map_field,
    matrix_field,
    point_field,
    scaled,
    vector_field,
)
from cpbench.formulations.expressions import Map
from cpbench.formulations.expressions.derivatives import has_constant_curvature
from cpbench.formulations.sizes import check_bounds
from cpbench.foundation import matrices
from cpbench.foundation.cones import project_box
from cpbench.foundation.factorization import Factorization
from cpbench.foundation.matrices import Matrix, Vector, max_abs


@dataclass(frozen=True, eq=False)
class QPPoint(Point):
    """z (n,), λ ≥ 0 of Az ≥ b (m,), μ of Cz = d (k,), ν of the box (n,): ν > 0 at lb, ν < 0 at ub."""

    z: Vector = point_field("n")
    lam: Vector = point_field("m")
    mu: Vector = point_field("k")
    nu: Vector = point_field("n")


@formulations.register("qp")
@dataclass(frozen=True, eq=False, kw_only=True)
class QP(Problem):
    """min ½zᵀQz + pᵀz subject to Az ≥ b, Cz = d, lb ≤ z ≤ ub (bounds may be infinite; b may be -inf nowhere).

    `residuals`, by which solvers stop, decides no verdict (`cpbench.verification` has its own error). It has, in the
    ∞-norm, each the smaller of the absolute and the relative value: `stationarity` ‖Qz + p − Aᵀλ − Cᵀμ − ν‖; `primal`
    violation of the constraints; `dual` violation of λ ≥ 0 and of the signs of ν at infinite bounds; `gap` between the
    primal and the dual objective.
    """

    node: ClassVar[str] = "qp"
    core: ClassVar[bool] = True
    title: ClassVar[str] = "quadratic program"
    equation: ClassVar[str] = "(1)"
    relations: ClassVar[tuple[str, ...]] = ("min ½zᵀQz + pᵀz", "Az ≥ b", "Cz = d", "lb ≤ z ≤ ub")
    point_type: ClassVar[type[Point]] = QPPoint
    primal: ClassVar[str] = "z"
    terms: ClassVar[tuple[Term, ...]] = (
        ("p", 1, "Q", "z"),
        ("p", -1, "Aᵀ", "lam"),
        ("p", -1, "Cᵀ", "mu"),
        ("b", -1, "A", "z"),
        ("d", -1, "C", "z"),
    )

    Q: Matrix = matrix_field("n", "n")
    p: Vector = vector_field("n")
    A: Matrix = matrix_field("m", "n", optional=True)
    b: Vector = vector_field("m", fill=0.0)
    C: Matrix = matrix_field("k", "n", optional=True)
    d: Vector = vector_field("k", fill=0.0)
    lb: Vector = vector_field("n", finite=False, fill=-np.inf)
    ub: Vector = vector_field("n", finite=False, fill=np.inf)

    @classmethod
    def build(
        cls,
        Q: Matrix,
        p: Vector,
        A: Any = None,
        b: Any = None,
        C: Any = None,
        d: Any = None,
        lb: Any = None,
        ub: Any = None,
        *,
        name: str = "",
    ) -> QP:
        """Return a QP with the absent parts empty (no rows) or infinite (bounds)."""
        return cls(Q=Q, p=p, A=A, b=b, C=C, d=d, lb=lb, ub=ub, name=name)

    def check(self) -> None:
        if not matrices.is_symmetric(self.Q, 1e-9):
            raise ProblemError("qp.Q", f"is not symmetric: asymmetry = {matrices.asymmetry(self.Q):.1e}")
        check_bounds(self.node, self.lb, self.ub)

    @property
    def has_bounds(self) -> bool:
        return bool(np.isfinite(self.lb).any() or np.isfinite(self.ub).any())

    @cached_property
    def convex(self) -> bool:
        """Q positive semidefinite (matrices.is_psd)."""
        return matrices.is_psd(self.Q)

    @cached_property
    def factorization(self) -> Factorization:
        """LU of Q, shared by the test for singularity, the dual and its lift."""
        return Factorization(self.Q)

    def objective(self, z: Vector) -> float:
        return float(0.5 * z @ (self.Q @ z) + self.p @ z)

    def measure(self, point: QPPoint, tolerance: float) -> Residuals:
        z, lam, mu, nu = point.z, point.lam, point.mu, point.nu
        Qz, Az, Cz = self.Q @ z, self.A @ z, self.C @ z
        At, Ct = self.A.T @ lam, self.C.T @ mu
        below, above = np.isfinite(self.lb), np.isfinite(self.ub)
        violation = np.concatenate(
            [
                np.maximum(self.b - Az, 0.0),
                Cz - self.d,
                np.maximum(self.lb - z, 0.0)[below],
                np.maximum(z - self.ub, 0.0)[above],
            ]
        )
        wrong_sign = np.concatenate(
            [
                np.maximum(-lam, 0.0),
                np.maximum(nu, 0.0)[~below],
                np.maximum(-nu, 0.0)[~above],
            ]
        )
        z_bounds = np.concatenate([self.lb[below], self.ub[above]])
        constraints = float(
            self.b @ lam
            + self.d @ mu
            + self.lb[below] @ np.maximum(nu, 0.0)[below]
            - self.ub[above] @ np.maximum(-nu, 0.0)[above]
        )
        zQz, pz = float(z @ Qz), float(self.p @ z)
        absolute = {
            "stationarity": max_abs(Qz + self.p - At - Ct - nu),
            "primal": max_abs(violation),
            "dual": max_abs(wrong_sign),
            "gap": abs(zQz + pz - constraints),
        }
        scale = {
            "stationarity": max(map(max_abs, (Qz, At, Ct, self.p, nu))),
            "primal": max(map(max_abs, (Az, self.b, Cz, self.d, z_bounds))),
            "dual": max(map(max_abs, (lam, mu, nu))),
            "gap": max(abs(zQz), abs(pz), abs(constraints)),
        }
        relative = {k: v / scale[k] if scale[k] > 0 else v for k, v in absolute.items()}
        parts = {f"{k}_absolute": v for k, v in absolute.items()}
        parts |= {f"{k}_relative": v for k, v in relative.items()}
        parts["objective"] = float(0.5 * z @ Qz + self.p @ z)
        return Residuals(
            # min(NaN, x) depends on the order of its arguments: NaN must win
            measured={k: float(np.minimum(absolute[k], relative[k])) for k in absolute},
            parts=parts,
            flags=() if self.convex else ("stationary",),
        )

    def certifies_infeasibility(self, certificate: Vector) -> bool:
        """Return whether (λ, μ) is a proof of Farkas: λ ≥ 0 and ν = −Aᵀλ − Cᵀμ excludes every z within the constraints
        when bᵀλ + dᵀμ + lbᵀν⁺ − ubᵀν⁻ > 0, for λᵀ(Az − b) + μᵀ(Cz − d) + Σ ν⁺(z − lb) + ν⁻(ub − z) ≥ 0 would be minus
        that. ν has to be 0 where the bound it goes with is infinite (to rounding: 1e-12 of what cancels in it)."""
        m = self.b.size
        if certificate.size != m + self.d.size or not np.isfinite(certificate).all() or not certificate.any():
            return False
        top = max_abs(certificate)
        lam, mu = np.maximum(certificate[:m], 0.0) / top, certificate[m:] / top
        nu = -(self.A.T @ lam + self.C.T @ mu)
        rounding = 1e-12 * (abs(self.A).T @ lam + abs(self.C).T @ abs(mu))
        bound = np.where(nu > 0.0, self.lb, self.ub)
        if (abs(nu) > rounding)[np.isinf(bound)].any():
            return False
        at = np.isfinite(bound)
        terms = np.concatenate([self.b * lam, self.d * mu, bound[at] * nu[at]])
        doubt = float(abs(bound[at]) @ rounding[at])  # what is only rounding in ν may not decide
        return bool(terms.sum() - doubt > 1e-9 * max(float(abs(terms).sum()), 1e-300))


LARGEST = 2_000
"""Operations of the largest map whose second derivatives are formed to check them, in a third of a second."""


class Convexity(StrEnum):
    """Convexity of a program, as far as it is known."""

    UNKNOWN = "unknown"
    """It is not declared."""
    DECLARED = "declared"
    """The author's word: some second derivative is not constant, or the map is too large to check."""
    CHECKED = "checked"
    """All second derivatives are constants, f is convex and g concave."""
    REFUTED = "refuted"
    """It is declared, and constant second derivatives show the contrary."""


@dataclass(frozen=True, eq=False)
class NLPPoint(Point):
    """z (n,), λ ≥ 0 of g(z) ≥ 0 (m,), μ of h(z) = 0 (k,), ν of the box (n,): ν > 0 at lb, ν < 0 at ub."""

    z: Vector = point_field("n")
    lam: Vector = point_field("m")
    mu: Vector = point_field("k")
    nu: Vector = point_field("n")


@formulations.register("nlp")
@dataclass(frozen=True, eq=False, kw_only=True)
class NLP(Problem):
    """min f(z) subject to g(z) ≥ 0, h(z) = 0, lb ≤ z ≤ ub (bounds may be infinite).

    `residuals`, by which solvers stop, decides no verdict (`cpbench.verification` has its own error). It has, in the
    ∞-norm, each the smaller of the absolute and the relative value: `stationarity` ‖∇f − ∇g λ − ∇h μ − ν‖; `primal`
    violation of the constraints, relative to the size of the Jacobians times z, or of z; `dual` violation of λ ≥ 0 and
    of the signs of ν at infinite bounds; `complementarity` |λᵀg| + |ν⁺ᵀ(z − lb)| + |ν⁻ᵀ(ub − z)|, relative to |f|.
    These are the conditions of Karush, Kuhn and Tucker: of a program that is not known to be convex (`convexity`) they
    do not say that z is a minimum, and an answer has the flag `stationary`; where only its author says that it is, the
    flag `convexity declared`.
    """

    node: ClassVar[str] = "nlp"
    title: ClassVar[str] = "nonlinear program"
    equation: ClassVar[str] = "(10)"
    relations: ClassVar[tuple[str, ...]] = ("min f(z)", "g(z) ≥ 0", "h(z) = 0", "lb ≤ z ≤ ub")
    point_type: ClassVar[type[Point]] = NLPPoint
    primal: ClassVar[str] = "z"

    f: Map = map_field("1", "n")
    g: Map = map_field("m", "n", optional=True)
    h: Map = map_field("k", "n", optional=True)
    lb: Vector = vector_field("n", finite=False, fill=-np.inf)
    ub: Vector = vector_field("n", finite=False, fill=np.inf)
    start: Vector = vector_field("n", fill=0.0)

    convex: bool = False
    """Whether its author says that f is convex, g concave and h affine; `convexity` has what can be checked of it."""

    def check(self) -> None:
        check_bounds(self.node, self.lb, self.ub)
        if self.convex and not self.h.compiled.affine:
            raise ProblemError("nlp.convex", "is said of a problem whose h is not affine")

    @cached_property
    def convexity(self) -> Convexity:
        """What is known of the convexity that is declared: second derivatives are checked where they are constants."""
        if not self.convex:
            return Convexity.UNKNOWN
        constant = [F.operations <= LARGEST and has_constant_curvature(F) for F in (self.f, self.g)]
        if (constant[0] and not _curves_up(self.f, 1.0)) or (constant[1] and not _curves_up(self.g, -1.0)):
            return Convexity.REFUTED
        return Convexity.CHECKED if all(constant) else Convexity.DECLARED

    @property
    def taken_as_convex(self) -> bool:
        """Whether its convexity is declared and not refuted."""
        return self.convexity in (Convexity.DECLARED, Convexity.CHECKED)

    @cached_property
    def at_start(self) -> Vector:
        """The start, moved into the bounds."""
        return project_box(self.start, self.lb, self.ub)

    def objective(self, z: Vector) -> float:
        return float(self.f(z)[0])

    def measure(self, point: NLPPoint, tolerance: float) -> Residuals:
        z, lam, mu, nu = point.z, point.lam, point.mu, point.nu
        gradient = self.f.jacobian(z).toarray().ravel()
        g, h, Jg, Jh = self.g(z), self.h(z), self.g.jacobian(z), self.h.jacobian(z)
        below, above = np.isfinite(self.lb), np.isfinite(self.ub)
        room, roof = (z - self.lb)[below], (self.ub - z)[above]
        at_lower, at_upper = np.maximum(nu, 0.0), np.maximum(-nu, 0.0)
        gaps = (lam @ g, at_lower[below] @ room, at_upper[above] @ roof)
        absolute = {
            "stationarity": max_abs(gradient - Jg.T @ lam - Jh.T @ mu - nu),
            "primal": max_abs(np.concatenate([np.maximum(-g, 0), h, np.maximum(-room, 0), np.maximum(-roof, 0)])),
            "dual": max_abs(np.concatenate([np.maximum(-lam, 0.0), at_lower[~below], at_upper[~above]])),
            "complementarity": sum(abs(float(gap)) for gap in gaps),
        }
        reach = np.abs(z)
        scale = {
            "stationarity": max(map(max_abs, (gradient, Jg.T @ lam, Jh.T @ mu, nu))),
            "primal": max(max_abs(abs(Jg) @ reach), max_abs(abs(Jh) @ reach), max_abs(z)),
            "dual": max(map(max_abs, (lam, mu, nu))),
            "complementarity": abs(self.objective(z)),
        }
        relative = {k: scaled(v, scale[k]) for k, v in absolute.items()}
        parts = {f"{k}_absolute": v for k, v in absolute.items()}
        parts |= {f"{k}_relative": v for k, v in relative.items()}
        parts["objective"] = self.objective(z)
        finite = {k: float(np.minimum(absolute[k], relative[k])) if point.finite else np.inf for k in absolute}
        return Residuals(measured=finite, parts=parts, flags=FLAGS[self.convexity])


FLAGS = {
    Convexity.UNKNOWN: ("stationary",),
    Convexity.REFUTED: ("stationary",),
    Convexity.DECLARED: ("convexity declared",),
    Convexity.CHECKED: (),
}


def _curves_up(F: Map, sign: float) -> bool:
    """Return whether `sign` times every row of F, whose second derivatives are constants, is convex."""
    zero, weights = np.zeros(F.inputs), np.zeros(F.rows)
    for row in np.flatnonzero(np.diff(F.compiled.C.indptr)).tolist():  # the others are affine
        weights[:] = 0.0
        weights[row] = sign
        hessian = F.hessian(zero, weights)
        kept = np.flatnonzero(np.diff(hessian.indptr))
        if not matrices.is_psd(sp.csr_array(hessian[kept][:, kept])):
            return False
    return True
