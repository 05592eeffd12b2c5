"""Path search in PATH's manner: the path to the zero of the linearized normal map, by pivoting, with a watchdog."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.ncp_functions import fischer_burmeister
from cpbench.foundation.cones import project_box
from cpbench.foundation.matrices import Matrix, Vector, norm
from cpbench.solvers.base import Budget, SolverSpec, register
from cpbench_solvers.lcp.claims import principal
from cpbench_solvers.nonlinear.box_newton import BoxMethod, BoxNewton, CountedBox
from cpbench_solvers.nonlinear.merit_search import ACCEPT, DescentMethod, MeritPoint, fall_back
from cpbench_solvers.nonlinear.normal_path import NormalPath, normal_point
from cpbench_solvers.traits import ITERATIVE

HALVINGS = 6
"""How often a path is cut in half before another direction is looked for."""
SUFFICIENT = 1e-3
WILD = 1e3
"""A watched step may raise the merit by this factor, not more."""
FEW = 0.02
"""The crash phase ends when it changes no more than this share of the active set."""
MANY = 100
"""Problems with fewer unknowns have no crash phase: their paths are short, and less prone to end in a local minimum."""


@dataclass(frozen=True)
class PathSearchOptions:
    """Options of path-search. `crash` : the most projected Newton steps before the first path. `watchdog` : steps
    that may go uphill. `memory` : merits that a search compares with. `max_pivots` : of one path, 0 for 10n + 200.
    `max_iterations` : steps. `restarts` : other starts that are tried in the end."""

    crash: int = 20
    watchdog: int = 4
    memory: int = 5
    max_pivots: int = 0
    max_iterations: int = 1000
    restarts: int = 20


@register
class PathSearch(BoxNewton):
    """Stabilized Newton on the normal map. All points are within the bounds; the merit is Fischer and Burmeister's.

    The end of a path is taken unseen a few times (the watchdog); if the merit has not fallen by then, the path from
    the last good point is searched backwards, then a Levenberg–Marquardt or gradient step is taken. A crash phase of
    projected Newton steps on the active set comes first, which saves pivots.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="path-search",
        node="micp",
        summary="Newton on the normal map along piecewise linear paths found by pivoting, nonmonotone watchdog",
        method="Newton with pivoting",
        citation="Ralph 1994, Math. Oper. Res. 19:352; Dirkse and Ferris 1995, Optim. Methods Softw. 5:123; Ferris, "
        "Kanzow and Munson 1999, Math. Program. 86:475",
        traits=ITERATIVE,
        quick=True,
        options=PathSearchOptions,
    )

    def method(self, box: CountedBox, options: PathSearchOptions, budget: Budget) -> BoxMethod:
        return _PathSearch(box, options, time.monotonic() + budget.seconds)


class _PathSearch(DescentMethod):
    def __init__(self, box: CountedBox, options: PathSearchOptions, deadline: float) -> None:
        super().__init__(box, fischer_burmeister, options.memory, project=True)
        self._options, self._deadline = options, deadline
        self._most = options.max_pivots or 10 * box.n + 200
        self.strategies = 2 if options.crash and box.n >= MANY else 1
        box.counters |= {"pivots": 0, "crash_steps": 0}

    def begin(self, z: Vector, F: Vector, strategy: int) -> None:
        """Begin; the other strategy goes without a crash phase."""
        super().begin(z, F, strategy)
        self._checkpoint, self._watched = self.at, 0
        self._crashing = 0 if strategy or self.box.n < MANY else self._options.crash

    def step(self) -> bool:
        at = self.at
        J = self.box.jacobian(at.z)
        if self._crashing > 0 and J is not None:
            self._crashing -= 1
            crashed = self._crash(at, J)
            if crashed is not None:
                self._good(crashed)
                return True
            self._crashing = 0
        if J is not None:
            end = self._end_of_path(at, J, 1.0)
            if end is not None:
                if end.merit <= ACCEPT * self._checkpoint.merit:
                    self._good(end)
                    return True
                if self._watched < self._options.watchdog and end.merit <= WILD * self._checkpoint.merit:
                    self._watched += 1
                    self._stand(end)
                    return True
        return self._from_checkpoint(at, J)

    def _good(self, at: MeritPoint) -> None:
        self.descent.accept(at)
        self._checkpoint, self._watched = at, 0
        self._stand(at)

    def _crash(self, at: MeritPoint, J: Matrix) -> MeritPoint | None:
        """Return a projected Newton step on the unknowns that are not held at a bound; None when it gains little or
        leaves the active set nearly as it was, so that a path is short."""
        box = self.box
        held = _held(at, box)
        free = np.flatnonzero(~held)
        step = box.solve(principal(J, free), -at.F[free])
        if step is None:
            return None
        d = np.zeros(box.n)
        d[free] = step
        result = self.descent.search(at, d, float(self.descent.gradient(at, J) @ d))
        if result is None:
            return None
        box.counters["crash_steps"] += 1
        changed = int((_held(result, box) != held).sum())
        if changed <= FEW * box.n or result.merit > ACCEPT * at.merit:
            self._crashing = 0
        return result

    def _end_of_path(self, at: MeritPoint, J: Matrix, until: float) -> MeritPoint | None:
        """Return where the path has t = `until`; None when it does not come there."""
        box = self.box
        x = normal_point(at.z, at.F, box.lb, box.ub)
        end = NormalPath(J, at.F, x, box.lb, box.ub).trace(until, self._most, self._deadline)
        if end is None:
            return None
        box.counters["pivots"] += end.pivots
        box.counters["factorizations"] += end.factorizations
        if end.t < until:
            return None
        return self.descent.at(project_box(end.x, box.lb, box.ub))

    def _from_checkpoint(self, at: MeritPoint, J: Matrix | None) -> bool:
        """Go back to the last good point: along its path, along the chord of it, or downhill."""
        descent, good = self.descent, self._checkpoint
        if good is not at:
            J = self.box.jacobian(good.z)
        if J is None:
            return False
        gradient = descent.gradient(good, J)
        reference = descent.reference
        t = 1.0
        for _ in range(HALVINGS):
            end = self._end_of_path(good, J, t)
            if end is not None:
                d = end.z - good.z
                falls = end.merit <= (1.0 - SUFFICIENT * t) * reference and norm(d) > 0.0
                moved = end if falls else descent.search(good, d, float(gradient @ d))
                if moved is not None:
                    self._good(moved)
                    return True
            t *= 0.5
        moved = fall_back(descent, good, J, gradient)
        if moved is None:
            return False
        self._good(moved)
        return True


def _held(at: MeritPoint, box: CountedBox) -> Any:
    """Return which unknowns are at a bound that F pushes against."""
    return ((at.z <= box.lb) & (at.F >= 0)) | ((at.z >= box.ub) & (at.F <= 0))
