"""There and back on planted problems: for every ordered pair of nodes, the error that a round trip leaves.

A problem is converted, written to a file and read again; an answer to what was read is lifted through the file's
provenance and measured on the problem it all began with.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cpbench import graph, storage
from cpbench.errors import CpbenchError, NoRoute
from cpbench.formulations import Kind
from cpbench.graph import checking
from cpbench.testing.cases import Case, cases

EQUIVALENT = frozenset({Kind.EQUIVALENT})
ROUNDED = 4 * float(np.finfo(float).eps)
"""Relative size of the changes that tell what rounding alone makes of an error."""
HARDER = (1.0, 1e-2, 1e-4)
"""Shares of what a route asks that solvers are asked for in turn."""
SHARE = 0.1
"""Tolerance for solvers, as a share of that of a cell."""


@dataclass(frozen=True)
class Cell:
    """One ordered pair.

    Attributes
    ----------
    error : the worst on the source, over `cases` planted problems that took a route; `case`, `route` : where.
        None when none took one. ∞ when one could not go there and back.
    pushed : for how many of them no solver's answer was as good as asked, there or here, so that the planted solution
        was pushed instead.
    rounding : error of the planted solution of `case` with its last digits changed; no answer differs from that.
    amplified : cases, with errors here, where the best answer that passed there does not pass here: the lift, or a
        measure that says less there, makes more of it; the planted solution was pushed then.
    reason : why there is no error.
    """

    source: str
    target: str
    error: float | None = None
    case: str = ""
    route: str = ""
    cases: int = 0
    pushed: int = 0
    rounding: float = 0.0
    amplified: tuple[tuple[str, float], ...] = ()
    reason: str = ""

    def exceeds(self, tolerance: float) -> bool:
        return self.error is not None and not self.error <= max(tolerance, self.rounding)

    def __str__(self) -> str:
        if self.error is None:
            return "-"
        mark = "*" if self.pushed == self.cases else "+" if self.pushed else ""
        return f"{self.error:.0e}{mark}"


@dataclass(frozen=True)
class Trip:
    """One problem there and back.

    Attributes
    ----------
    error : on the source. pushed : whether the planted solution had to serve.
    solved : the error of the best solver's answer, which passed there; None when no answer did.
    """

    error: float
    pushed: bool = False
    solved: float | None = None


def measure(nodes: Iterable[str], tolerance: float = 1e-9) -> list[Cell]:
    """Return every ordered pair of two of `nodes` that a path of equivalent conversions joins."""
    wanted = sorted(nodes)
    result: list[Cell] = []
    with tempfile.TemporaryDirectory() as folder:
        for source in wanted:
            trips = RoundTrips(Path(folder), SHARE * tolerance)
            reached = graph.reachable(source, EQUIVALENT)
            result += [trips.cell(source, target) for target in wanted if target in reached and target != source]
    return result


class RoundTrips:
    """Round trips from one node: a conversion that several of them share is made once.

    Parameters
    ----------
    folder : for the converted files. tolerance : on the source that solvers are to reach.
    """

    def __init__(self, folder: Path, tolerance: float) -> None:
        self._folder, self._tolerance = folder, tolerance
        self._conversions = graph.Memory()

    def cell(self, source: str, target: str) -> Cell:
        """Return the worst of the planted cases of `source` that reach `target` by equivalent conversions."""
        worst, count, pushed = Cell(source, target), 0, 0
        amplified: list[tuple[str, float]] = []
        nearest: graph.DeadEnd | None = None
        for case in cases(source):
            try:
                arrival = graph.arrive(case.problem, target, EQUIVALENT, apply=self._conversions)
            except NoRoute:
                dead = graph.explain(case.problem, target, EQUIVALENT, apply=self._conversions)
                nearest = max([*dead, *([nearest] if nearest else [])], key=lambda end: end.done, default=None)
                continue
            here = Cell(source, target, math.inf, case.name, arrival.route.label, cases=1)
            try:
                trip = self._trip(case, arrival)
            except CpbenchError as refusal:
                return replace(here, reason=str(refusal))
            count += 1
            pushed += trip.pushed
            if trip.solved is not None and trip.solved > self._tolerance and trip.pushed:
                amplified.append((case.name, trip.solved))
            if worst.error is None or not trip.error <= worst.error:
                worst = replace(here, error=trip.error, rounding=rounding(case))
        if worst.error is None:
            return replace(worst, reason=f"no planted case takes a route; the nearest: {nearest}")
        return replace(worst, cases=count, pushed=pushed, amplified=tuple(amplified))

    def _trip(self, case: Case, arrival: graph.Arrival) -> Trip:
        """Go there and back by what a solver answers, or by the planted solution where no solver's answer passes here.

        A solver's answer that meets what the route asks may still be coarse on the source where errors are roots of
        others (gaps of a QP) or units are extreme: more is asked then, and the next solver, and the best counts.
        """
        path = self._folder / "converted.h5"
        storage.save(arrival.problem, path, force=True, compress=False)
        read = storage.load(path)
        wanted = graph.tolerance(read, self._tolerance, len(arrival.route.steps))
        least = math.inf
        for share in HARDER:
            for answer in checking.answers(read, max(share * wanted, ROUNDED), [], seconds=1.0):
                least = min(least, case.problem.residuals(graph.lift(read, answer.point)).error)
                if least <= self._tolerance:
                    return Trip(least)
            if least == math.inf:
                break
        planted = case.problem.residuals(graph.lift(read, graph.push(read, case.point))).error
        return Trip(min(least, planted), planted < least, least if least < math.inf else None)


def rounding(case: Case) -> float:
    """Return the largest error of the planted solution after a few relative moves by ROUNDED of every number."""
    rng = np.random.default_rng(0)
    parts = case.point.arrays()
    moved = (
        {name: part * (1.0 + ROUNDED * rng.choice([-1.0, 1.0], part.size)) for name, part in parts.items()}
        for _ in range(8)
    )
    return max(case.problem.residuals(type(case.point)(**point)).error for point in moved)
