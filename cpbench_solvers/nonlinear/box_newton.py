"""Base of the Newton methods for nonlinear complementarity: the problem with its counters, the loop that watches,
records and starts again elsewhere.

A method that is stuck (no step lowers its merit, or nothing is gained for long) begins again: at the same point by its
other strategies, if it has any, then at random points, drawn with the budget's seed; `restarts` counts that.

What the equation Φ(z) = 0 is made of is an NCP function ψ; between two bounds Φᵢ = ψ(zᵢ − lbᵢ, −ψ(ubᵢ − zᵢ, −Fᵢ))
(Billups 1995), which for min is the natural map.
"""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cpbench.formulations.base import scaled
from cpbench.formulations.ncp_functions import NCPFunction, Values
from cpbench.formulations.nonlinear import MiCP, MiCPPoint
from cpbench.foundation.cones import box_defect, project_box
from cpbench.foundation.factorization import Factorization
from cpbench.foundation.matrices import Matrix, Sparse, Vector, dense, norm
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput
from cpbench.solvers.shared.row_error import row_error
from cpbench_solvers.lcp.claims import CLOSE


class Reformulation:
    """Φ for lb ≤ z ≤ ub: Fᵢ without a bound, ψ for one, Billups' composition for two, zᵢ − lbᵢ for equal ones."""

    def __init__(self, lb: Vector, ub: Vector) -> None:
        self.fixed: NDArray[np.bool_] = lb == ub
        self._low = np.flatnonzero(np.isfinite(lb) & ~self.fixed)
        self._high = np.flatnonzero(np.isfinite(ub) & ~self.fixed)
        self._lb, self._ub, self._value = lb[self._low], ub[self._high], lb[self.fixed]

    def __call__(self, psi: NCPFunction, z: Vector, F: Vector) -> Values:
        """Return Φ, α and β: diag(α) + diag(β) F′(z) is an element of its generalized derivative."""
        phi, alpha, beta = np.array(F), np.zeros_like(F), np.ones_like(F)
        with np.errstate(all="ignore"):
            at = self._high
            value, by_a, by_b = psi(self._ub - z[at], -F[at])
            phi[at], alpha[at], beta[at] = -value, by_a, by_b
            at = self._low
            value, by_a, by_b = psi(z[at] - self._lb, phi[at])
            phi[at], alpha[at], beta[at] = value, by_a + by_b * alpha[at], by_b * beta[at]
            at = self.fixed
            phi[at], alpha[at], beta[at] = z[at] - self._value, 1.0, 0.0
        return phi, alpha, beta


DENSE_LIMIT = 150
"""Up to this size Jacobians are dense: SuperLU costs more."""
FULL = 0.1
"""Share of nonzeros from which larger ones are dense, too: their factors fill up."""
FAR_ENOUGH = 1e-10
"""An iterate of this error that gains nothing any more is as good as rounding allows: no other start is tried."""
WINDOW = 30
"""Iterations without gain of a tenth after which a method counts as stuck."""
SPREAD = (-1.0, 1.0)
"""Random starts scatter by a power of 10 drawn from here, times max(1, |z|)."""
DRAWS = 30


class CountedBox:
    """F and F′ of a problem on its bounds, counted.

    Attributes
    ----------
    lb, ub : (n,). equation : Φ of its bounds. counters : of the solver's answer.
    """

    def __init__(self, problem: MiCP) -> None:
        self.problem, self.lb, self.ub = problem, problem.lb, problem.ub
        self.n = problem.start.size
        self.equation = Reformulation(problem.lb, problem.ub)
        self.counters = {"iterations": 0, "evaluations": 0, "jacobians": 0, "factorizations": 0, "restarts": 0}

    @property
    def start(self) -> Vector:
        """Where to begin without a start."""
        return self.problem.start

    def point(self, z: Vector) -> Any:
        """Return the answer as a point of the node."""
        return MiCPPoint(z)

    def F(self, z: Vector) -> Vector:
        """Return F(z), NaN and ∞ where it is not defined."""
        self.counters["evaluations"] += 1
        with np.errstate(all="ignore"):
            return self.problem.F(z)

    def jacobian(self, z: Vector) -> Matrix | None:
        """Return it dense for a small problem or a full one; None where an entry is not a number."""
        self.counters["jacobians"] += 1
        with np.errstate(all="ignore"):
            J: Sparse = self.problem.F.jacobian(z)
        if not np.isfinite(J.data).all():
            return None
        return dense(J) if self.n <= DENSE_LIMIT or J.nnz >= FULL * self.n**2 else J

    def project(self, z: Vector) -> Vector:
        return project_box(z, self.lb, self.ub)

    def error(self, z: Vector, F: Vector, tolerance: float) -> float:
        """Return the natural map of z, F = F(z), as a whole; where that is within the tolerance, its largest row."""
        with np.errstate(all="ignore"):
            error = scaled(norm(box_defect(z, F, self.lb, self.ub)), self.problem.scale)
            if error <= tolerance:
                error = max(error, row_error(z, F, self.problem.F.jacobian(z), self.lb, self.ub))
        return error if math.isfinite(error) else math.inf

    def solve(self, A: Matrix, b: Vector) -> Vector | None:
        """Return A⁻¹b, None where A is singular, be it to rounding: its kernel would make a direction of any length."""
        self.counters["factorizations"] += 1
        with np.errstate(all="ignore"):
            factors = Factorization(A)
            if factors.singular:
                return None
            x: Vector = factors.solve(b)
        return x if np.isfinite(x).all() else None


