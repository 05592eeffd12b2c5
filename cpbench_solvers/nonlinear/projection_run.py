"""Base of the projection methods for (quasi-)variational inequalities: F and the set with their counters, a first
step length, and the loop that watches the natural map, records and ends.

They use nothing of a problem but values of F and projections on the simple set S, so that rows and g are not for them;
F′ is asked for only where an iterate looks like an answer.
All of them converge where F is monotone and locally Lipschitz continuous (`projection-vi`: cocoercive or strongly
monotone), linearly at best; elsewhere they may cycle, and then say that they stalled.
"""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.base import scaled
from cpbench.formulations.linear import AVI
from cpbench.formulations.variational import QVI, VI, QVIPoint, VIPoint
from cpbench.foundation.cones import ProductCone
from cpbench.foundation.matrices import Sparse, Vector, norm
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec
from cpbench.solvers.shared.progress import Progress
from cpbench.solvers.shared.row_error import row_error
from cpbench_solvers.avi.claims import verdict_error
from cpbench_solvers.lcp.claims import CLOSE
from cpbench_solvers.traits import ITERATIVE

STALL = 2000
"""Least number of iterations without gain that ends a run."""
PROBE = 1e-4
"""Length, relative to that of z, over which the first step length is measured."""
POLISH = 8
"""The most iterations that a method goes on for, once it has met the tolerance, to get from there to its `aim`."""
SURE = 0.8
"""Share of the tolerance that errors of rows meet: units of rows are those of the verdict up to some percent."""
SHRINKS = 60
"""Most reductions of a step length in one iteration: by then it is lost in rounding."""


@dataclass(frozen=True)
class VIProjectionOptions:
    """Options. `max_iterations` : of the method, which evaluates F once or a few times in each."""

    max_iterations: int = 50_000


class Field:
    """F and S of a problem, counted. counters : of the solver's answer."""

    def __init__(self, problem: VI | QVI) -> None:
        self.problem = problem
        self.counters = {"iterations": 0, "evaluations": 0, "projections": 0}

    def F(self, x: Vector) -> Vector:
        """Return F(z), NaN and ∞ where it is not defined."""
        self.counters["evaluations"] += 1
        with np.errstate(all="ignore"):
            return self.problem.F(x)

    def project(self, x: Vector, at: Vector) -> Vector:
        """Return P_S(x), S that of `at` where it moves."""
        self.counters["projections"] += 1
        if isinstance(self.problem, QVI):
            return self.problem.project_at(at, x)
        return self.problem.project(x)

    def defect(self, x: Vector, F: Vector) -> Vector:
        """Return x − P_S(x − F), without cancellation."""
        self.counters["projections"] += 1
        with np.errstate(all="ignore"):
            return self.problem.defect(x, F)

    def error(self, x: Vector, F: Vector) -> float:
        """Return the natural map of x, of which F is F(x), as a whole."""
        error = scaled(norm(self.defect(x, F)), self.problem.scale)
        return error if math.isfinite(error) else math.inf

    def row_error(self, x: Vector, F: Vector) -> float:
        """Return the largest natural map of a row of x, of which F is F(x), or of the rows of a factor of the set; of
        an affine F over a box the verdict's error."""
        if self._as_affine is not None:
            return verdict_error(self._as_affine, x)
        slope = self.derivative(x)
        return math.inf if slope is None else row_error(x, F, slope, *self.bounds(x))

    @cached_property
    def _as_affine(self) -> AVI | None:
        problem = self.problem
        if not isinstance(problem, VI) or rows_obstacle(problem) or not problem.only_box:
            return None
        F, (lb, ub) = problem.F.compiled, problem.box
        return AVI(M=F.M, q=F.q, lb=lb, ub=ub) if F.affine else None

    def bounds(self, x: Vector) -> tuple[Vector, Vector, ProductCone | None]:
        """Return the bounds and the other factors, if any, of the set, of that at x where it moves."""
        problem = self.problem
        K, lb, ub = problem.set_at(x) if isinstance(problem, QVI) else (problem.K, problem.lb, problem.ub)
        return lb, ub, K if problem.cone_kind.size else None

    def derivative(self, x: Vector) -> Sparse | None:
        """Return F′(x); None where an entry is not a number."""
        with np.errstate(all="ignore"):
            slope = self.problem.F.jacobian(x)
        return slope if np.isfinite(slope.data).all() else None

    def point(self, x: Vector) -> Any:
        return VIPoint(x) if isinstance(self.problem, VI) else QVIPoint(x)

    def first_step(self, z: Vector, F: Vector) -> float:
        """Return 1/L, L the change of F over a short way from z, in the direction of a step; 1 without a change."""
        size = norm(F)
        if not size:
            return 1.0
        length = PROBE * max(norm(z), 1.0) / size
        for near in (self.project(z - length * F, z), z - length * F):
            distance, change = norm(near - z), norm(self.F(near) - F)
            if distance > 0 and 0 < change < math.inf:
                return distance / change
        return 1.0


