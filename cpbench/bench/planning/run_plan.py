"""The plan of a run as requested: sets of problems and solvers, and what all of them share.

The command line makes one, or a plan file does; where both speak, the command line wins. Everything in it is still
as it was written (globs, grids, conditions): `assembly` makes the pairs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from cpbench.bench.planning import settings
from cpbench.bench.planning.places import BUILTIN
from cpbench.bench.planning.plan import Limits
from cpbench.bench.planning.settings import choice, setting
from cpbench.bench.results.store import KEEP
from cpbench.errors import CpbenchError
from cpbench.solvers.base import solvers

QUICK, STANDARD, FULL = "quick", "standard", "full"
SUITES = (QUICK, STANDARD, FULL)
"""Suites of built-in problems, for runs that name no problem: nothing but values of a set, which what is said wins
over.

    quick       ten problems of each formulation of the core, by the solvers of `SolverSpec.quick`: an answer within a
                minute
    standard    all built-in problems, by the same solvers
    full        all built-in problems, by every solver that is installed, approximate routes too
"""
QUICK_SECONDS, QUICK_REPEATED = 5.0, 0.02
"""Limit of a solve of the quick suite, and below what it is repeated [s]: its results are to come within a minute."""


@dataclass(frozen=True)
class ProblemSet:
    """One part of a plan: which problems, by which solvers, how accurately, within which limits.

    Attributes
    ----------
    name : marks its rows. problems : files, folders, packs, globs, or `builtin`. suite : the suite that its problems,
    and the other values not given, are of; empty where problems were named. where : the selection. format : of the
    files. solvers : names, globs and grids, or `all`; none for those of `SolverSpec.by_default`. routes : exact, facets
    or all; empty for exact, and facets where all problems are built in. facets, via : facet counts, pinned conversions.
    start : start policies, one pair each. tolerance : one pair each. measure : the number that decides, None: all.
    timeout [s], memory [bytes], repeats (of solves that take less than `repeat_below` [s]), history : limits of a
    solve.
    """

    name: str = setting("", settings.text)
    problems: tuple[str, ...] = setting((BUILTIN,), settings.some_texts)
    suite: str = choice("", *SUITES)
    where: str = setting("", settings.condition, "CONDITION")
    format: str | None = setting(None, settings.file_format)
    solvers: tuple[str, ...] = setting((), settings.solvers, "NAME[opt=value]")
    routes: str = choice("", "exact", "facets", "all")
    facets: tuple[int, ...] = setting((8, 16), settings.facets, settings.NUMBERS)
    via: tuple[str, ...] = setting((), settings.via, "CONVERSION")
    start: tuple[str, ...] = setting(("cold",), settings.starts, "POLICY")
    tolerance: tuple[float, ...] = setting((1e-6,), settings.tolerances, settings.NUMBERS)
    measure: str | None = setting(None, settings.text)
    timeout: float = setting(Limits.seconds, settings.seconds, settings.DURATION)
    memory: int = setting(Limits.memory, settings.size, settings.SIZE)
    repeats: int = setting(Limits.repeats, settings.whole(1), settings.COUNT)
    repeat_below: float = setting(Limits.repeat_below, settings.seconds)
    history: bool = setting(Limits.history, settings.flag)

    @property
    def chosen(self) -> bool:
        """Return whether somebody named the solvers, which a suite does not."""
        return bool(self.solvers) and not (self.suite and self.solvers == quick_solvers())

    @property
    def builtin(self) -> bool:
        return self.problems == (BUILTIN,)

    @property
    def allowed_routes(self) -> str:
        return self.routes or ("facets" if self.builtin else "exact")

    def limits(self, threads: int) -> Limits:
        return Limits(self.timeout, self.memory, threads, self.repeats, self.history, self.repeat_below)


@dataclass(frozen=True)
class RunPlan:
    """Everything that a run does.

    Attributes
    ----------
    sets : the parts. shard : (i, n), the i-th of n parts of all blocks. seed : of the random order. threads : of every
    library. jobs : number of solves at a time. cluster : other machines. output : results file. report : folder of the
    report, empty for one named after the results, None for no report. rerun : what is run again of an old file (empty:
    nothing). keep : answers to keep. fail_on :
    statuses that make the command end with 1, or `contradiction`.
    """

    sets: tuple[ProblemSet, ...] = (ProblemSet(),)
    shard: tuple[int, int] = setting((1, 1), settings.shard, "I/N")
    seed: int = setting(0, settings.whole(0), settings.COUNT)
    threads: int = setting(1, settings.whole(1), settings.COUNT)
    jobs: int = setting(1, settings.whole(1), settings.COUNT)
    cluster: str | None = setting(None, settings.text, "ADDRESS|KIND")
    output: str = setting("", settings.text, "FILE")
    report: str | None = setting("", settings.report)
    rerun: str = choice("", "failed", "timeouts", "all")
    keep: str = choice("all", *KEEP)
    fail_on: tuple[str, ...] = setting((), settings.failures, "NAMES")

    @property
    def builtin(self) -> bool:
        """Return whether it is the built-in suite, all of it and nothing else."""
        return self.shard == (1, 1) and all(
            part.builtin and part.suite != STANDARD and not part.where for part in self.sets
        )

    @property
    def suite(self) -> str:
        """The name of the suite that the plan runs unchanged, '' for any other plan."""
        part = self.sets[0]
        whole = len(self.sets) == 1 and self.shard == (1, 1) and not part.where
        return part.suite if whole and (part.suite == FULL or not part.chosen) else ""

    @property
    def results(self) -> Path:
        """The results file: named after the suite, that of the full suite after the built-in problems."""
        return Path(self.output or ("builtin.sqlite" if self.builtin else f"{self.suite or 'run'}.sqlite"))

    @property
    def report_folder(self) -> Path | None:
        if self.report is None:
            return None
        return (
            Path(self.report) if self.report else Path("reports") / ("builtin" if self.builtin else self.results.stem)
        )

    @property
    def memory(self) -> int:
        """The largest limit of any set, 0 when one has none."""
        limits = [part.memory for part in self.sets]
        return 0 if 0 in limits else max(limits)

    def effective(self, fingerprints: Mapping[str, Sequence[str]]) -> dict[str, Any]:
        """Return the plan as results keep it; `fingerprints` are the fingerprints of the problems of each set."""
        plan = asdict(self)
        for part in plan["sets"]:
            part["timeout"] = part["timeout"] if math.isfinite(part["timeout"]) else "none"
            part["found"] = list(fingerprints[part["name"]])
        return plan


SET_SETTINGS, RUN_SETTINGS = settings.settings_of(ProblemSet), settings.settings_of(RunPlan)
SETTINGS = {**SET_SETTINGS, **RUN_SETTINGS}
"""All settings by their keys in a plan file."""


def make(
    given: Mapping[str, Any],
    top: Mapping[str, Any],
    sets: Sequence[Mapping[str, Any]],
    suite: Callable[[str], Mapping[str, Any]] | None = None,
) -> RunPlan:
    """Return the plan from values that were read: `given` on the command line, at the `top` of a file, in its `sets`.

    The command line wins over a set, a set over the top of its file. suite : the values of a
    suite by its name, for sets that name no problem; all built-in problems without it. Raises CpbenchError where
    problems and a suite are named.
    """
    common = {key: value for key, value in top.items() if key in SET_SETTINGS}
    mine = {key: value for key, value in given.items() if key in SET_SETTINGS}
    parts = tuple(_part({**common, **table, **mine}, suite) for table in (sets or [{}]))
    whole = {key: value for key, value in {**top, **given}.items() if key in RUN_SETTINGS}
    return RunPlan(sets=parts, **whole)


def _part(table: Mapping[str, Any], suite: Callable[[str], Mapping[str, Any]] | None) -> ProblemSet:
    """Return a set, with the values of its suite where it names no problems."""
    if table.get("suite") and "problems" in table:
        raise CpbenchError(
            f"suite {table['suite']}: has its own problems, and {table['problems'][0]} is named too; leave one out"
        )
    if "problems" in table or suite is None:
        return ProblemSet(**table)
    return ProblemSet(**{**suite(table.get("suite") or QUICK), **table})


def suite_values(suite: str, problems: Callable[[], Sequence[str]]) -> dict[str, Any]:
    """Return the values that a suite gives a set; `problems` finds the addresses of the small ones.

    >>> suite_values("full", list)
    {'suite': 'full', 'problems': ('builtin',), 'routes': 'facets'}
    """
    if suite == QUICK:
        return {
            "suite": suite,
            "routes": "exact",
            "problems": tuple(problems()),
            "solvers": quick_solvers(),
            "timeout": QUICK_SECONDS,
            "repeat_below": QUICK_REPEATED,
        }
    if suite == STANDARD:
        return {"suite": suite, "problems": ("builtin",), "solvers": quick_solvers(), "routes": "exact"}
    return {"suite": suite, "problems": ("builtin",), "routes": "facets"}


def quick_solvers() -> tuple[str, ...]:
    """Return the names of the solvers in the quick suite."""
    return tuple(solver.spec.name for solver in solvers if solver.spec.quick)
