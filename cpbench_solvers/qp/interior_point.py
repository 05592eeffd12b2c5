"""Mehrotra's predictor-corrector for convex QPs with bounds, inequalities and equalities, dense and sparse."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.programs import QP
from cpbench.foundation.matrices import Vector, max_abs
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register
from cpbench.solvers.shared.progress import Progress, next_stop, reduced
from cpbench_solvers.kernels import qp_interior
from cpbench_solvers.qp.claims import ErrorMeasure, Parts, convex_obstacle, infeasible, unbounded
from cpbench_solvers.qp.kkt_system import KKT, Entries
from cpbench_solvers.qp.polish import polish
from cpbench_solvers.qp.presolve import SparseQP, presolved, sparse_data
from cpbench_solvers.qp.scaling import Scales, sparse_scaled

STALL = 12
"""Least number of iterations without gain of the judged error that ends a run."""
LARGE = 1e5
"""Iterates beyond this, in data of size one, may be on their way along a ray: a proof is looked for, and again when
they have grown as much again."""
ENOUGH = 0.02
"""Of the gap that the tolerance allows: products tz far below it cost accuracy of the linear systems."""
FLOOR, GAINED = 2.0, 0.95
"""tᵀz within this factor of ENOUGH has come to its end. Where the error is above the tolerance and has not fallen by a
twentieth, it is far above tᵀz over its size, and tᵀz has to be less."""
NEAR = 10.0
"""The judged error is measured when tᵀz, which is cheap, is within this factor of the tolerance."""
SURE = 0.3
"""Error, over the tolerance, up to which an answer is good enough at once: units that a verdict finds by itself differ
a little, and so do those of a problem that this one was made from. Else one more iteration is made, a few digits."""
CLOSE_BY = 1e-3
"""An answer with an error below this names an active set on which the last digits are looked for."""
CHUNK, OPERATIONS = 20, 1e8
"""Iterations between looks at the clock, and operations of factorizations: the fewer of both, but one iteration."""


@dataclass(frozen=True)
class QPInteriorPointOptions:
    """Options of interior-point-qp. `regularization` : of the linear systems, data scaled to size one. `to_boundary`
    : share of the step to the boundary. `max_iterations` : predictor and corrector count once."""

    regularization: float = 1e-9
    to_boundary: float = 0.995
    max_iterations: int = 200


class Path:
    """The iterates on one problem: x, and y of (x, Gx), the multipliers of lower sides less those of upper ones.

    chunk : iterations between looks at the clock. seconds : that one takes, about.
    """

    def __init__(self, scales: Scales, H: Entries, G: Entries, options: QPInteriorPointOptions) -> None:
        n, N = scales.g.size, scales.lower.size
        self._kernel = qp_interior
        self._options = options
        kkt = KKT(H, G, options.regularization, (scales.lower == scales.upper)[n:])
        self.chunk, self.seconds = max(int(min(CHUNK, OPERATIONS / max(kkt.operations, 1.0))), 1), kkt.seconds
        self.x, self.y = np.zeros(n), np.zeros(N)
        sides, work = np.zeros((2, 2 * N)), np.zeros(21 * N)
        iterate = self.x, self.y, sides[0], sides[1], np.zeros(n), work
        self._data = kkt.H, kkt.G, scales.g, scales.lower, scales.upper, _least_size(scales, H), kkt.system, iterate
        self.stops: Any = self._kernel
        self._counts = np.zeros(2, dtype=np.int64)
        self._sizes = np.array([0.0, math.inf, LARGE, options.regularization, self.stops.SOLVED, 0.0])

    @property
    def done(self) -> int:
        """Iterations so far."""
        return int(self._counts[self.stops.DONE])

    def begin(self) -> bool:
        """Go to the first iterate; return False where the linear system breaks down."""
        return self._kernel.begin(*self._data, self._sizes)

    def advance(self, tolerance: float, until: int, *, polish: bool = False) -> int:
        """Make one iteration, and more until there is a reason to come back, which is returned."""
        enough = ENOUGH * tolerance * (tolerance**0.5 if polish else 1.0)
        how = self._options.to_boundary, NEAR * tolerance, enough
        return self._kernel.advance(*self._data, *how, self._counts, self._sizes, until)

    @property
    def gap(self) -> float:
        """The least tᵀz so far, relative to its size."""
        return float(self._sizes[self.stops.BEST])

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

    def solve(
        self,
        prepared: QP,
        budget: Budget,
        options: QPInteriorPointOptions,
        start: Any = None,
        record: Record | None = None,
    ) -> SolverOutput:
        measure, data = ErrorMeasure(prepared, record, budget.tolerance), sparse_data(prepared)
        run = _Run(prepared, data, budget, options, measure, record)
        reduced, whole = presolved(data), (data, _unchanged)
        first = whole if reduced is None else reduced
        output = run.along(*first)
        if reduced is not None and not run.ended(output):  # rays prove something about the whole alone
            output = run.along(*whole)
        return output if run.ended(output) else run.polished(output)


def _least_size(scales: Scales, H: Entries) -> float:
    """Return the least size that a gap is compared with: what a price gains where it meets a curvature, in scaled
    data; without either 1 in the problem's own units."""
    price, curvature = max_abs(scales.g), max_abs(H[2])
    return price * price / curvature if price > 0.0 and curvature > 0.0 else scales.c


