"""The record of a search: a plan file that runs the tuned solver beside its default one, and tells how it came."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from cpbench.advice.tuning.score import NAME
from cpbench.advice.tuning.search import SearchResult
from cpbench.bench.planning.plan import Entry
from cpbench.bench.planning.plan_text import beside, lines
from cpbench.bench.planning.run_plan import ProblemSet
from cpbench.bench.planning.tunings import Tuning
from cpbench.solvers.options import written

METHOD = "random search, successive halving"
OTHER = {"dev": "test", "test": "dev", "": ""}


def tuning(found: SearchResult, part: ProblemSet, budget: float, seed: int) -> Tuning:
    """Return what a plan and its results tell of a search."""
    return Tuning(
        solver=as_text(found.entry),
        method=METHOD,
        score=NAME,
        found=str(found.score),
        default=str(found.default),
        seed=seed,
        budget=budget,
        spent=round(found.seconds, 3),
        configurations=found.configurations,
        solves=found.solves,
        split=part.split,
        problems=found.problems,
    )


def as_text(entry: Entry) -> str:
    """Return a solver as it is named on the command line."""
    given = ",".join(f"{name}={written(value)}" for name, value in sorted(entry.options.items()))
    return f"{entry.solver}[{given}]" if given else entry.solver


def plan_text(tuning: Tuning, default: Entry, part: ProblemSet, threads: int, folder: Path) -> str:
    """Write the plan: both configurations on the problems of the other half."""
    keys: dict[str, Any] = {
        "problems": [beside(folder, text) for text in part.problems],
        "split": OTHER[part.split] or "all",
        "solvers": list(dict.fromkeys([as_text(default), tuning.solver])),
        "tolerance": list(part.tolerance),
        "timeout": part.timeout,
        "memory": part.memory,
        "threads": threads,
    }
    chosen = {"family": list(part.family), "where": part.where, "keyword": part.keyword, "format": part.format}
    keys |= {name: value for name, value in chosen.items() if value}
    about = [f"# {tuning.solver}, tuned for {tuning.spent:.3g} s: {tuning.found}", f"# by default: {tuning.default}"]
    return "\n".join([*about, *lines(keys), "", "[[tuning]]", *lines(tuning.as_data())]) + "\n"
