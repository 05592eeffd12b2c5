"""Mehrotra's predictor-corrector for convex QPs with bounds, inequalities and equalities, dense and sparse."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.qp import QP
from cpbench.kernel_cache import load
from cpbench.matrices import Vector, max_abs
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register
from cpbench.solvers.native.progress import Progress, next_stop
from cpbench.solvers.native.qp.claims import ErrorMeasure, convex_obstacle, infeasible, unbounded
from cpbench.solvers.native.qp.kkt_system import KKT, Entries
from cpbench.solvers.native.qp.scaling import Scales, sparse_scaled
from cpbench.solvers.options import fixed, searched

STALL = 12
"""Least number of iterations without gain of the judged error that ends a run."""
LARGE = 1e5
"""Iterates beyond this, in data of size one, may be on their way along a ray: a proof is looked for, and again when
they have grown as much again."""
ENOUGH = 0.02
"""Of the gap that the tolerance allows: products tz far below it cost accuracy of the linear systems."""
NEAR = 10.0
"""The judged error is measured when tᵀz, which is cheap, is within this factor of the tolerance."""
POLISH = 3
"""Iterations more, at most, while for some pair it is not decided which of slack and multiplier is 0: the sum of their
products does not tell that, and a verdict on every pair does."""
CHUNK = 20
"""Iterations between looks at the clock."""


@dataclass(frozen=True)
class QPInteriorPointOptions:
    """Options of interior-point-qp. `regularization` : of the linear systems, data scaled to size one. `to_boundary`
    : share of the step to the boundary. `max_iterations` : predictor and corrector count once."""

    regularization: float = searched(1e-9, low=1e-12, high=1e-6, log=True)
    to_boundary: float = searched(0.995, low=0.9, high=0.9999)
    max_iterations: int = fixed(200)


class Path:
    """The iterates on one problem: x, and y of (x, Gx), the multipliers of lower sides less those of upper ones."""

    def __init__(self, scales: Scales, H: Entries, G: Entries, options: QPInteriorPointOptions) -> None:
        n, N = scales.g.size, scales.lower.size
        self._kernel = load("cpbench.solvers.kernels.qp_interior")
        self._options = options
        system = KKT(H, G, options.regularization, (scales.lower == scales.upper)[n:]).system
        self.x, self.y = np.zeros(n), np.zeros(N)
        sides, work = np.zeros((2, 2 * N)), np.zeros(12 * N)
        self._sides = sides
        iterate = self.x, self.y, sides[0], sides[1], np.zeros(n), work
        self._data = H, G, scales.g, scales.lower, scales.upper, scales.c, system, iterate
        self._counts, self._sizes = np.zeros(2, dtype=np.int64), np.array([0.0, math.inf, LARGE])
        self.stops: Any = self._kernel

    @property
    def done(self) -> int:
        """Iterations so far."""
        return int(self._counts[self.stops.DONE])

    def begin(self) -> bool:
        """Go to the first iterate; return False where the linear system breaks down."""
        return self._kernel.begin(*self._data, self._options.regularization, self._sizes)

    def advance(self, tolerance: float, until: int, *, polish: bool = False) -> int:
        """Make one iteration, and more until there is a reason to come back, which is returned."""
        enough = ENOUGH * tolerance * (tolerance**0.5 if polish else 1.0)
        how = self._options.regularization, self._options.to_boundary, NEAR * tolerance, enough
        return self._kernel.advance(*self._data, *how, self._counts, self._sizes, until)

    def undecided(self) -> float:
        """Return the largest of the pairs' smaller numbers, in data of size one."""
        t, z = self._sides
        return float(np.minimum(t, z).max(initial=0.0))

    def grown(self) -> None:
        """Let the iterate grow by LARGE before the next proof is looked for."""
        self._sizes[self.stops.BAR] = LARGE * max(max_abs(self.x), max_abs(self.y))


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
        E = np.eye(1)
        self.run(QP.build(E, -np.ones(1), A=E, b=np.zeros(1), lb=np.zeros(1)))

    def solve(
        self,
        prepared: QP,
        budget: Budget,
        options: QPInteriorPointOptions,
        start: Any | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        scales, H, G = sparse_scaled(prepared)
        measure, path = ErrorMeasure(prepared, record), Path(scales, H, G, options)
        deadline, progress = time.monotonic() + budget.seconds, Progress(STALL)
        limit, stops, polished = budget.iterations or options.max_iterations, path.stops, 0
        before = path.x.copy(), path.y.copy()
        outcome = stops.LIMIT if path.begin() else stops.BROKEN
        while True:
            counters = {"iterations": path.done, "factorizations": path.done + 1}
            last = path.done >= limit or time.monotonic() > deadline
            answer = scales.parts(path.x, path.y)
            near = last or outcome in (stops.NEAR, stops.STALLED, stops.BROKEN)
            error = measure.see(path.done, answer, passing=not near) if near or record is not None else math.inf
            if near and measure.least <= budget.tolerance:
                enough = last or outcome != stops.NEAR or polished == POLISH or error > measure.least
                if enough or path.undecided() <= budget.tolerance:
                    return measure.conclude(budget, counters)
                polished += 1
            if outcome == stops.BROKEN:
                message = f"the linear system broke down at error {measure.least:.1e} after {path.done} iterations"
                return measure.conclude(budget, counters, Claim.FAILED, message)
            if last:
                message = f"error {measure.least:.1e} after {path.done} iterations"
                return measure.conclude(budget, counters, Claim.MAX_ITER, message)
            trouble = progress.trouble(path.done, error) if outcome == stops.NEAR else None
            if outcome == stops.STALLED:
                trouble = f"stalled at {measure.least:.1e} after {path.done} iterations"
            if trouble is not None or outcome == stops.LARGE:
                proved = _proved(prepared, scales, path, before, counters)
                if proved is not None:
                    return proved
                path.grown()
            if trouble is not None:
                return measure.conclude(budget, counters, Claim.FAILED, trouble)
            before = path.x.copy(), path.y.copy()
            until = limit if math.isinf(budget.seconds) else min(limit, path.done + CHUNK)
            outcome = path.advance(budget.tolerance, next_stop(path.done, until, record), polish=polished > 0)


def _proved(
    problem: QP, scales: Scales, path: Path, before: tuple[Vector, Vector], counters: dict[str, int]
) -> SolverOutput | None:
    """Return what the iterate, or its last steps, prove when it goes along a ray for ever."""
    n, m = scales.g.size, problem.b.size
    for x, y in ((path.x, path.y), (path.x - before[0], path.y - before[1])):
        rows = y[n:] * scales.E
        found = infeasible(problem, rows[:m], rows[m:], counters) if max_abs(rows) > 1.0 else None
        found = found or (unbounded(problem, scales.D * x, counters) if max_abs(x) > 1.0 else None)
        if found is not None:
            return found
    return None
