"""`cpbench merge`."""

from __future__ import annotations

from pathlib import Path

import click

from cpbench.bench.results.merge import PREFER, merge
from cpbench.bench.results.store import Store
from cpbench.cli.options import Command
from cpbench.plurals import counted


@click.command(cls=Command)
@click.argument("results", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "-o", "--output", required=True, type=click.Path(path_type=Path, dir_okay=False), help="Results file to be made."
)
@click.option("--mixed", is_flag=True, help="Merge files that do not compare, and mark the rows concerned.")
@click.option(
    "--prefer", type=click.Choice(PREFER), default=None, help="Which row of a pair that was run twice counts."
)
def command(results: tuple[Path, ...], output: Path, mixed: bool, prefer: str | None) -> None:
    """Put the rows of several results files, with their answers, into one: the shards of a plan, for example.

    Files that were made with other limits, tolerances or measures, on other machines, by other versions of cpbench or
    of a solver, or of problems that changed under their names, are refused unless --mixed is given. A pair that is
    planned in several files and run in one has the row that was run.
    """
    told = merge(results, output, mixed=mixed, prefer=prefer or "")
    for line in told:
        click.echo(f"mixed: {line}", err=True)
    with Store(output) as store:
        counts, notes = store.counts(), store.meta().get("seals", [])
    for line in notes:
        click.echo(f"{line}; they are sealed anew as they are", err=True)
    summary = ", ".join(f"{counts[status]} {status}" for status in sorted(counts, key=lambda s: -counts[s]))
    click.echo(f"{counted(sum(counts.values()), 'pair')} of {counted(len(results), 'file')}: {summary}")
    click.echo(f"results: {output}")
