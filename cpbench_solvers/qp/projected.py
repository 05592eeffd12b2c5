"""Projected gradients for convex QPs, plain and with Nesterov's momentum: on the box, or on the dual (Uzawa's method).

Without rows: x⁺ = P(x − ∇f(x)/L) on the bounds. With rows Q is factorized, and the dual function is maximised over the
signs of the multipliers y of all constraints, s = (x, Gx): x(y) minimises f − yᵀs, and

    y⁺_i = the multiplier of s_i in the projection: y − (s − P(s − Ly))/L,  P on [lower, upper].
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.qp import QP
from cpbench.foundation import matrices
from cpbench.foundation.kernel_cache import load_all
from cpbench.foundation.matrices import Vector, norm
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, register
from cpbench.solvers.shared.progress import Progress
from cpbench_solvers.qp.claims import ErrorMeasure, convex_obstacle, definite_obstacle, infeasible, unbounded
from cpbench_solvers.qp.kkt_system import KERNELS, KKT, entries
from cpbench_solvers.qp.scaling import ScaledQP, scaled
from cpbench_solvers.traits import ITERATIVE

STALL = 3000
"""Least number of iterations without gain that ends a run."""
POWER_STEPS = 30
"""Of the power iteration for the greatest eigenvalue, of which SAFETY times is taken."""
SAFETY = 1.05
LOOK = 10
"""The judged error is measured after every tenth iteration."""
REGULARIZATION = 1e-11
"""Of the factorization of Q, which refinement takes out again."""
LARGE = 1e4
"""Iterates beyond this, in data of size one, may be on their way along a ray: proofs are looked for."""


@dataclass(frozen=True)
class ProjectedOptions:
    """Options of nesterov-qp, projected-gradient. `step` : by 1/L. `max_iterations` : a product or solve with Q."""

    step: float = 1.0
    max_iterations: int = 10_000


class ProjectedSide(ABC):
    """A smooth concave or convex function of u and a projection. `L` : the Lipschitz constant of its gradient."""

    def __init__(self, form: ScaledQP) -> None:
        self.form = form

    @abstractmethod
    def first(self, x: Vector, y: Vector) -> Vector: ...

    @abstractmethod
    def step(self, u: Vector, length: float) -> Vector:
        """Return the projected gradient step from u."""

    @abstractmethod
    def answer(self, u: Vector) -> tuple[Vector, Vector]:
        """Return x and the multipliers of all constraints."""

    def lipschitz(self, size: int) -> float:
        u = np.random.default_rng(0).standard_normal(size)
        value = 0.0
        for _ in range(POWER_STEPS):
            u /= norm(u) or 1.0
            u = self.product(u)
            value = norm(u)
        return SAFETY * value or 1.0

    @abstractmethod
    def product(self, u: Vector) -> Vector:
        """Return the Hessian times u."""


class PrimalBox(ProjectedSide):
    """f itself on lower ≤ x ≤ upper."""

    def first(self, x: Vector, y: Vector) -> Vector:
        return np.clip(x, self.form.lower, self.form.upper)

    def product(self, u: Vector) -> Vector:
        return self.form.H @ u

    def step(self, u: Vector, length: float) -> Vector:
        return np.clip(u - length * (self.form.H @ u + self.form.g), self.form.lower, self.form.upper)

    def answer(self, u: Vector) -> tuple[Vector, Vector]:
        slope = self.form.H @ u + self.form.g
        return u, np.where(slope > 0.0, slope * (u <= self.form.lower), slope * (u >= self.form.upper))


class Dual(ProjectedSide):
    """The dual function of y; Q is factorized once."""

    def __init__(self, form: ScaledQP) -> None:
        super().__init__(form)
        n = form.g.size
        self._kkt = KKT(entries(form.H), entries(np.zeros((0, n))), REGULARIZATION)
        self.regular = self._kkt.factor(np.zeros(n), np.zeros(0))
        self._none = np.zeros(0)
        self._Gt = matrices.transpose(form.G)
        self._bounded = np.isfinite(form.lower[:n]) | np.isfinite(form.upper[:n])

    def first(self, x: Vector, y: Vector) -> Vector:
        return y

    def _x(self, load: Vector) -> Vector:
        return self._kkt.apply(load, self._none)[0]

    def _s(self, x: Vector) -> Vector:
        return np.concatenate([np.where(self._bounded, x, 0.0), self.form.G @ x])

    def _load(self, y: Vector) -> Vector:
        n = self.form.g.size
        return y[:n] + self._Gt @ y[n:]

    def product(self, u: Vector) -> Vector:
        return self._s(self._x(self._load(u)))

    def step(self, u: Vector, length: float) -> Vector:
        q = self._s(self._x(self._load(u) - self.form.g)) - u / length
        after = length * (np.clip(q, self.form.lower, self.form.upper) - q)
        after[: self.form.g.size][~self._bounded] = 0.0
        return after

    def answer(self, u: Vector) -> tuple[Vector, Vector]:
        return self._kkt.solve(self._load(u) - self.form.g, self._none)[0], u


class _Projected(Solver):
    """Tolerance: on the judged error itself, measured after every tenth iteration."""

    momentum: ClassVar[bool]

    def obstacle(self, problem: QP) -> str | None:
        rows = problem.b.size + problem.d.size
        return convex_obstacle(problem) or (definite_obstacle(problem) if rows else None)

    def warmup(self) -> None:
        load_all("cpbench_solvers.kernels", KERNELS)
        for E in (np.eye(1), matrices.sparse(np.eye(1))):
            self.run(QP.build(E, -np.ones(1), A=E, b=np.zeros(1), lb=np.zeros(1)))

    def solve(
        self, prepared: QP, budget: Budget, options: ProjectedOptions, start: Any = None, record: Record | None = None
    ) -> SolverOutput:
        form, measure = scaled(prepared, keep_sparse=True), ErrorMeasure(prepared, record, budget.tolerance)
        x, y = (np.zeros(form.g.size), np.zeros(form.lower.size)) if start is None else form.start(start)
        deadline, progress = time.monotonic() + budget.seconds, Progress(STALL)
        limit = budget.iterations or options.max_iterations
        side: ProjectedSide = Dual(form) if form.E.size else PrimalBox(form)
        if isinstance(side, Dual) and not side.regular:
            measure.see(0, form.parts(x, y))
            message = "Q is singular to rounding: the dual function has no gradient; use interior-point-qp"
            return measure.conclude(budget, {"iterations": 0}, Claim.FAILED, message)
        u = side.first(x, y)
        length = options.step / side.lipschitz(u.size)
        ahead, weight, done = u, 1.0, 0
        while True:
            counters = {"iterations": done}
            if done % LOOK == 0 or done < LOOK or done >= limit:
                x, y = side.answer(u)
                answer = form.parts(x, y)
                error = measure.see(done, answer)
                if error <= budget.tolerance:
                    return measure.conclude(budget, counters)
                if done >= limit or time.monotonic() > deadline:
                    message = f"error {measure.least:.1e} after {done} iterations"
                    return measure.conclude(budget, counters, Claim.MAX_ITER, message)
                if done % (LOOK * LOOK) == 0 and np.abs(u).max(initial=0.0) > LARGE:
                    if isinstance(side, Dual):
                        proved = infeasible(prepared, answer[1], answer[2], counters)
                    else:
                        proved = unbounded(prepared, form.D * x, counters)
                    if proved is not None:
                        return proved
                trouble = progress.trouble(done, error)
                if trouble is not None:
                    return measure.conclude(budget, counters, Claim.FAILED, trouble)
            after = side.step(ahead, length)
            done += 1
            if not self.momentum or float((ahead - after) @ (after - u)) > 0.0:  # uphill: begin anew
                weight, ahead = 1.0, after
            else:
                larger = 0.5 * (1.0 + np.sqrt(1.0 + 4.0 * weight * weight))
                ahead = after + (weight - 1.0) / larger * (after - u)
                weight = larger
            u = after


_spec = partial(
    SolverSpec, node="qp", method="projected gradient", traits=ITERATIVE, options=ProjectedOptions, by_default=False
)


@register
class ProjectedGradient(_Projected):
    """Steps of 1/L; with rows this is Uzawa's method on the dual."""

    momentum = False
    spec: ClassVar[SolverSpec] = _spec(
        name="projected-gradient",
        summary="projected gradient on the box, Uzawa's method on the dual where there are rows",
        citation="Goldstein 1964; Levitin and Polyak 1966; Uzawa 1958",
    )


@register
class Nesterov(_Projected):
    """Steps of 1/L with momentum, which begins anew when it goes uphill."""

    momentum = True
    spec: ClassVar[SolverSpec] = _spec(
        name="nesterov-qp",
        summary="accelerated projected gradient with restart, on the box or on the dual where there are rows",
        citation="Nesterov 1983; Beck and Teboulle 2009, SIAM J. Imaging Sci. 2:183; O'Donoghue and Candès 2015",
    )