def _unchanged(parts: Parts) -> Parts:
    return parts


class _Run:
    """State of a solve: of what presolve has left first, then of the whole."""

    def __init__(
        self,
        problem: QP,
        whole: SparseQP,
        budget: Budget,
        options: QPInteriorPointOptions,
        measure: ErrorMeasure,
        record: Record | None,
    ) -> None:
        self._problem, self._whole, self._budget, self._options = problem, whole, budget, options
        self._measure, self._record = measure, record
        self._deadline = time.monotonic() + budget.seconds
        self._limit, self._done, self._factorizations = budget.iterations or options.max_iterations, 0, 0
        self._next = 0.0

    @property
    def over(self) -> bool:
        """Whether iterations are spent, or the next one would end too late."""
        return self._done >= self._limit or time.monotonic() + self._next > self._deadline

    def ended(self, output: SolverOutput) -> bool:
        """Return whether nothing is left to find, or to find it with."""
        return output.claim is Claim.SOLVED or output.certificate is not None or self.over

    def polished(self, output: SolverOutput) -> SolverOutput:
        """Return the last digits, where linear systems near the boundary have lost them, or what there was."""
        best, least, counters = self._measure.best, self._measure.least, dict(output.counters)
        if best is None or not least < CLOSE_BY:
            return output
        done = polish(self._problem, best, self._measure, self._done + 1, self._budget.tolerance, self._deadline)
        counters["factorizations"] = self._factorizations + done
        return self._measure.conclude(self._budget, counters, output.claim, output.message)

    def along(self, data: SparseQP, lift: Callable[[Parts], Parts]) -> SolverOutput:
        """Follow the path of a problem, this one or what presolve has left of it, from its beginning."""
        scales, H, G = sparse_scaled(data)
        path, progress, measure = Path(scales, H, G, self._options), Progress(STALL), self._measure
        stops, polished, tolerance, earlier = path.stops, False, self._budget.tolerance, self._done
        aim, previous = tolerance, math.inf
        before, self._next = (path.x.copy(), path.y.copy()), path.seconds
        outcome = stops.LIMIT if self.over or path.begin() else stops.BROKEN
        while True:
            self._done = earlier + path.done
            counters = {"iterations": self._done, "factorizations": self._factorizations + path.done + 1}
            last = self.over
            near = last or outcome in (stops.NEAR, stops.STALLED, stops.BROKEN)
            error = math.inf
            if near or self._record is not None:
                error = measure.see(self._done, lift(scales.parts(path.x, path.y)), passing=not near)
            if near and measure.least <= tolerance:
                if last or polished or outcome != stops.NEAR or measure.least <= SURE * tolerance:
                    return measure.conclude(self._budget, counters)
                polished = True
            ended: tuple[Claim, str] | None = None
            if outcome == stops.BROKEN:
                message = f"the linear system broke down at error {measure.least:.1e} after {self._done} iterations"
                ended = Claim.FAILED, message
            elif last:
                message = f"error {measure.least:.1e} after {self._done} iterations of about {path.seconds:.1g} s"
                ended = Claim.MAX_ITER, message
            elif outcome == stops.STALLED:
                ended = Claim.FAILED, f"stalled at {measure.least:.1e} after {self._done} iterations"
            elif outcome == stops.NEAR and (trouble := progress.trouble(path.done, error)) is not None:
                ended = Claim.FAILED, trouble
            if data is self._whole and (outcome in (stops.STALLED, stops.LARGE) or ended is not None):
                proved = _proved(self._problem, scales, path, before, counters)
                if proved is not None:
                    return proved
                path.grown()
            if ended is not None:
                self._factorizations += path.done + 1
                return measure.conclude(self._budget, counters, *ended)
            before = path.x.copy(), path.y.copy()
            until = self._limit - earlier
            if not math.isinf(self._budget.seconds):
                until = min(until, path.done + path.chunk)
            stuck = path.gap <= FLOOR * ENOUGH * aim and error > GAINED * previous
            if near and error > tolerance and (measure.norms <= tolerance or stuck):
                aim = reduced(aim, error, tolerance)
            previous = error if near else math.inf
            outcome = path.advance(aim, next_stop(path.done, until, self._record), polish=polished)


def _proved(
    problem: QP, scales: Scales, path: Path, before: tuple[Vector, Vector], counters: dict[str, int]
) -> SolverOutput | None:
    """Return what the iterate, or its last steps, prove when it goes along a ray for ever."""
    n, m = scales.g.size, problem.b.size
    for x, y in ((path.x, path.y), (path.x - before[0], path.y - before[1])):
        rows = y[n:] * scales.E
        certificate = infeasible(problem, rows[:m], rows[m:], counters) if max_abs(rows) > 1.0 else None
        certificate = certificate or (unbounded(problem, scales.D * x, counters) if max_abs(x) > 1.0 else None)
        if certificate is not None:
            return certificate
    return None
