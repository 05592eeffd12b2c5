"""The options with which a solver solves most problems, searched for and written as a plan."""

from __future__ import annotations

import math
import os
import platform
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from cpbench.advice.tuning import record
from cpbench.advice.tuning.search import Search, SearchResult
from cpbench.advice.tuning.space import space
from cpbench.bench import machine
from cpbench.bench.planning import plan_file, plan_text
from cpbench.bench.planning.assembly import Reading, assemble
from cpbench.bench.planning.plan import Pair
from cpbench.bench.planning.quantities import duration
from cpbench.bench.planning.run_plan import BUILTIN, ProblemSet, RunPlan
from cpbench.bench.results.rows import Outcome
from cpbench.bench.results.store import Store
from cpbench.bench.runner import LocalExecutor, settings
from cpbench.bench.slot import Slot
from cpbench.bench.worker_pool import Setting
from cpbench.errors import CpbenchError
from cpbench.plurals import counted


@dataclass(frozen=True)
class Tuned:
    """The end of a search: what it found on how many problems, its summary in lines, whether it was interrupted."""

    found: SearchResult
    lines: tuple[str, ...]
    interrupted: bool = False


def problem_set(solver: str, problems: Sequence[str], seed: int = 0, **keys: Any) -> ProblemSet:
    """Return the problems and limits of a search, checked as those of a plan are.

    Parameters
    ----------
    problems : files, packs, folders or globs; none for the built-in ones. seed : draws from them where there are more
    than `max_problems`. keys : of a set of a plan: tolerance, timeout, memory, repeats, split, keyword, family, where.

    Raises CpbenchError on a value that is none of its key.
    """
    largest = keys.pop("max_problems", None)
    given = {**keys, "problems": problems or (BUILTIN,), "solvers": (solver,), "routes": "exact", "seed": seed}
    if "tolerance" in given:
        given["tolerance"] = (given["tolerance"],)
    checked = {key: plan_file.check(key, value) for key, value in given.items() if value not in (None, ())}
    return ProblemSet(**checked, max_problems=largest)


def tune(
    solver: str,
    part: ProblemSet,
    plan: Path,
    *,
    budget: float,
    configurations: int | None = None,
    seed: int = 0,
    jobs: int = 1,
    threads: int = 1,
    trials: Path | None = None,
    command: str = "cpbench.advice.tune from Python",
    reading: Reading = list,
    report: Callable[[str], None] = lambda _: None,
) -> Tuned:
    """Search for the options of a solver and write the plan that compares them with the default ones.

    Parameters
    ----------
    solver : a name, with options in brackets that are fixed or searched among several values. part : problems and
    limits. plan : the plan file to write. budget : wall time of the search [s]. configurations : the most to try.
    seed : random seed of configurations and orders. jobs : slots side by side. threads : BLAS threads of a solve.
    trials : results file that keeps every solve. command : what that file says it was made by.
    reading : passes on the addresses of problems, to show progress. report : takes a line on the progress.

    An interrupt ends the search; the best so far is written. Raises CpbenchError, NoRoute where there is no search.
    """
    where = space(solver)
    if not os.access(plan.absolute().parent, os.W_OK):  # after the search it would be too late
        raise CpbenchError(f"{plan}: its folder is not there or cannot be written; name another file with -o")
    if not math.isfinite(part.timeout):
        raise CpbenchError("--timeout none: a search needs a limit, which a solve that fails is charged")
    search_plan = RunPlan(sets=(part,), threads=threads, jobs=jobs, report=None, seed=seed)
    with ExitStack() as stack:
        slots = [stack.enter_context(Slot(one)) for one in settings(Setting(threads, part.memory), jobs)]
        pairs = _one_a_problem(search_plan, slots[0], reading)
        store = stack.enter_context(Store(trials, create=True, keep="none")) if trials else None
        search = Search(
            pairs,
            islice(where.configurations(seed), configurations),
            budget,
            seed,
            report=report,
            keep=_Keeper(store, command) if store is not None else lambda *_: None,
        )
        report(f"{counted(len(pairs), 'problem')}, {duration(budget)}, seed {seed}")
        interrupted = False
        try:
            search.run(LocalExecutor(slots))
        except KeyboardInterrupt:
            interrupted = True
        if store is not None:
            store.require_unchanged()
    found = search.found
    tuning = record.tuning(found, part, budget, seed)
    plan_text.write(plan, record.plan_text(tuning, where.entry, part, threads, plan.parent))
    lines = [f"{tuning.solver}: {tuning.found}", f"{record.as_text(where.entry)}, default: {tuning.default}"]
    return Tuned(found, (*lines, *_cautions(found, len(pairs))), interrupted)


def _cautions(found: SearchResult, problems: int) -> list[str]:
    """Return what limits the comparison, and what the search cost."""
    lines: list[str] = []
    if not found.score.gains_on(found.default):
        lines.append("no gain on the default options: the difference is within what times differ from run to run")
    if not found.final:
        lines.append("measured at different times, not side by side: the search ended before the final")
    if not found.whole:
        of = counted(problems, "problem")
        lines.append(f"compared on {found.score.problems} of {of}: the budget was too short for more")
    cost = f"{counted(found.configurations, 'configuration')}, {counted(found.solves, 'solve')}"
    return [*lines, f"{cost}, {found.seconds:.1f} s"]


def _one_a_problem(plan: RunPlan, slot: Slot, reading: Reading) -> list[Pair]:
    """Return a pair for each problem that a route leads from; raises CpbenchError, NoRoute where there is none."""
    from cpbench.generators.collection import builtin_folder

    assembly = assemble(plan, slot, builtin_folder, reading)
    assembly.require_pairs()
    first: dict[str, Pair] = {}
    for pair in assembly.pairs:
        first.setdefault(pair.fingerprint, pair)
    return list(first.values())


class _Keeper:
    """Writer of every solve into a results file, for `cpbench report`."""

    def __init__(self, store: Store, command: str) -> None:
        self._store = store
        store.set_meta(
            command=command,
            date=time.strftime("%Y-%m-%d %H:%M"),
            machine=machine.describe(),
            versions=machine.versions(),
        )
        store.note_machine(platform.node(), machine.describe())

    def __call__(self, pair: Pair, outcome: Outcome) -> None:
        self._store.plan([pair])
        self._store.finish(pair.key, outcome)
