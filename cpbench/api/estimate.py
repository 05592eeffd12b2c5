"""How long a run will take, said before it starts, as a range.

Two measurements make it: what solves took where `solve_times.json` was measured, and what a pair costs on this machine
beside its solves, from a results file that is here. The table has the seconds of labels that solved a built-in problem
by an exact route, by fingerprint; null is a failure. A label that failed there, or is not in it (approximate routes,
other versions), takes as long as the average of those that solved the same problem, or as long as the slowest of them:
that is the range.
"""

from __future__ import annotations

import json
import platform
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import TypeAlias

from cpbench.bench.planning.plan import Pair
from cpbench.bench.planning.quantities import duration
from cpbench.bench.planning.run_plan import RunPlan
from cpbench.bench.results.store import Store
from cpbench.foundation.plurals import counted

BEFORE = ("quick.sqlite", "standard.sqlite", "builtin.sqlite")
"""Results of the suites, where a run without `--output` leaves them."""
ENOUGH = 20
"""Pairs that say something."""
SolveTimes: TypeAlias = Mapping[str, Mapping[str, float | None]]
"""Seconds of each label on a problem, by the problem's fingerprint; None where it did not solve it."""


@dataclass(frozen=True)
class Span:
    """The least and the most that something may take [s]."""

    low: float
    high: float

    def __add__(self, other: Span) -> Span:
        return Span(self.low + other.low, self.high + other.high)

    def __mul__(self, factor: float) -> Span:
        return Span(self.low * factor, self.high * factor)

    def __str__(self) -> str:
        low, high = duration(self.low), duration(self.high)
        return f"about {high}" if low == high else f"{low} to {high}"


NOTHING = Span(0.0, 0.0)


def estimate(todo: Sequence[Pair], plan: RunPlan) -> str:
    """Return how long the pairs may take, as text, and what that rests on; '' where nothing like it was measured."""
    spans, measured = solves(todo, shipped_times())
    known = [span for span in spans if span is not None]
    if len(known) < ENOUGH:
        return ""
    solving = sum(known, NOTHING) * (len(todo) / len(known) / plan.jobs)
    basis = f"{measured} of {counted(len(todo), 'pair')} were timed, on another machine"
    for path in dict.fromkeys([plan.results, *map(Path, BEFORE)]):
        beside = _beside(path) if path.is_file() else []
        if len(beside) >= ENOUGH:
            mean, run = statistics.mean(beside), sum(span != NOTHING for span in spans)
            total = solving + Span(mean, mean) * (run / plan.jobs)
            return f"{total} ({basis}; beside solves one took {mean:.2g} s in {path}, on this one)"
    return f"{solving} for solves, and more to start solvers, convert and judge ({basis})"


def shipped_times() -> SolveTimes:
    """Return the seconds of each label on the built-in problems, measured where this version was made."""
    return json.loads(files("cpbench.api").joinpath("solve_times.json").read_text(encoding="utf-8"))["seconds"]


def solves(todo: Sequence[Pair], known: SolveTimes) -> tuple[list[Span | None], int]:
    """Return what the solves of each pair may take, None where no solver solved its problem; how many were timed.

    A label that was started on other problems, and not on this one, could not be run on it.
    """
    labels, measured = {label for times in known.values() for label in times}, 0
    spans: list[Span | None] = []
    for pair in todo:
        outcomes = known.get(pair.fingerprint, {})
        solved = [_repeated(time, pair) for time in outcomes.values() if time is not None]
        time = outcomes.get(pair.label)
        if not solved:
            spans.append(None)
        elif time is not None:
            measured += 1
            spans.append(Span(*[_repeated(time, pair)] * 2))
        elif pair.label in labels and pair.label not in outcomes:
            spans.append(NOTHING)
        else:
            spans.append(Span(statistics.mean(solved), max(solved)))
    return spans, measured


def _repeated(time: float, pair: Pair) -> float:
    """Return what a solve takes with its repeats, within its limit."""
    return time * pair.limits.repeats if time < pair.limits.repeat_below else min(time, pair.limits.seconds)


def _beside(path: Path) -> list[float]:
    """Return what pairs took beside their solves in a results file [s], of those that were run on this machine."""
    with Store(path) as store:
        return [
            max(0.0, row.wall - row.solve * (row.repeats or 1))
            for row in store.rows()
            if row.wall is not None and row.solve is not None and row.host == platform.node()
        ]
