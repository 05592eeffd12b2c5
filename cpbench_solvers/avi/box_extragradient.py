"""Extragradient for affine variational inequalities over boxes: relay, and avi without rows.

The method is that for nonlinear ones (`vi_extragradient`), on x = d x̂ in which the largest entries of M are about 1.
It uses nothing of M but its products.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.linear import AVI, AVIPoint, LCPPoint, Relay
from cpbench.foundation.cones import box_defect, project_box
from cpbench.foundation.matrices import Matrix, Vector
from cpbench.solvers.base import Budget, Record, Solver, SolverOutput, SolverSpec, register
from cpbench_solvers.avi.claims import error_of
from cpbench_solvers.nonlinear import projection_run
from cpbench_solvers.nonlinear.natural_map import congruent, equilibrate
from cpbench_solvers.nonlinear.projection_run import Field, projection_spec
from cpbench_solvers.nonlinear.vi_extragradient import KORPELEVICH, Extragradient, ExtragradientOptions

Affine = Relay | AVI


@dataclass(frozen=True)
class ScaledAffine:
    """x = d x̂: M̂, q̂ and the bounds in units of x̂, and x̂ as an answer."""

    problem: Affine
    M: Matrix
    q: Vector
    d: Vector
    lower: Vector
    upper: Vector

    @classmethod
    def of(cls, problem: Affine) -> ScaledAffine:
        d = equilibrate(problem.M, np.arange(problem.q.size))
        return cls(problem, congruent(problem.M, d), d * problem.q, d, problem.lb / d, problem.ub / d)

    def point(self, x: Vector) -> Any:
        z = np.clip(self.d * x, self.problem.lb, self.problem.ub)
        return LCPPoint(z) if isinstance(self.problem, Relay) else AVIPoint(z)


class AffineField(Field):
    """F and S of `projection_run`, of an affine problem."""

    def __init__(self, affine: ScaledAffine, tolerance: float) -> None:
        self._affine, self._tolerance = affine, tolerance
        self.counters = {"iterations": 0, "evaluations": 0, "projections": 0}

    def F(self, x: Vector) -> Vector:
        self.counters["evaluations"] += 1
        return self._affine.M @ x + self._affine.q

    def project(self, x: Vector, at: Vector) -> Vector:
        self.counters["projections"] += 1
        return project_box(x, self._affine.lower, self._affine.upper)

    def defect(self, x: Vector, F: Vector) -> Vector:
        self.counters["projections"] += 1
        return box_defect(x, F, self._affine.lower, self._affine.upper)

    def error(self, x: Vector, F: Vector) -> float:
        error = error_of(self._affine.problem, self._affine.point(x), self._tolerance)
        return error if np.isfinite(error) else np.inf

    def row_error(self, x: Vector, F: Vector) -> float:
        """Return 0: `error` is the judged one, which measures every part."""
        return 0.0

    def point(self, x: Vector) -> Any:
        return self._affine.point(x)


class _Extragradient(Solver):
    """Base of the solvers of both nodes. Tolerance: on the judged error itself, measured at every iterate."""

    def obstacle(self, problem: Affine) -> str | None:
        if isinstance(problem, AVI) and not problem.only_box:
            rows = problem.b.size + problem.d.size
            return f"has {rows} rows beside its bounds, whose set has no projection in closed form: use lemke-avi"
        return None

    def setup(self, problem: Affine, budget: Budget, options: Any) -> ScaledAffine:
        return ScaledAffine.of(problem)

    def solve(
        self, prepared: ScaledAffine, budget: Budget, options: Any, start: Any = None, record: Record | None = None
    ) -> SolverOutput:
        field = AffineField(prepared, budget.tolerance)
        limit = budget.iterations or options.max_iterations
        first = np.zeros(prepared.q.size) if start is None else start.z / prepared.d
        return projection_run.run(field, Extragradient(field, options), budget, limit, first, record)


_spec = partial(projection_spec, citation=KORPELEVICH, options=ExtragradientOptions)


@register
class ExtragradientRelay(_Extragradient):
    """A method that converges for monotone M; asks for no diagonal, as Gauss–Seidel does."""

    spec: ClassVar[SolverSpec] = _spec(
        name="extragradient-relay", node="relay", summary="extragradient with self-adaptive steps, on the box"
    )


@register
class ExtragradientAVI(_Extragradient):
    """A method that converges for monotone M; for bounds alone, whose projection is a formula."""

    spec: ClassVar[SolverSpec] = _spec(
        name="extragradient-avi",
        node="avi",
        summary="extragradient with self-adaptive steps, where there are bounds alone",
    )
