"""`cpbench import`."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

import click

from cpbench.bench.planning.selection import addresses
from cpbench.bench.results.imported import ELSEWHERE, Imported, Origin, import_answers
from cpbench.bench.results.store import Store
from cpbench.cli.options import Command, force_option, format_option, tolerance_option
from cpbench.errors import CpbenchError
from cpbench.plurals import counted

_SHOWN = 10
"""Lines of a kind that are printed; the rest is counted."""


@click.command("import", cls=Command)
@click.argument("source", metavar="ANSWERS", type=click.Path(path_type=Path))
@click.option("-s", "--solver", required=True, metavar="NAME", help="Who made the answers; need not be known here.")
@click.option(
    "--problems",
    multiple=True,
    default=("builtin",),
    show_default=True,
    metavar="FILE|FOLDER",
    help="Problems that were asked: files, packs, folders, globs or builtin. Repeatable.",
)
@click.option(
    "--times",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Table with the columns problem,seconds[,iterations,claim].",
)
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path, dir_okay=False), help="Results file.")
@click.option("--machine", default=ELSEWHERE, show_default=True, metavar="TEXT", help="Where the answers were made.")
@click.option("--threads", type=click.IntRange(min=1), default=1, show_default=True, help="With how many threads.")
@click.option("--exchange", metavar="NAME", help="Form of the answers; default: what each looks like.")
@click.option("--measure", metavar="NAME", help="The one number that decides; default: all of them.")
@tolerance_option
@format_option
@force_option
def command(
    source: Path,
    solver: str,
    problems: tuple[str, ...],
    times: Path | None,
    output: Path,
    machine: str,
    threads: int,
    exchange: str | None,
    measure: str | None,
    tolerance: float,
    file_format: str | None,
    force: bool,
) -> None:
    """Judge answers that were made elsewhere, and put them into a results file, new or existing.

    ANSWERS is a folder with a file or folder for every problem, named after the problem or its fingerprint, in the form
    of any exchange (.h5, .npz, .npy, .csv, .json, a folder of .npy or .mtx files), or an HDF5 file of cpbench export
    --answers. Without a claim (in the table of times, or in claim.json) an answer counts as claimed.

    Every problem of a formulation that some answer is to has a row; one without an answer is failed. Rows are marked
    by --machine, and their times stay out of rankings unless cpbench report is told --with-imported.
    """
    if not solver.strip() or not machine.strip():
        raise CpbenchError("--solver and --machine may not be empty: they mark the rows")
    asked = addresses(problems, _builtin_folder)
    with Store(output, create=True) as store:
        done = import_answers(
            store,
            source,
            asked,
            Origin(solver.strip(), machine.strip(), threads, tolerance, measure),
            format=file_format,
            times=times,
            exchange=exchange,
            command=shlex.join(["cpbench", *sys.argv[1:]]),
            force=force,
        )
    _tell(done)
    summary = ", ".join(f"{n} {status}" for status, n in done.counts.most_common())
    click.echo(f"{counted(sum(done.counts.values()), 'problem')}, {solver} from {machine}: {summary}")
    click.echo(f"results: {output}")


def _builtin_folder() -> Path:
    from cpbench.generators.collection import builtin_folder

    return builtin_folder()


def _tell(done: Imported) -> None:
    refused = [reason for _, reason in done.refused]
    for reason, lines in (("refused", refused), ("not used", done.stray), ("error", done.broken)):
        for line in lines[:_SHOWN]:
            click.echo(f"{reason}: {line}", err=True)
        if len(lines) > _SHOWN:
            click.echo(f"{reason}: {len(lines) - _SHOWN} more", err=True)
    if done.unasked:
        listed = ", ".join(f"{node} {count}" for node, count in sorted(done.unasked.items()))
        click.echo(f"no answer to any problem of these formulations, no row: {listed}", err=True)
    if done.unanswered:
        click.echo(f"no answer, and a row that says failed: {counted(done.unanswered, 'problem')}", err=True)
    if done.untimed:
        click.echo(f"no time (--times not given, or without a line): {counted(done.untimed, 'answer')}", err=True)
