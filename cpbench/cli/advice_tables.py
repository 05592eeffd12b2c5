"""Advice as a whole: how good it is for families that were left out, and the table of it that is shipped."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from pathlib import Path

import click

from cpbench import __version__
from cpbench.analysis import recommendation as rec
from cpbench.analysis.experience import Experience, to_text
from cpbench.analysis.profiles import FLOOR
from cpbench.cli import evidence
from cpbench.cli.solver_tables import columns
from cpbench.errors import CpbenchError


def evaluate(known: Experience, source: str, remarks: Sequence[str], as_json: bool) -> None:
    """Print how often the advice is good for families that were left out; raises CpbenchError."""
    if len({case.family for case in known.cases}) < 2:
        raise CpbenchError(f"{source}: all problems are of one family; there is nothing to leave out")
    table = rec.rates(known, rec.evaluate(known))
    if as_json:
        rows = table.to_dict("records")
        told = {"source": source, "unsolved": known.unsolved, "rates": rows, "remarks": list(remarks)}
        click.echo(json.dumps(told, indent=1))
        return
    click.echo(
        f"Each family left out in turn, by {source}; within: twice the time of the virtual best, from {FLOOR:g} s."
    )
    head = ("node", "problems", "families", "solved", "within", "", "best single (in hindsight)", "solved", "within")
    lines: list[tuple[str, ...]] = [head]
    for row in table.to_dict("records"):
        part = f"{row['within'] / row['problems']:.0%}" if row["problems"] else ""
        numbers = [str(row[name]) for name in ("problems", "families", "solved", "within")]
        lines.append((row["node"], *numbers, part, row["single"], str(row["single_solved"]), str(row["single_within"])))
    for line in columns(lines):
        click.echo(line)
    if known.unsolved:
        click.echo(f"{known.unsolved} more problems that nobody solved have no virtual best, and are not among them")
    for remark in remarks:
        click.echo(f"remark: {remark}")


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
    click.echo(
        f"table: {table} ({len(known.cases)} problems, {len(known.labels) - len(hidden)} labels, {len(text)} bytes)"
    )
    if hidden:
        click.echo(f"left out, for their figures may not be published: {', '.join(sorted(hidden))}")
    if known.unfinished:
        click.echo(f"left out, for not all of their pairs were run: {known.unfinished} problems")