class LinearBox(CountedBox):
    """F(x) = Mx + q on bounds, M its own Jacobian. error_of : the judged error of x, by the tolerance. point : x as an
    answer."""

    def __init__(
        self,
        M: Matrix,
        q: Vector,
        lb: Vector,
        ub: Vector,
        point: Callable[[Vector], Any],
        error_of: Callable[[Vector, float], float],
    ) -> None:
        self._M, self._q, self._point, self._error_of = M, q, point, error_of
        self.n, self.lb, self.ub = q.size, lb, ub
        self.equation = Reformulation(lb, ub)
        self.counters = {"iterations": 0, "evaluations": 0, "factorizations": 0, "regularized": 0, "restarts": 0}

    @property
    def start(self) -> Vector:
        return np.zeros(self.n)

    def point(self, z: Vector) -> Any:
        return self._point(z)

    def F(self, z: Vector) -> Vector:
        self.counters["evaluations"] += 1
        with np.errstate(all="ignore"):
            return self._M @ z + self._q

    def jacobian(self, z: Vector) -> Matrix:
        return self._M

    def error(self, z: Vector, F: Vector, tolerance: float) -> float:
        return self._error_of(z, tolerance)


class BoxMethod(ABC):
    """A way from one iterate to the next. `z` and `F` = F(z) are the present ones; both are there after `begin`."""

    z: Vector
    F: Vector
    strategies: int = 1
    """How many ways `begin` knows to go on from one point."""

    def __init__(self, box: CountedBox) -> None:
        self.box = box

    @abstractmethod
    def begin(self, z: Vector, F: Vector, strategy: int) -> None:
        """Forget everything and stand at z, a point within the bounds."""

    @abstractmethod
    def step(self) -> bool:
        """Go to the next iterate; False when there is none."""


class BoxNewton(Solver):
    """A solver of mixed complementarity problems by a `BoxMethod`; its options have `max_iterations` and `restarts`."""

    @abstractmethod
    def method(self, box: CountedBox, options: Any, budget: Budget) -> BoxMethod:
        """Return the method for one solve."""

    def setup(self, problem: MiCP, budget: Budget, options: Any) -> MiCP:
        with np.errstate(all="ignore"):  # compiles F and F′, so that this is timed as setup
            z: Any = problem.project(problem.start)
            problem.F(z)
            problem.F.jacobian(z)
        return problem

    def solve(
        self, prepared: MiCP, budget: Budget, options: Any, start: Any = None, record: Record | None = None
    ) -> SolverOutput:
        method = self.method(CountedBox(prepared), options, budget)
        limit = budget.iterations or options.max_iterations
        return run(method, budget, limit, options.restarts, None if start is None else start.z, record)


def run(
    method: BoxMethod, budget: Budget, limit: int, restarts: int, start: Vector | None, record: Record | None
) -> SolverOutput:
    """Take steps until the error is at most the tolerance, or the limits are reached, or no start helps."""
    box = method.box
    counters = box.counters
    rng = np.random.default_rng(budget.seed)
    deadline = time.monotonic() + budget.seconds
    first = box.project(box.start if start is None else start)
    F = box.F(first)
    if not np.isfinite(F).all():
        next_start = _drawn(box, first, 0, rng)
        if next_start is None:
            message = "F is not finite at the start nor near it: give another start"
            return SolverOutput(claim=Claim.FAILED, point=box.point(first), counters=counters, message=message)
        z, F = next_start
    else:
        z = first
    best, least, claim, message = z, math.inf, Claim.MAX_ITER, f"{limit} iterations"
    begun = z, F
    method.begin(z, F, 0)
    gained, level = 0, math.inf
    while True:
        done = counters["iterations"]
        z, F = method.z, method.F
        shown = box.project(z)
        error = box.error(shown, F if np.array_equal(shown, z) else box.F(shown), budget.tolerance)
        if record is not None:
            record(done, error, partial(box.point, shown))
        if error < least:
            best, least = shown, error
        if error < 0.9 * level:
            gained, level = done, error
        if error <= budget.tolerance or done >= limit:
            break
        if time.monotonic() > deadline:
            claim, message = Claim.FAILED, f"out of time after {done} iterations"
            break
        counters["iterations"] = done + 1
        if done - gained < WINDOW and method.step():
            continue
        if least <= max(CLOSE * budget.tolerance, FAR_ENOUGH) or counters["restarts"] >= restarts:
            claim = Claim.INACCURATE if least <= CLOSE * budget.tolerance else Claim.FAILED
            message = f"stuck at error {least:.1e} after {done} iterations and {counters['restarts']} restarts"
            break
        counters["restarts"] += 1
        number = counters["restarts"]
        next_start = begun if number < method.strategies else _drawn(box, first, number - method.strategies, rng)
        if next_start is None:
            claim, message = Claim.FAILED, f"stuck at error {least:.1e}, and F is not finite at other starts"
            break
        method.begin(*next_start, number % method.strategies)
        gained, level = done + 1, math.inf
    if least <= budget.tolerance:
        claim, message = Claim.SOLVED, ""
    return SolverOutput(claim=claim, point=box.point(best), counters=dict(counters), message=message)


def _drawn(box: CountedBox, first: Vector, number: int, rng: np.random.Generator) -> tuple[Vector, Vector] | None:
    """Return a point within the bounds where F is finite, and F; around the first start and around P(0) in turn."""
    centre = box.project(np.zeros(box.n)) if number % 2 else first
    for draw in range(DRAWS):
        size = 10.0 ** rng.uniform(*SPREAD) * np.maximum(1.0, np.abs(first))
        shift = rng.standard_normal(box.n)
        if draw % 2:  # away from bounds: there, a root or a logarithm may have no derivative
            shift = np.where(np.isfinite(box.lb), np.abs(shift), np.where(np.isfinite(box.ub), -np.abs(shift), shift))
        z = box.project(centre + size * shift)
        F = box.F(z)
        if np.isfinite(F).all():
            return z, F
    return None
