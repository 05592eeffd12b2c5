"""Put the rows of several results files into one."""

from __future__ import annotations

from pathlib import Path

import click

from cpbench.api.concluding import conclude, contradiction_lines
from cpbench.bench.results.merge import PREFER, merge
from cpbench.bench.results.store import Store
from cpbench.cli.options import Command
from cpbench.cli.terminal import print_lines
from cpbench.cli.types import FILE, PATH
from cpbench.foundation.plurals import counted, summary


@click.command(cls=Command)
@click.argument("results", nargs=-1, required=True, type=PATH)
@click.option("-o", "--output", required=True, type=FILE, help="Results file to make.")
@click.option("--mixed", is_flag=True, help="Merge files that are not comparable, and mark the rows concerned.")
@click.option("--prefer", type=click.Choice(PREFER), help="Row to keep of a pair that was run twice.")
def command(results: tuple[Path, ...], output: Path, mixed: bool, prefer: str | None) -> None:
    """Put the rows of several results files, with their answers, into one: the shards of a plan, for example.

    Files that differ in limits, tolerances, measures, machines, or versions of cpbench or of a solver are refused
    unless --mixed is given; so are files in which one name stands for different problems. For a pair that is planned in
    several files and was run in one, the row that was run is taken.
    """
    remarks = merge(results, output, mixed=mixed, prefer=prefer or "")
    print_lines((f"mixed: {line}" for line in remarks), err=True)
    with Store(output, create=True) as store:
        conflicts = conclude(store, say=lambda line: print_lines([line], err=True))
        counts = store.counts()
    print_lines(contradiction_lines(conflicts))
    print_lines([f"{counted(sum(counts.values()), 'pair')} of {counted(len(results), 'file')}: {summary(counts)}"])
    print_lines([f"results: {output}"])
