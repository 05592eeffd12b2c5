"""Write the rows or the answers of a results file to other formats."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from cpbench.bench.results.store import Store
from cpbench.cli.options import Command, ListOption, force_option
from cpbench.cli.terminal import print_lines
from cpbench.cli.types import PATH
from cpbench.storage.base import require_new


@click.command(cls=Command)
@click.argument("results", type=PATH)
@click.option("--rows", type=PATH, help="Output file of the rows: .csv, .json or .parquet ([arrow] extra).")
@click.option(
    "--columns",
    cls=ListOption,
    metavar="NAMES",
    help="Columns to write, which sort the rows; decade is the power of ten of the error. Without --rows, CSV on the "
    "screen.",
)
@click.option("--answers", type=PATH, help="Output file of the kept answers (HDF5).")
@force_option
def command(results: Path, rows: Path | None, columns: tuple[str, ...], answers: Path | None, force: bool) -> None:
    """Write the rows or the answers of a results file to other formats."""
    if rows is None and answers is None and not columns:
        raise click.UsageError("give --rows FILE, --columns NAMES or --answers FILE")
    from cpbench.api.export_answers import export_answers
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
            print_lines([f"answers: {answers} ({export_answers(store, answers, force=force)})"])
