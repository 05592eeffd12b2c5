"""Judge answers that were computed elsewhere, and put them into a results file."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Iterator
from pathlib import Path

import click

from cpbench.api.concluding import conclude, contradiction_lines
from cpbench.bench.planning.selection import addresses
from cpbench.bench.results.imported import ELSEWHERE, Imported, Origin, import_answers
from cpbench.bench.results.store import Store
from cpbench.cli.options import Command, force_option, format_option, measure_option, tolerance_option
from cpbench.cli.terminal import print_lines
from cpbench.cli.types import COUNT, FILE, PATH
from cpbench.errors import CpbenchError
from cpbench.foundation.plurals import counted
from cpbench.generators.collection import builtin_folder

SHOWN = 10
"""Largest number of lines of a kind; the rest is counted."""


@click.command("import", cls=Command)
@click.argument("source", metavar="ANSWERS", type=PATH)
@click.option("-s", "--solver", required=True, metavar="NAME", help="Solver that computed the answers; any name.")
@click.option(
    "--problems",
    multiple=True,
    default=("builtin",),
    show_default=True,
    metavar="FILE|FOLDER",
    help="Problems that were solved: files, packs, folders, globs or builtin. Repeatable.",
)
@click.option("--times", type=FILE, help="Table with the columns problem,seconds[,iterations,claim].")
@click.option("-o", "--output", required=True, type=FILE, help="Results file.")
@click.option("--machine", default=ELSEWHERE, show_default=True, metavar="TEXT", help="Machine of the answers.")
@click.option("--threads", type=COUNT, default=1, show_default=True, help="Number of threads of the solver.")
@measure_option
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
    measure: str | None,
    tolerance: float,
    file_format: str | None,
    force: bool,
) -> None:
    """Judge answers that were computed elsewhere, and put them into a new or existing results file.

    ANSWERS is a folder with a file or folder for every problem, named after the problem or its fingerprint (.h5, .npz,
    .npy, .csv, .txt, .sol, or a folder of .npy files), or an HDF5 file of cpbench results export --answers. An answer
    without a claim (in the table of times, or in claim.json) counts as claimed to be solved.

    Every problem of a formulation for which there is an answer gets a row; a problem without an answer has the status
    failed. Rows are marked by --machine. With --with-imported, cpbench report ranks their times too.
    """
    if not solver.strip() or not machine.strip():
        raise CpbenchError("--solver and --machine may not be empty: they mark the rows")
    chosen = addresses(problems, builtin_folder)
    with Store(output, create=True) as store:
        done = import_answers(
            store,
            source,
            chosen,
            Origin(solver.strip(), machine.strip(), threads, tolerance, measure),
            format=file_format,
            times=times,
            command=shlex.join(["cpbench", *sys.argv[1:]]),
            force=force,
        )
        conflicts = conclude(store, say=lambda line: print_lines([line], err=True))
    print_lines(_remarks(done), err=True)
    print_lines(contradiction_lines(conflicts))
    summary = ", ".join(f"{n} {status}" for status, n in done.counts.most_common())
    click.echo(f"{counted(sum(done.counts.values()), 'problem')}, {solver} from {machine}: {summary}")
    print_lines([f"results: {output}"])


def _remarks(done: Imported) -> Iterator[str]:
    """Yield a line for each answer that has no row, and one for each kind of thing that is missing."""
    refused = [reason for _, reason in done.refused]
    for reason, lines in (("refused", refused), ("not used", done.stray), ("error", done.broken)):
        yield from (f"{reason}: {line}" for line in lines[:SHOWN])
        if len(lines) > SHOWN:
            yield f"{reason}: {len(lines) - SHOWN} more"
    if done.unasked:
        listed = ", ".join(f"{node} {count}" for node, count in sorted(done.unasked.items()))
        yield f"no answer to any problem of these formulations, no row: {listed}"
    if done.unanswered:
        yield f"no answer, and a row that says failed: {counted(done.unanswered, 'problem')}"
    if done.untimed:
        yield f"no time (--times not given, or without a line): {counted(done.untimed, 'answer')}"
