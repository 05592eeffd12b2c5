"""Write the rows or the answers of a results file to other formats."""

from __future__ import annotations

from pathlib import Path

import click

from cpbench.bench.results.sealed import sealed
from cpbench.cli.options import Command, force_option
from cpbench.cli.terminal import print_lines
from cpbench.cli.types import PATH
from cpbench.storage.base import require_new


@click.command(cls=Command)
@click.argument("results", type=PATH)
@click.option("--rows", type=PATH, help="Output file of the rows: .csv, .json or .parquet ([arrow] extra).")
@click.option("--answers", type=PATH, help="Output file of the kept answers (HDF5).")
@force_option
def command(results: Path, rows: Path | None, answers: Path | None, force: bool) -> None:
    """Write the rows or the answers of a results file to other formats."""
    if rows is None and answers is None:
        raise click.UsageError("give --rows FILE or --answers FILE")
    from cpbench.api.export_answers import export_answers
    from cpbench.report import row_files

    for path in (rows, answers):
        if path is not None:
            require_new(path, force)
    with sealed(results) as store:
        if rows is not None:
            row_files.write(store.table(), rows, force=force)
            print_lines([f"rows: {rows}"])
        if answers is not None:
            print_lines([f"answers: {answers} ({export_answers(store, answers, force=force)})"])
