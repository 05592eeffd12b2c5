"""Constraint qualifications that can be checked: under one, a solution has multipliers, and the conditions of Karush,
Kuhn and Tucker miss none; and matrices that are not positive semidefinite, under which they find too much.

Two are, for sets {g(z) ≥ 0, h(z) = 0, lb ≤ z ≤ ub}: every row is affine; or, g being concave and h affine, Slater's:
some point has gᵢ > 0 in the rows that are not affine and meets the others. The one point that is looked at is the
start of the problem. For sets {Ax + b ∈ K} alike: every factor of K is polyhedral; or some Ax + b is in K and, of the
factors that are not, in the relative interior. A few points are looked at.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from cpbench.conversions.base import Conversion
from cpbench.formulations.base import Kind
from cpbench.formulations.conic import ConeQP
from cpbench.formulations.expressions import Map
from cpbench.formulations.programs import NLP, Convexity
from cpbench.formulations.sizes import least_squares
from cpbench.formulations.variational import VI
from cpbench.foundation.cones import Cone
from cpbench.foundation.matrices import Matrix, Vector, least_eigenvalue, max_abs

ROUNDING = 1e-10
"""Distance from an affine row or a bound, beside what the terms of the rows and the point make of it, that is none."""
NEAR, MARGIN = 1e-9, 1e-4
"""Distance from K, beside max|Ax + b|, that is none; how far inside a factor a point is, beside its first entry."""
MEASURED = 1000
"""Rows up to which the least eigenvalue is computed for a message (0.1 s)."""


@dataclass(frozen=True)
class Constraints:
    """g(z) ≥ 0, h(z) = 0 and bounds, with the point that may be Slater's."""

    g: Map
    h: Map
    lb: Vector
    ub: Vector
    start: Vector

    @classmethod
    def of_program(cls, problem: NLP) -> Constraints:
        return cls(problem.g, problem.h, problem.lb, problem.ub, problem.start)

    @cached_property
    def curved(self) -> NDArray[np.bool_]:
        """Rows of g that are not affine."""
        return _curved(self.g)

    @property
    def count(self) -> int:
        """Number of rows of g and h that are not affine."""
        return int(self.curved.sum() + _curved(self.h).sum())

    def no_slater(self, *rows: tuple[Matrix, Vector, bool]) -> str:
        """Return why the start is not a point of Slater's, with the number; empty where it is one.

        Affine rows and bounds may be missed by rounding. A point that misses none is then within that distance, so
        that a curved row has to have more than its gradient makes of the distance.

        Parameters
        ----------
        rows : further affine rows Az − b, as A, b, and whether they are 0 (True) or ≥ 0 (False).
        """
        if not self.h.compiled.affine:
            return "h is not affine"
        z, affine = self.start, ~self.curved
        g, h = self.g.compiled, self.h.compiled
        rows = ((g.M[affine], -g.q[affine], False), (h.M, -h.q, True), *rows)
        slopes = [np.asarray(abs(A).sum(axis=1)).ravel() for A, _, _ in rows]
        with np.errstate(all="ignore"):
            terms = (abs(A) @ np.abs(z) + np.abs(b) for A, b, _ in rows)
            reach = np.concatenate([term / slope for term, slope in zip(terms, slopes, strict=True)])
            near = ROUNDING * (1.0 + max(max_abs(z), max_abs(reach[np.isfinite(reach)])))
            outside = float(np.max(np.maximum(self.lb - z, z - self.ub), initial=0.0))
            depth, steep = self.g(z)[self.curved], abs(self.g.jacobian(z)[self.curved]).sum(axis=1)
        if outside > near:
            return f"the start is {outside:.1e} outside the bounds"
        for (A, b, equal), slope in zip(rows, slopes, strict=True):
            missed = np.abs(A @ z - b) if equal else b - A @ z
            if not (missed <= near * slope).all():
                return f"the start misses an affine row by {missed.max():.1e}"
        needed = near * np.asarray(steep).ravel()
        if not (depth > needed).all():
            i = int(np.argmin(depth - needed))
            return (
                f"the start has a gᵢ = {depth[i]:.1e} in a row that is not affine, needed is more than {needed[i]:.1e}"
            )
        return ""