class ProjectionMethod(ABC):
    """A way from one iterate to the next. `z` and `F` = F(z) are what is measured and answered.

    aim : the share of the tolerance that it goes on to. Below 1 for methods that converge so fast that this costs an
    iteration or two: the natural map of a whole problem may be small while a part of it, which is judged too, is not.
    """

    aim: ClassVar[float] = 1.0
    z: Vector
    F: Vector

    def __init__(self, field: Field, options: Any) -> None:
        self.field, self.options = field, options

    @abstractmethod
    def begin(self, z: Vector, F: Vector) -> None:
        """Stand at z, where F is finite."""

    @abstractmethod
    def step(self) -> bool:
        """Go to the next iterate; False where no step length gives a finite one."""

    def elsewhere(self) -> bool:
        """Stand at another start, for the natural map is small where no solution is; False where there is none."""
        return False


class ProjectionSolver(Solver):
    """A projection method. Tolerance: on the natural map as a whole and on that of every row or factor of S, of an
    affine F over a box on the error of connected parts."""

    method: ClassVar[type[ProjectionMethod]]

    def obstacle(self, problem: VI | QVI) -> str | None:
        return rows_obstacle(problem)

    def setup(self, problem: VI | QVI, budget: Budget, options: VIProjectionOptions) -> VI | QVI:
        with np.errstate(all="ignore"):
            problem.F(problem.start)  # compiles it, and its derivative
            problem.F.jacobian(problem.start)
        return problem

    def solve(
        self,
        prepared: VI | QVI,
        budget: Budget,
        options: VIProjectionOptions,
        start: Any = None,
        record: Record | None = None,
    ) -> SolverOutput:
        field = Field(prepared)
        limit = budget.iterations or options.max_iterations
        first = prepared.start if start is None else start.z
        return run(field, type(self).method(field, options), budget, limit, first, record)


def rows_obstacle(problem: VI | QVI) -> str | None:
    """Return why a set is not simple, else None."""
    rows = {"g": problem.g.rows}
    if isinstance(problem, VI):
        rows = {"A": problem.b.size, "C": problem.d.size} | rows
    rows_named = ", ".join(f"{count} of {name}" for name, count in rows.items() if count)
    if not rows_named:
        return None
    instead = "newton-qvi" if isinstance(problem, QVI) else "newton-vi, or the conversion vi→micp where S is a box"
    return f"has rows ({rows_named}), whose set has no projection in closed form: use {instead}"


@np.errstate(all="ignore")
def run(
    field: Field, method: ProjectionMethod, budget: Budget, limit: int, start: Vector, record: Record | None
) -> SolverOutput:
    """Take steps until the error is at most the tolerance, or the limits are reached, or nothing gains."""
    counters = field.counters
    deadline, progress = time.monotonic() + budget.seconds, Progress(STALL)
    begun = _beginning(field, start)
    if begun is None:
        message = "F is not finite at the start nor at the projection of 0: give another start"
        return SolverOutput(claim=Claim.FAILED, point=field.point(start), counters=counters, message=message)
    method.begin(*begun)
    best, least = method.z, math.inf
    claim, message = Claim.MAX_ITER, f"{limit} iterations"
    met = math.inf  # the iteration at which the tolerance was met
    false = 0  # iterations in which it was met as a whole only
    while True:
        done, z = counters["iterations"], method.z
        whole = error = field.error(z, method.F)
        if whole <= budget.tolerance:
            error = max(whole, field.row_error(z, method.F) / SURE)
            false = 0 if error <= budget.tolerance else false + 1
        if record is not None:
            record(done, error, partial(field.point, z))
        if error < least:
            best, least = z, error
        if error <= budget.tolerance:
            met = min(met, done)
        if error <= method.aim * budget.tolerance or done >= min(limit, met + POLISH):
            break
        if time.monotonic() > deadline:
            claim, message = Claim.FAILED, f"out of time after {done} iterations"
            break
        if false > POLISH:
            false = 0
            if method.elsewhere():
                progress = Progress(STALL)
                continue
        trouble = progress.trouble(done, whole)
        if trouble is None and not method.step():
            trouble = f"no step from error {error:.1e} after {done} iterations"
        if trouble is not None:
            claim = Claim.INACCURATE if least <= CLOSE * budget.tolerance else Claim.FAILED
            message = trouble
            break
        counters["iterations"] = done + 1
    if least <= budget.tolerance:
        claim, message = Claim.SOLVED, ""
    return SolverOutput(claim=claim, point=field.point(best), counters=dict(counters), message=message)


def _beginning(field: Field, start: Vector) -> tuple[Vector, Vector] | None:
    for at in (start, np.zeros(start.size)):
        z = field.project(at, at)
        F = field.F(z)
        if np.isfinite(F).all():
            return z, F
    return None


def lipschitz(near: Vector, F_near: Vector, z: Vector, F: Vector) -> float:
    """Return ‖F(near) − F(z)‖/‖near − z‖: 0 for equal points, ∞ where F(near) is no number."""
    distance, change = norm(near - z), norm(F_near - F)
    if not math.isfinite(change):
        return math.inf
    return change / distance if distance > 0 else 0.0


projection_spec = partial(SolverSpec, node="vi", method="projection", traits=ITERATIVE)
"""The spec of a projection method, with what all of them share."""
