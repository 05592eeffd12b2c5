"""`cpbench compare --confirm`: what alarmed is run again, and nothing else."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Collection
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cpbench.api.sides import side
from cpbench.bench import rerun
from cpbench.bench.results.store import Store
from cpbench.cli.progress import Display
from cpbench.plurals import counted

if TYPE_CHECKING:
    from cpbench.analysis.comparison import Comparison, ComparisonSide


def confirm(
    found: Comparison,
    results: Path,
    others: Collection[str],
    statuses: Collection[str],
    compared: Callable[[ComparisonSide], Comparison],
) -> Comparison:
    """`found`, in which only what alarms a second time is an alarm.

    results : the file whose rows are run again, in one run: of one file both sides of a pair, of two the new one.
    others : solvers or labels that are run again on the same problems, for they tell the noise. statuses : those that
    are an alarm. compared : compares what the second run came to, as the first was.
    """
    from cpbench.analysis.comparison import confirmed, to_repeat
    from cpbench.generators.collection import builtin_folder

    pairs = to_repeat(found, statuses)
    if not len(pairs):
        return found
    what = ["fingerprint", "tolerance", "start"]
    mine = {
        (*map(str, row[:3]), label) for row in pairs[[*what, "label_base", "label_new"]].values for label in row[3:]
    }
    problems = {row[:3] for row in mine}
    keys = set[str]()
    with Store(results) as store:
        for row in store.rows():
            place = (str(row["fingerprint"]), str(row["tolerance"]), str(row["start"]))
            noise = place in problems and (row["solver"] in others or row["label"] in others)
            if noise or (*place, str(row["label"])) in mine:
                keys.add(str(row["key"]))
    click.echo(f"run again: {counted(len(pairs), 'pair')}, {counted(len(keys), 'solve')}", err=True)
    with tempfile.TemporaryDirectory(prefix="cpbench-confirm-") as folder:
        asked = rerun.plan(results, keys, Path(folder, "again.sqlite"))
        display = Display(True)
        rerun.carry_out(
            asked, keys, "cpbench compare --confirm", str(results), builtin_folder, display, display.reading
        )
        return confirmed(found, compared(side(asked.results)), statuses)
