"""A comparison of results files, where asked with a second run of what alarmed, and of nothing else."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Collection
from pathlib import Path
from typing import TYPE_CHECKING

from cpbench.api.sides import side
from cpbench.bench import rerun
from cpbench.bench.execution import RunObserver
from cpbench.bench.results.store import Store
from cpbench.foundation.plurals import counted

if TYPE_CHECKING:
    from cpbench.analysis.comparison import Comparison, ComparisonSide, Thresholds


def compare_files(
    base: Path,
    new: Path | None,
    labels: tuple[str, str] = ("", ""),
    settings: Thresholds | None = None,
    noise: tuple[str, str] | None = None,
    again: Callable[[Comparison, Path, Callable[[ComparisonSide], Comparison]], Comparison] | None = None,
) -> Comparison:
    """Compare two results files, or two labels of one.

    Parameters
    ----------
    base : a results file. new : None to compare `labels` of the base.
    settings : margins and levels, None for the default. noise : two labels of equal code, whose difference is noise.
    again : confirms what alarmed, as `confirm` does.

    Raises CpbenchError where a file has no rows or the sides have no pair in common.
    """
    from cpbench.analysis import comparison

    chosen = settings or comparison.Thresholds()

    def compared(after: ComparisonSide) -> Comparison:
        if new is None:
            return comparison.compare_labels(after, *labels, chosen, noise)
        equal = comparison.equal_pairs(after, noise) if noise is not None else None
        return comparison.compare(side(base), after, chosen, equal)

    found = compared(side(new or base))
    return found if again is None else again(found, new or base, compared)


def confirm(
    first: Comparison,
    results: Path,
    compare: Callable[[ComparisonSide], Comparison],
    *,
    others: Collection[str],
    statuses: Collection[str],
    observer: RunObserver,
    report: Callable[[str], None] = lambda _: None,
) -> Comparison:
    """Return the first comparison, in which only what alarms a second time is an alarm.

    Parameters
    ----------
    results : the file whose rows are run again, in one run: of one file both sides of a pair, of two the new one.
    others : solvers or labels that are run again on the same problems, as they measure the noise. statuses : those
    that are an alarm. compare : compares the second run as the first was. observer : is shown how the run goes.
    report : takes a line on how much is run again.
    """
    from cpbench.analysis.comparison import confirmed, to_repeat
    from cpbench.generators.collection import builtin_folder

    pairs = to_repeat(first, statuses)
    if not len(pairs):
        return first
    what = ["fingerprint", "tolerance", "start"]
    mine = {
        (*map(str, row[:3]), label) for row in pairs[[*what, "label_base", "label_new"]].values for label in row[3:]
    }
    problems = {row[:3] for row in mine}
    keys = set[str]()
    with Store(results) as store:
        for row in store.rows():
            place = (row.fingerprint, str(row.tolerance), row.start)
            noise = place in problems and (row.solver in others or row.label in others)
            if noise or (*place, row.label) in mine:
                keys.add(row.key)
    report(f"run again: {counted(len(pairs), 'pair')}, {counted(len(keys), 'solve')}")
    with tempfile.TemporaryDirectory(prefix="cpbench-confirm-") as folder:
        plan = rerun.plan(results, keys, Path(folder, "again.sqlite"))
        command = "cpbench compare --confirm"
        rerun.carry_out(plan, keys, command, str(results), builtin_folder, observer, observer.reading)
        return confirmed(first, compare(side(plan.results)), statuses)
