"""Nonlinear program, Acary's equation (10)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import ClassVar

import numpy as np
import scipy.sparse as sp

from cpbench.errors import ProblemError
from cpbench.formulations.base import Point, Problem, Residuals, formulations, map_field, scaled, vector_field
from cpbench.formulations.box import check_bounds
from cpbench.formulations.expressions import Map
from cpbench.formulations.expressions.derivatives import has_constant_curvature
from cpbench.foundation import matrices
from cpbench.foundation.cones import project_box
from cpbench.foundation.matrices import Vector, max_abs

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

    z: Vector
    lam: Vector
    mu: Vector
    nu: Vector


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

    @property
    def point_sizes(self) -> dict[str, int]:
        n = self.start.size
        return {"z": n, "lam": self.g.rows, "mu": self.h.rows, "nu": n}

    @cached_property
    def at_start(self) -> Vector:
        """The start, moved into the bounds."""
        return project_box(self.start, self.lb, self.ub)

    def objective(self, z: Vector) -> float:
        return float(self.f(z)[0])

    def residuals(self, point: NLPPoint, tolerance: float = 1e-6) -> Residuals:
        self.check_point(point)
        with np.errstate(all="ignore"):
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
