"""Advice as a whole: how good it is for origins that were left out, and the table of it that is shipped."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from cpbench import __version__
from cpbench.analysis import validation
from cpbench.analysis.profiles import FLOOR
from cpbench.analysis.training_cases import TrainingCases, to_text
from cpbench.api import evidence
from cpbench.cli.solver_tables import columns
from cpbench.errors import CpbenchError
from cpbench.plurals import counted


def evaluate(known: TrainingCases, source: str, remarks: Sequence[str], as_json: bool) -> None:
    """Print how often the advice is good for origins that were left out; raises CpbenchError."""
    if len(set(known.origins)) < 2:
        raise CpbenchError(f"{source}: all problems are of one origin; there is nothing to leave out")
    table = validation.rates(known, validation.evaluate(known))
    rows = table.to_dict("records")
    if as_json:
        told = {"source": source, "unsolved": known.unsolved, "rates": rows, "remarks": list(remarks)}
        click.echo(json.dumps(told, indent=1))
        return
    click.echo(
        f"Each origin left out in turn, by {source}: solved, and within twice the time of the virtual best (from "
        f"{FLOOR:g} s). The estimate's own numbers are chosen each time from other origins."
    )
    head = ("", "", "", "advice", "", "plain", "", "auto", "", "", "single", "", "")
    names = ("node", "problems", "origins", *("solved", "within") * 2, *("label", "solved", "within") * 2)
    lines: list[tuple[str, ...]] = [head, names]
    for row in rows:
        numbers = [str(row[name]) for name in ("problems", "origins", "solved", "within", "plain_solved")]
        numbers.append(str(row["plain_within"]))
        for name in ("auto", "single"):
            numbers += [row[name], str(row[f"{name}_solved"]), str(row[f"{name}_within"])]
        lines.append((row["node"], *numbers))
    for line in columns(lines):
        click.echo(line)
    click.echo(
        "plain: the label best on the other origins of the node. auto: the automatic solver, 0 where none was run."
    )
    click.echo("single: the label best on the node's own problems, which is known only afterwards.")
    for line in _worth(rows[-1]):
        click.echo(line)
    if known.unsolved:
        click.echo(f"without {counted(known.unsolved, 'problem')} that nobody solved: there is no virtual best")
    for remark in remarks:
        click.echo(f"remark: {remark}")


def _worth(every: Mapping[Any, Any]) -> list[str]:
    """What the advice comes to, beside what is simpler."""
    others = {
        "the label best on other origins": "plain_within",
        "always the automatic solver": "auto_within",
        "the best single label of each node, chosen in hindsight": "single_within",
    }
    found = [
        f"The advice is within twice the virtual best on {every['within']} of {counted(every['problems'], 'problem')}."
    ]
    for better, words in ((True, "That is better than"), (False, "That is not better than")):
        listed = [
            f"{what} ({every[name]})" for what, name in others.items() if (every["within"] > every[name]) == better
        ]
        if listed:
            found.append(f"{words} {' and '.join(listed)}.")
    return found


def make(table: Path, results: Sequence[Path], force: bool) -> None:
    """Write the table of what results came to, for others to go by; raises CpbenchError."""
    if not results:
        raise click.UsageError("--make: give the results to make it of: --results FILE")
    if table.exists() and not force:
        raise CpbenchError(f"{table}: exists; --force replaces it")
    known, _ = evidence.read(results, False, False)
    if not known.cases:
        raise CpbenchError(f"{', '.join(map(str, results))}: nothing to make a table of: nobody solved anything")
    hidden = evidence.restricted(known.labels, results)
    text = to_text(known, hidden, f"cpbench {__version__}, {time.strftime('%Y-%m-%d')}")
    table.write_text(text, encoding="utf-8")
    sizes = counted(len(known.cases), "problem"), counted(len(known.labels) - len(hidden), "label")
    click.echo(f"table: {table} ({', '.join(sizes)}, {len(text)} bytes)")
    if hidden:
        click.echo(f"left out, for their figures may not be published: {', '.join(sorted(hidden))}")
    if known.unfinished:
        click.echo(f"left out, for not all of their pairs were run: {counted(known.unfinished, 'problem')}")