def _curved(F: Map) -> NDArray[np.bool_]:
    return np.diff(F.compiled.C.indptr) > 0


def of_program(problem: NLP) -> str:
    """Return why no qualification of a program is known, with the number; empty where one is."""
    rows = Constraints.of_program(problem)
    if not rows.count:
        return ""
    if not problem.taken_as_convex:
        verb = "is not" if problem.convexity is Convexity.REFUTED else "is not said to be"
        return f"{rows.count} rows of g and h are not affine, and the program {verb} convex"
    return rows.no_slater()


def of_set(problem: VI) -> str:
    """Return the same for the set of a VI whose g is concave."""
    if not problem.g.rows:
        return ""
    h = Map.empty(problem.start.size)
    rows = Constraints(problem.g, h, *problem.box, problem.start)
    if not rows.count:
        return ""
    return rows.no_slater((problem.A, problem.b, False), (problem.C, problem.d, True))


def of_cone(problem: ConeQP) -> str:
    """Return why no qualification of {x : Ax + b ∈ K}, K a cone, is known; empty where one is, or x ∈ K itself.

    Looked at are x = 0 and least-squares solutions of Ax + b = t e, e inside K, which hit it where A has full row rank.
    """
    K, m = problem.K, problem.b.size
    curved, inside, first = np.zeros(m, dtype=bool), np.zeros(m), np.arange(m)
    for kind, rows, mu, mu_r in K.groups:
        if kind == Cone.NONNEGATIVE:
            inside[rows] = 1.0
        elif kind not in (Cone.ZERO, Cone.FREE):
            inside[rows[:, 0]], first[rows] = 1.0, rows[:, :1]
            bent = ((mu > 0) & np.isfinite(mu)) | (mu_r > 0)
            curved[rows[bent]] = rows.shape[1] > (2 if kind == Cone.SECOND_ORDER else 3)
    if problem.plain or not curved.any():
        return ""
    size = max(1.0, max_abs(problem.b))
    shifts = (t * size * inside - problem.b for t in (1.0, 1e3))
    for x in (np.zeros(problem.p.size), *(least_squares(problem.A, shift) for shift in shifts)):
        s = problem.A @ x + problem.b
        depth = np.where(curved, s[first], 0.0)
        lowered = s - MARGIN * inside * depth  # in K only where s is inside the curved factors
        near = NEAR * np.where(curved, depth, max_abs(s))
        if (depth[curved] > 0).all() and (np.abs(lowered - K.project(lowered)) <= near).all():
            return ""
    count = np.unique(K.blocks[curved]).size
    return f"no x was found with Ax + b in K and inside its {count} factors that are not polyhedral"


class WhereConvex(Conversion):
    """Base of edges whose promise is stronger where a matrix of the problem is positive semidefinite.

    Attributes
    ----------
    matrix : name of the matrix, Q of a program or M.
    """

    best_kind = Kind.EQUIVALENT
    matrix: ClassVar[str]

    def exactness(self, problem: Any) -> Kind:
        definite = problem.convex if self.matrix == "Q" else problem.monotone
        return self.best_kind if definite else self.kind

    def reservation(self, problem: Any) -> str:
        return indefinite(getattr(problem, self.matrix), self.matrix)


def indefinite(M: Matrix, name: str) -> str:
    """Return the message that `M` is not positive semidefinite, with its least eigenvalue where that is cheap."""
    n = M.shape[0]
    number = f"n = {n}"
    if n <= MEASURED:
        number = f"least eigenvalue at unit diagonal {least_eigenvalue(M):.1e} or less"
    return f"the symmetric part of {name} is not positive semidefinite, {number}"
