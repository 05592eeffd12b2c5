"""Dual active set of Goldfarb and Idnani for strictly convex dense QPs, violated rows joining several at once."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from scipy.linalg import blas, lapack

from cpbench.formulations.programs import QP
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Dense, Vector
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register
from cpbench.solvers.shared.progress import SHARE
from cpbench_solvers.kernels import qp_dual
from cpbench_solvers.qp.claims import (
    ErrorMeasure,
    convex_obstacle,
    definite_obstacle,
    dense_obstacle,
    infeasible,
)
from cpbench_solvers.qp.scaling import stacked

CHUNK = 200_000_000
"""Operations between looks at the clock, a tenth of a second or two."""


@dataclass(frozen=True)
class DualActiveSetOptions:
    """Options of dual-active-set. `feasibility_tolerance` : relative, on rows outside the working set. `max_passes`
    : 0 stands for 50(n + rows)."""

    feasibility_tolerance: float = 1e-11
    max_passes: int = 0


class ActiveSet:
    """min ½xᵀHx + gᵀx subject to lower ≤ Gx ≤ upper and bounds on x, H = UᵀU, in the coordinates v = Ux.

    H : (n, n). G : (r, n), C-ordered. lower, upper : (n + r,), of x and then of Gx. Raises LinAlgError where H is not
    positive definite.
    """

    def __init__(self, H: Dense, G: Dense, lower: Vector, upper: Vector, tolerance: float) -> None:
        n = H.shape[0]
        self._kernel = qp_dual
        self._tolerance = tolerance
        self._U, info = lapack.dpotrf(H.T)
        if info != 0:
            raise np.linalg.LinAlgError(f"the leading block of size {info} is not positive definite")
        self._kept = np.flatnonzero(np.isfinite(lower) | np.isfinite(upper))
        self._boxed = self._kept[: np.searchsorted(self._kept, n)]
        M = np.empty((self._kept.size, n))
        if self._boxed.size:
            M[: self._boxed.size] = lapack.dtrtri(self._U)[0][self._boxed]
        if G.shape[0]:
            M[self._boxed.size :] = blas.dtrsm(1.0, self._U, G.T, trans_a=1).T
        N = self._kept.size
        self._norms = np.empty(N)
        self._kernel.normalise(M, self._norms)
        by = np.where(self._norms > 0.0, self._norms, 1.0)
        self._rows = M, lower[self._kept] / by, upper[self._kept] / by
        self._by = by
        self._v, self._y = np.empty(n), np.zeros(N)
        integers = np.empty((3, max(N, n)), dtype=np.int64)
        self._factors = np.empty((n, n)), integers[0, :n], integers[1, :N], integers[2, :N]
        self._state = np.zeros(self._kernel.STATES, dtype=np.int64)
        self._gained, self._before, self._work = np.empty(2), np.empty(N), np.empty(3 * n + N)
        self._size, self._x_bounds = lower.size, (lower[:n], upper[:n])

    def begin(self, g: Vector, y: Vector | None) -> None:
        """Begin from the multipliers y (n + r,) of another run, or from none."""
        self._v0 = -blas.dtrsv(self._U, g, trans=1)
        self._y[:] = 0.0 if y is None else y[self._kept] * self._by
        self._gained[0] = -1.0
        passes = self.passes
        self._state[:] = 0
        self._state[self._kernel.PASSES], self._state[self._kernel.PART] = passes, self._kernel.FIRST_PART
        self._kernel.begin(self._rows[0], self._v0, self._v, self._y, self._factors[2], self._state)

    def _advance(self, until: int) -> int:
        iterate = *self._rows, self._v0, self._v, self._y, *self._factors
        kept = self._state, self._gained, self._before, self._work
        return self._kernel.advance(*iterate, *kept, until, CHUNK, self._tolerance)

    def climb(self, limit: int, deadline: float, watch: Callable[[], object] | None) -> int:
        """Return an outcome, LIMIT after `limit` passes in all or when time is out; calls `watch` now and then."""
        while True:
            done = self.passes
            until = limit if watch is None else min(limit, done + 1 + done // SHARE)
            outcome = self._advance(until)
            if outcome != self.stops.LIMIT or self.passes >= limit or time.monotonic() > deadline:
                return outcome
            if watch is not None:
                watch()

    @property
    def passes(self) -> int:
        return int(self._state[self._kernel.PASSES])

    @property
    def stops(self) -> Any:
        """Names of the outcomes of `climb`."""
        return self._kernel

    def x(self) -> Vector:
        """Return U⁻¹v, exactly at its bounds where they are in the working set."""
        x = blas.dtrsv(self._U, self._v)
        y = self._y[: self._boxed.size]
        at = self._boxed[y != 0.0]
        if at.size:
            x[at] = np.where(y[y != 0.0] > 0.0, self._x_bounds[0][at], self._x_bounds[1][at])
        return x

    def multipliers(self) -> Vector:
        """Return (n + r,), positive at lower bounds and negative at upper ones; after INFEASIBLE the ray."""
        y = np.zeros(self._size)
        y[self._kept] = self._y / self._by
        return y


@register
class DualActiveSet(Solver):
    """A working set grows from none; its multipliers keep their signs, and the dual objective rises at every pass.

    Tolerance: the method ends at a vertex of the working set, which is exact to rounding; the judged error decides.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="dual-active-set",
        node="qp",
        summary="dual active set with factor updates, dense, Q positive definite",
        method="dual active set",
        citation="Goldfarb and Idnani 1983, Math. Programming 27:1",
        traits=frozenset({Trait.WARM_START, Trait.HISTORY, Trait.DETERMINISTIC}),
        options=DualActiveSetOptions,
    )

    def obstacle(self, problem: QP) -> str | None:
        return dense_obstacle(problem) or convex_obstacle(problem) or definite_obstacle(problem)

    def solve(
        self,
        prepared: QP,
        budget: Budget,
        options: DualActiveSetOptions,
        start: Any = None,
        record: Record | None = None,
    ) -> SolverOutput:
        problem, measure = prepared, ErrorMeasure(prepared, record, budget.tolerance)
        n, m, k = problem.p.size, problem.b.size, problem.d.size
        lower, upper, G = stacked(problem)
        try:
            method = ActiveSet(matrices.dense(problem.Q), G, lower, upper, options.feasibility_tolerance)
        except np.linalg.LinAlgError as cause:
            measure.see(0, (np.zeros(n), np.zeros(m), np.zeros(k), np.zeros(n)))
            return measure.conclude(budget, {"iterations": 0}, Claim.FAILED, f"Q: {cause}: use proximal-active-set")

        def look(passing: bool = True) -> float:
            y = method.multipliers()
            return measure.see(method.passes, (method.x(), y[n : n + m], y[n + m :], y[:n]), passing=passing)

        method.begin(problem.p, None if start is None else np.concatenate([start.nu, start.lam, start.mu]))
        if record is not None:
            look()
        limit = budget.iterations or options.max_passes or 50 * (n + m + k) + 50
        outcome = method.climb(limit, time.monotonic() + budget.seconds, None if record is None else look)
        counters = {"iterations": method.passes}
        stops = method.stops
        if outcome == stops.INFEASIBLE:
            y = method.multipliers()
            proved = infeasible(problem, y[n : n + m], y[n + m :], counters)
            if proved is not None:
                return proved
            method.begin(problem.p, None)
        error = look(passing=False)
        claims = {
            stops.LIMIT: (Claim.MAX_ITER, f"{method.passes} passes"),
            stops.INFEASIBLE: (Claim.FAILED, "the dual objective seems unbounded, and nothing proves it"),
            stops.STALLED: (Claim.FAILED, f"stalled at {error:.1e} after {method.passes} passes"),
        }
        return measure.conclude(budget, counters, *claims.get(outcome, (None, "")))
