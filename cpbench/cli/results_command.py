"""Merge, import or export results."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import click

from cpbench.api.concluding import conclude, contradiction_lines
from cpbench.bench.planning.selection import addresses
from cpbench.bench.results.imported import ELSEWHERE, Imported, Origin, import_answers
from cpbench.bench.results.merge import merge
from cpbench.bench.results.rows import unpack_answer
from cpbench.bench.results.store import Store
from cpbench.cli import Group
from cpbench.cli.options import Command, ListOption, force_option, format_option, measure_option, tolerance_option
from cpbench.cli.terminal import print_lines
from cpbench.cli.types import COUNT, FILE, PATH
from cpbench.errors import CpbenchError
from cpbench.foundation.text import counted, summary
from cpbench.generators.collection import builtin_folder
from cpbench.storage.base import require_new, write_atomic

ATTRIBUTES = (
    "label", "solver", "tolerance", "start", "threads", "measure", "set", "status", "error", "claim", "route",
)  # fmt: skip
"""Facts of its row that an exported answer has."""
SHOWN = 10
"""Largest number of lines of a kind; the rest is counted."""


@click.group("results", cls=Group)
def command() -> None:
    """Merge, import or export results."""


@command.command("merge", cls=Command)
@click.argument("results", nargs=-1, required=True, type=PATH)
@click.option("-o", "--output", required=True, type=FILE, help="Results file to make.")
def merge_files(results: tuple[Path, ...], output: Path) -> None:
    """Put the rows of several results files, with their answers, into one: the shards of a plan, for example.

    Files that differ in limits, tolerances, measures, machines, or versions of cpbench or of a solver are refused; so
    are files in which one name stands for different problems, or which have run one pair both. For a pair that is
    planned in several files and was run in one, the row that was run is taken.
    """
    merge(results, output)
    with Store(output, create=True) as store:
        conflicts = conclude(store, say=_warn)
        counts = store.counts()
    print_lines(contradiction_lines(conflicts))
    print_lines([f"{counted(sum(counts.values()), 'pair')} of {counted(len(results), 'file')}: {summary(counts)}"])
    print_lines([f"results: {output}"])


def _warn(line: str) -> None:
    print_lines([line], err=True)


@command.command("export", cls=Command)
@click.argument("results", type=PATH)
@click.option("--rows", type=PATH, help="Output file of the rows: .csv.")
@click.option(
    "--columns",
    cls=ListOption,
    metavar="NAMES",
    help="Columns to write, which sort the rows; decade is the power of ten of the error. Without --rows, CSV on the "
    "screen.",
)
@click.option("--answers", type=PATH, help="Output file of the kept answers (HDF5).")
@force_option
def export(results: Path, rows: Path | None, columns: tuple[str, ...], answers: Path | None, force: bool) -> None:
    """Write the rows or the answers of a results file to other formats."""
    if rows is None and answers is None and not columns:
        raise click.UsageError("give --rows FILE, --columns NAMES or --answers FILE")
    from cpbench.report import row_files

    for path in (rows, answers):
        if path is not None:
            require_new(path, force)
    with Store(results) as store:
        if rows is not None or columns:
            table = row_files.selected(store.table(), columns) if columns else store.table()
            if rows is None:
                row_files.write_csv(table, sys.stdout.buffer)
            else:
                row_files.write(table, rows, force=force)
                print_lines([f"rows: {rows}"])
        if answers is not None:
            print_lines([f"answers: {answers} ({_write_answers(store, answers, force)})"])


def _write_answers(store: Store, path: Path, force: bool) -> int:
    """Write a group for each problem and a dataset for each row, with what tells rows of one label apart as attributes;
    return the number of answers."""
    import h5py

    written = 0

    def put(out: BinaryIO) -> None:
        nonlocal written
        with h5py.File(out, "w") as file:
            for key, blob in store.answers():
                row = store.row(key)
                group = file.require_group(f"{row.problem}-{row.fingerprint[:8]}")
                group.attrs.update({"node": row.node, "fingerprint": row.fingerprint, "address": row.address})
                name = f"{row.label} {key[:8]}".replace("/", "|")
                data = group.create_dataset(name, data=unpack_answer(blob))
                attributes = {name: getattr(row, name) for name in ATTRIBUTES}
                data.attrs.update({name: value for name, value in attributes.items() if value is not None})
                written += 1

    write_atomic(path, put, force=force)
    return written


@command.command("import", cls=Command)
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
def import_(
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
    .npy, .csv, .txt, .sol, or a folder of .npy files). An answer without a claim in the table of times counts as
    claimed to be solved.

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
        conflicts = conclude(store, say=_warn)
    print_lines(_remarks(done), err=True)
    print_lines(contradiction_lines(conflicts))
    statuses = ", ".join(f"{n} {status}" for status, n in done.counts.most_common())
    click.echo(f"{counted(sum(done.counts.values()), 'problem')}, {solver} from {machine}: {statuses}")
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
