"""Primal active set for convex dense QPs: feasible iterates, equality-constrained steps in the null space."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import scipy.linalg as sla
from scipy.linalg import blas, lapack

from cpbench.formulations.qp import QP
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Vector, max_abs
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register
from cpbench_solvers.qp.claims import ErrorMeasure, convex_obstacle, dense_obstacle, infeasible, unbounded, warm_up
from cpbench_solvers.qp.dual_active_set import ActiveSet
from cpbench_solvers.qp.scaling import ScaledQP, scaled

DEPENDENT = 1e-9
"""A row whose part outside the span of the working set is shorter than this, relative to it, depends on it."""
BINDING = 1e-9
"""A row of a start is at its bound when it is this near, data scaled to size one."""
STILL = 1e-10
"""A step shorter than this, relative to x, ends the work on a working set."""
PARALLEL = 1e-11
"""A row does not block a step whose change in it is below this, relative to both lengths."""


@dataclass(frozen=True)
class PrimalActiveSetOptions:
    """Options of primal-active-set. `shift` : εI added to the reduced Hessian, by the size of Q, so that a singular
    one can be solved. `max_iterations` : 0 stands for 50(n + rows)."""

    shift: float = 1e-10
    max_iterations: int = 0


class WorkingSet:
    """Rows of (I, G) that hold as equalities, with the QR factorization of their transpose. side : (n + r,) 1 at a
    lower bound, -1 at an upper one, 0 for equalities."""

    def __init__(self, form: ScaledQP, wanted: Vector) -> None:
        n = form.g.size
        self.rows = np.vstack([np.eye(n), matrices.dense(form.G)])
        self.equal, self.side = form.lower == form.upper, np.zeros(form.lower.size)
        first, later = np.flatnonzero(self.equal), np.flatnonzero((wanted != 0.0) & ~self.equal)
        self.indices = np.concatenate([first, later])
        self.side[later] = np.sign(wanted[later])
        self.Q, self.R = sla.qr(self.rows[self.indices].T)
        size = np.linalg.norm(self.rows[self.indices], axis=1)
        while self.indices.size:
            diagonal = np.zeros(self.indices.size)
            diagonal[: min(n, diagonal.size)] = abs(np.diag(self.R))
            dependent = np.flatnonzero(diagonal <= DEPENDENT * size)
            if not dependent.size:
                break
            self.indices, size = np.delete(self.indices, dependent[0]), np.delete(size, dependent[0])
            self.Q, self.R = sla.qr(self.rows[self.indices].T)

    def multipliers(self, gradient: Vector) -> Vector:
        """Return (n + r,), by least squares."""
        y, count = np.zeros(self.side.size), self.indices.size
        if count:
            y[self.indices] = sla.solve_triangular(self.R[:count], self.Q[:, :count].T @ gradient)
        return y

    def step(self, H: Vector, gradient: Vector, shift: float) -> Vector | None:
        """Step to the minimiser over the null space; None where the reduced Hessian is not semidefinite."""
        Z = self.Q[:, self.indices.size :]
        if not Z.shape[1]:
            return np.zeros_like(gradient)
        reduced = blas.dgemm(1.0, Z, H @ Z, trans_a=True)
        reduced[np.diag_indices_from(reduced)] += shift
        _, p, info = lapack.dposv(reduced, -(Z.T @ gradient))
        return Z @ p if info == 0 else None

    def add(self, index: int, side: float) -> None:
        self.Q, self.R = sla.qr_insert(self.Q, self.R, self.rows[index], self.indices.size, which="col")
        self.indices, self.side[index] = np.append(self.indices, index), side

    def drop(self, index: int) -> None:
        place = int(np.flatnonzero(self.indices == index)[0])
        self.Q, self.R = sla.qr_delete(self.Q, self.R, place, which="col")
        self.indices = np.delete(self.indices, place)


@register
class PrimalActiveSet(Solver):
    """The start is projected on the constraints, which proves that there is a point or that there is none; then every
    step stays feasible and lowers the objective. When steps have length 0 for long, the lowest index enters and leaves.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="primal-active-set",
        node="qp",
        summary="primal active set in the null space, feasible iterates, dense, Q semidefinite",
        method="primal active set",
        citation="Fletcher 1971, IMA J. Appl. Math. 7:76; Gill and Murray 1978, Math. Programming 14:349",
        traits=frozenset({Trait.WARM_START, Trait.HISTORY, Trait.DETERMINISTIC}),
        options=PrimalActiveSetOptions,
        by_default=False,
    )

    def obstacle(self, problem: QP) -> str | None:
        return dense_obstacle(problem) or convex_obstacle(problem)

    def warmup(self) -> None:
        warm_up(self)

    def solve(
        self,
        prepared: QP,
        budget: Budget,
        options: PrimalActiveSetOptions,
        start: Any = None,
        record: Record | None = None,
    ) -> SolverOutput:
        measure, form = ErrorMeasure(prepared, record, budget.tolerance), scaled(prepared)
        n, m = form.g.size, prepared.b.size
        H, limit = matrices.dense(form.H), budget.iterations or options.max_iterations or 50 * form.lower.size + 50
        deadline = time.monotonic() + budget.seconds
        x, y = (np.zeros(n), np.zeros(form.lower.size)) if start is None else form.start(start)
        s = np.concatenate([x, form.G @ x])
        near = np.clip(s, form.lower, form.upper)
        phase = ActiveSet(np.eye(n), matrices.dense(form.G), form.lower, form.upper, 1e-12)
        if max_abs(s - near) > BINDING * max(1.0, max_abs(s)):
            phase.begin(-x, None)
            outcome = phase.climb(limit, deadline, None)
            x, y = phase.x(), phase.multipliers()
            if outcome != phase.stops.SOLVED:
                counters = {"iterations": phase.passes}
                rows = y[n:] * form.E
                measure.see(0, form.parts(np.zeros(n), np.zeros_like(y)))
                proved = infeasible(prepared, rows[:m], rows[m:], counters)
                claim = Claim.MAX_ITER if outcome == phase.stops.LIMIT else Claim.FAILED
                return proved or measure.conclude(budget, counters, claim, "found no point that meets the constraints")
        else:
            phase.begin(
                -x, np.where(abs(s - np.where(y > 0.0, form.lower, form.upper)) <= BINDING * (1.0 + abs(s)), y, 0.0)
            )
            phase.build(deadline)
            y = phase.multipliers()  # of rows that do not depend on each other
        return self._descend(prepared, form, H, x, WorkingSet(form, y), measure, budget, options.shift, limit, deadline)

    @staticmethod
    def _descend(
        problem: QP,
        form: ScaledQP,
        H: Vector,
        x: Vector,
        working: WorkingSet,
        measure: ErrorMeasure,
        budget: Budget,
        shift: float,
        limit: int,
        deadline: float,
    ) -> SolverOutput:
        shift *= max_abs(H) or 1.0
        lengths = np.linalg.norm(working.rows, axis=1)
        idle, done = 0, 0
        while True:
            counters = {"iterations": done}
            gradient = H @ x + form.g
            y = working.multipliers(gradient)
            wrong = np.flatnonzero(working.side * y < -1e-14 * max(max_abs(y), max_abs(gradient)))
            p = working.step(H, gradient, shift)
            size = max_abs(p) if p is not None else np.inf
            answer = form.parts(x, np.where(working.side * y < 0.0, 0.0, y))
            still = size <= STILL * max(max_abs(x), 1e-300)
            ended = still and not wrong.size
            last = done >= limit or time.monotonic() > deadline or p is None
            error = measure.see(done, answer, passing=not (ended or last or still))
            if error <= budget.tolerance and (ended or last or still):
                return measure.conclude(budget, counters)
            if ended or p is None:
                return measure.conclude(budget, counters, Claim.FAILED, f"ended at {error:.1e} after {done} iterations")
            if last:
                return measure.conclude(budget, counters, Claim.MAX_ITER, f"error {error:.1e} after {done} iterations")
            done += 1
            if still:
                gain = -(working.side * y)[wrong] / lengths[wrong]
                out = wrong[0] if idle > form.lower.size else wrong[int(np.argmax(gain))]
                working.drop(int(out))
                continue
            s, change = working.rows @ x, working.rows @ p
            change[working.indices] = 0.0
            change[abs(change) <= PARALLEL * lengths * np.linalg.norm(p)] = 0.0
            bound = np.where(change < 0.0, form.lower, form.upper)
            with np.errstate(divide="ignore", invalid="ignore"):
                reach = np.where(change != 0.0, np.maximum((bound - s) / change, 0.0), np.inf)
            block = int(np.argmin(reach))
            alpha = min(1.0, float(reach[block]))
            x = x + alpha * p
            if reach[block] < 1.0:
                working.add(block, 1.0 if change[block] < 0.0 else -1.0)
                if block < x.size:
                    x[block] = bound[block]
            elif (endless := unbounded(problem, form.D * p, counters)) is not None:
                return endless
            idle = idle + 1 if alpha == 0.0 else 0
