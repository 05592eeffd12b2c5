"""Mehrotra's predictor-corrector for convex QPs with bounds, inequalities and equalities, dense and sparse."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, TypeAlias

import numpy as np

from cpbench import matrices
from cpbench.formulations.qp import QP
from cpbench.matrices import Vector, max_abs
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register
from cpbench.solvers.native.progress import Progress
from cpbench.solvers.native.qp.claims import ErrorMeasure, convex_obstacle, infeasible, unbounded
from cpbench.solvers.native.qp.kkt_system import KKT, DenseKKT, SparseKKT
from cpbench.solvers.native.qp.scaling import ScaledQP, scaled
from cpbench.solvers.options import fixed, searched

STALL = 12
"""Least number of iterations without gain that ends a run."""
FIXED = 1e12
"""What stands on the diagonal for an unknown whose bounds are equal."""
LARGE = 1e3
"""Iterates beyond this, in data of size one, may be on their way along a ray: proofs are looked for."""
ENOUGH = 0.02
"""Of the gap that the tolerance allows: products tz far below it cost accuracy of the linear systems."""
INSIDE = 0.1
"""Least slacks and multipliers at the start, data scaled to size one."""
NEAR = 10.0
"""The judged error is measured when tᵀz, which is cheap, is within this factor of the tolerance."""
SMALL = 64
"""Sparse problems with at most this many unknowns and rows are taken dense."""


@dataclass(frozen=True)
class QPInteriorPointOptions:
    """Options of interior-point-qp. `regularization` : of the linear systems, data scaled to size one. `to_boundary`
    : share of the step to the boundary. `max_iterations` : predictor and corrector count once."""

    regularization: float = searched(1e-9, low=1e-12, high=1e-6, log=True)
    to_boundary: float = searched(0.995, low=0.9, high=0.9999)
    max_iterations: int = fixed(200)


Solve: TypeAlias = Callable[[Vector, Vector], tuple[Vector, Vector]]


class SlackIterate:
    """x, slacks t and multipliers z of the finite sides of s = (x, Gx), y of all: y = z at lower less z at upper.

    Sides: index `at` into s, `sign` 1 lower, -1 upper; t = sign (s − bound) in the end. Only unknowns have two of them,
    rows may be equalities. size : what tᵀz is compared with, the larger part of the objective.
    """

    def __init__(self, form: ScaledQP, kkt: KKT) -> None:
        self.form, self.kkt = form, kkt
        n = form.g.size
        self.equal = form.lower == form.upper
        low = np.flatnonzero(np.isfinite(form.lower) & ~self.equal)
        high = np.flatnonzero(np.isfinite(form.upper) & ~self.equal)
        self.at = np.concatenate([low, high])
        self.sign = np.concatenate([np.ones(low.size), -np.ones(high.size)])
        self.bound = np.concatenate([form.lower[low], form.upper[high]])
        self.fixed = np.flatnonzero(self.equal[:n])
        self.rows = np.flatnonzero(self.equal[n:])

    def begin(self) -> bool:
        """Return the regularized least-squares point, its slacks and multipliers pushed inside."""
        form, n = self.form, self.form.g.size
        w, theta = np.zeros(n), np.ones(self.equal.size - n)
        w[self.at[self.at < n]] = 1.0
        w[self.fixed], theta[self.rows] = FIXED, 0.0
        if not self.kkt.factor(w, theta):
            return False
        near = np.where(self.equal, form.lower, np.clip(0.0, form.lower, form.upper))
        self.x, v = self.kkt.solve(-form.g + w * near[:n], near[n:])
        self.x[self.fixed] = form.lower[self.fixed]
        self.y = np.concatenate([np.zeros(n), -v])
        gap = self.sign * (self.s()[self.at] - self.bound)
        y = self.sign * self.y[self.at]
        self.t = np.maximum(gap, 0.0) + max(INSIDE, 0.5 * max_abs(np.minimum(gap, 0.0)))
        self.z = np.maximum(y, 0.0) + max(INSIDE, 0.5 * max_abs(np.minimum(y, 0.0)))
        self._gather(self.y[n:][self.rows])
        return True

    def s(self) -> Vector:
        return np.concatenate([self.x, self.form.G @ self.x])

    def _sum(self, sides: Vector) -> Vector:
        """Return the sum of the sides of every s."""
        return np.bincount(self.at, sides, minlength=self.equal.size).astype(np.float64, copy=False)

    def _gather(self, equations: Vector) -> None:
        """Return y of the sides and of the equations, and of fixed unknowns by stationarity."""
        n = self.form.g.size
        self.y = self._sum(self.sign * self.z)
        self.y[n:][self.rows] = equations
        Hx = self.form.H @ self.x
        self.size = max(self.form.c, abs(float(self.x @ Hx)), abs(float(self.x @ self.form.g)))
        self.rd = Hx + self.form.g - self.kkt.Gt @ self.y[n:] - self.y[:n]
        self.y[self.fixed] = self.rd[self.fixed]
        self.rd[self.fixed] = 0.0

    def step(self, share: float, gap: float) -> bool:
        """Take one predictor and corrector step; False where the linear system breaks down. gap : tᵀz that is small
        enough."""
        form, n = self.form, self.form.g.size
        s, t, z, sign, at = self.s(), self.t, self.z, self.sign, self.at
        rp = sign * (s[at] - self.bound) - t
        W = self._sum(z / t)
        W[self.fixed] = FIXED
        theta = np.zeros(s.size - n)
        inner = ~self.equal[n:]
        theta[inner] = 1.0 / W[n:][inner]
        if not self.kkt.factor(W[:n], theta):
            return False
        rows = np.flatnonzero(at >= n)
        off = form.lower[n:][self.rows] - s[n:][self.rows]

        def direction(c: Vector, solve: Solve) -> tuple[Vector, Vector, Vector, Vector]:
            """Solve for tz + t dz + z dt = tz − c: dx, dy of equalities, dt, dz."""
            h = self._sum(-sign * (c + z * rp) / t)
            a = h[:n] - self.rd
            a[self.fixed] = 0.0
            b = theta * h[n:]
            b[self.rows] = off
            dx, v = solve(a, b)
            dx[self.fixed] = 0.0
            ds = np.concatenate([dx, form.G @ dx])
            dt = sign * ds[at] + rp
            dz = -(c + z * dt) / t
            dz[rows] = -sign[rows] * v[at[rows] - n]  # what is left of a row's equation would come times z/t
            return dx, -v[self.rows], dt, dz

        count = max(t.size, 1)
        mu = float(t @ z) / count
        # the predictor only says how far to aim and what the products of its steps are: it is not refined
        dx, dy, dt, dz = direction(t * z, self.kkt.apply if t.size else self.kkt.solve)
        if t.size:
            alpha = min(_reach(t, dt), _reach(z, dz))
            sigma = (float((t + alpha * dt) @ (z + alpha * dz)) / count / mu) ** 3 if mu > 0 else 0.0
            dx, dy, dt, dz = direction(t * z + dt * dz - max(min(sigma, 1.0) * mu, gap / count), self.kkt.solve)
        alpha = min(1.0, share * min(_reach(t, dt, np.inf), _reach(z, dz, np.inf)))
        self.x = self.x + alpha * dx
        self.t, self.z = t + alpha * dt, z + alpha * dz
        self._gather(self.y[n:][self.rows] + alpha * dy)
        return bool(np.isfinite(self.x).all())


@register
class InteriorPoint(Solver):
    """Infeasible primal-dual path following; every iteration factorizes once and solves twice.

    Tolerance: on the judged error itself, measured at every iterate.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="interior-point-qp",
        node="qp",
        summary="Mehrotra predictor-corrector, regularized and refined, dense and sparse",
        method="interior point",
        citation="Mehrotra 1992, SIAM J. Optim. 2:575; Vanderbei 1995, SIAM J. Optim. 5:100",
        traits=frozenset({Trait.SPARSE, Trait.HISTORY, Trait.DETERMINISTIC}),
        options=QPInteriorPointOptions,
    )

    def obstacle(self, problem: QP) -> str | None:
        return convex_obstacle(problem)

    def warmup(self) -> None:
        for n in (1, SMALL + 1):
            E = np.eye(n) if n == 1 else matrices.sparse(np.eye(n))
            self.run(QP.build(E, -np.ones(n), A=E, b=np.zeros(n), lb=np.zeros(n)))

    def solve(
        self,
        prepared: QP,
        budget: Budget,
        options: QPInteriorPointOptions,
        start: Any | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        n = prepared.p.size
        form = scaled(prepared, keep_sparse=n + prepared.b.size + prepared.d.size > SMALL)
        if matrices.is_sparse(form.H):
            kkt: KKT = SparseKKT(form.H, form.G, options.regularization)
        else:
            equal = (form.lower == form.upper)[n:]
            kkt = DenseKKT(matrices.dense(form.H), matrices.dense(form.G), equal, options.regularization)
        measure, iterate = ErrorMeasure(prepared, record), SlackIterate(form, kkt)
        deadline, progress = time.monotonic() + budget.seconds, Progress(STALL)
        limit = budget.iterations or options.max_iterations
        going, done, before = iterate.begin(), 0, (np.zeros(n), np.zeros(form.lower.size))
        while going:
            counters = {"iterations": done, "factorizations": done + 1}
            answer = form.parts(iterate.x, iterate.y)
            last = done >= limit or time.monotonic() > deadline
            error = float(iterate.t @ iterate.z) / iterate.size
            near = last or not error > NEAR * budget.tolerance
            if near:
                error = measure.see(done, answer)
            elif record is not None:
                measure.see(done, answer, passing=True)
            if error <= budget.tolerance:
                return measure.conclude(budget, counters)
            if last:
                message = f"error {measure.least:.1e} after {done} iterations"
                return measure.conclude(budget, counters, Claim.MAX_ITER, message)
            trouble = progress.trouble(done, error)
            if trouble is not None or max(max_abs(iterate.x), max_abs(iterate.y)) > LARGE:
                proved = _proved(prepared, form, iterate, before, counters)
                if proved is not None:
                    return proved
            if trouble is not None:
                measure.see(done, answer)
                return measure.conclude(budget, counters, Claim.FAILED, trouble)
            before = iterate.x, iterate.y
            going = iterate.step(options.to_boundary, ENOUGH * budget.tolerance * iterate.size)
            done += 1
        counters = {"iterations": done, "factorizations": done + 1}
        measure.see(
            done, form.parts(iterate.x, iterate.y) if done else form.parts(np.zeros(n), np.zeros(form.lower.size))
        )
        message = f"the linear system broke down at error {measure.least:.1e} after {done} iterations"
        return measure.conclude(budget, counters, Claim.FAILED, message)


def _proved(
    problem: QP, form: ScaledQP, iterate: SlackIterate, before: tuple[Vector, Vector], counters: dict[str, int]
) -> SolverOutput | None:
    """Return what the iterate, or its last step, proves when it goes along a ray for ever."""
    n, m = form.g.size, problem.b.size
    for x, y in ((iterate.x, iterate.y), (iterate.x - before[0], iterate.y - before[1])):
        rows = y[n:] * form.E
        found = infeasible(problem, rows[:m], rows[m:], counters) if max_abs(rows) > 1.0 else None
        found = found or (unbounded(problem, form.D * x, counters) if max_abs(x) > 1.0 else None)
        if found is not None:
            return found
    return None


def _reach(value: Vector, change: Vector, most: float = 1.0) -> float:
    """Return the largest step up to `most` that keeps value + step·change ≥ 0."""
    fastest = float((-change / value).max(initial=0.0))
    return min(most, 1.0 / fastest) if fastest > 0.0 else most
