"""How long a run will take, said before it starts.

Two measurements make it: what solves took where the table was made that comes with cpbench (and which pairs could not
be run there at all), and what a pair costs on this machine beside its solves, from a results file that is here.
"""

from __future__ import annotations

import math
import platform
import statistics
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path

from cpbench.analysis.experience import from_text
from cpbench.api.evidence import SHIPPED
from cpbench.bench.planning.plan import Pair
from cpbench.bench.planning.quantities import duration
from cpbench.bench.planning.run_plan import RunPlan
from cpbench.bench.results.store import Store
from cpbench.bench.worker import SHORT

BEFORE = ("quick.sqlite", "standard.sqlite", "builtin.sqlite")
"""Results of the suites, where a run without `--output` leaves them."""
ENOUGH = 20
"""Pairs that say something."""


def estimate(todo: Sequence[Pair], asked: RunPlan) -> str:
    """About how long the pairs take, and by what."""
    solves = _solves(todo)
    known = [time for time in solves if not math.isnan(time)]
    if len(known) < ENOUGH:
        return "no estimate: nothing like it was measured before"
    solving = sum(known) / len(known) * len(todo)
    told = f"times of {len(known)} of {len(todo)} pairs come with cpbench, from another machine"
    for path in dict.fromkeys([asked.results, *map(Path, BEFORE)]):
        beside = _beside(path) if path.is_file() else []
        if len(beside) >= ENOUGH:
            mean, run = statistics.mean(beside), sum(time != 0.0 for time in solves)
            total = (solving + mean * run) / asked.jobs
            return f"about {duration(total)} ({told}; beside solves one took {mean:.2g} s in {path}, on this one)"
    return f"about {duration(solving / asked.jobs)} for solves alone ({told})"


def _solves(todo: Sequence[Pair]) -> list[float]:
    """What the solves of each pair took where the table was made [s]; 0 where it could not be run there, NaN where its
    problem was not."""
    text = files("cpbench.analysis").joinpath(SHIPPED).read_text(encoding="utf-8")
    cases = {case.fingerprint: _filled(case.outcomes) for case in from_text(text, SHIPPED).cases}
    return [
        _repeated(cases[pair.fingerprint].get(pair.label, 0.0), pair) if pair.fingerprint in cases else math.nan
        for pair in todo
    ]


def _filled(outcomes: Mapping[str, float]) -> Mapping[str, float]:
    """The times on a problem; who failed has none, and is taken to need as long as the others do on average."""
    solved = [time for time in outcomes.values() if math.isfinite(time)]
    usual = statistics.mean(solved) if solved else 0.0
    return {label: time if math.isfinite(time) else usual for label, time in outcomes.items()}


def _repeated(time: float, pair: Pair) -> float:
    """What a solve takes with its repeats."""
    return time * pair.limits.repeats if time < SHORT else time


def _beside(path: Path) -> list[float]:
    """What pairs took beside their solves in a results file [s], of those that were run on this machine."""
    with Store(path) as store:
        return [
            max(0.0, row["wall"] - row["solve"] * (row["repeats"] or 1))
            for row in store.rows()
            if row["wall"] is not None and row["solve"] is not None and row["host"] == platform.node()
        ]
