"""Merge or export results."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import BinaryIO

import click

from cpbench.api.concluding import conclude, contradiction_lines
from cpbench.bench.results.merge import merge
from cpbench.bench.results.rows import unpack_answer
from cpbench.bench.results.store import Store
from cpbench.cli import Group
from cpbench.cli.options import ListOption, force_option
from cpbench.cli.terminal import print_lines
from cpbench.cli.types import FILE, PATH
from cpbench.foundation.text import counted, summary
from cpbench.storage.base import require_new, write_atomic

ATTRIBUTES = (
    "label", "solver", "tolerance", "start", "threads", "measure", "set", "status", "error", "claim", "route",
)  # fmt: skip
"""Facts of its row that an exported answer has."""


@click.group("results", cls=Group)
def command() -> None:
    """Merge or export results."""


@command.command("merge")
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


@command.command("export")
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
