"""Write the report of a results file: HTML, Markdown, figures and rows."""

from __future__ import annotations

from pathlib import Path

import click

from cpbench.cli.options import publishable_option, stationary_option
from cpbench.cli.terminal import print_lines, replaced
from cpbench.cli.types import PATH


@click.command()
@click.argument("results", type=PATH)
@click.option("-o", "--output", type=PATH, help="Folder of the report; default: reports/NAME.")
@click.option("--title", help="Title of the report; default: name of the results file.")
@publishable_option
@click.option("--csv", is_flag=True, help="Write results.csv also of more than 200000 rows.")
@stationary_option
def command(
    results: Path,
    output: Path | None,
    title: str | None,
    publishable: bool,
    csv: bool,
    count_stationary: bool,
) -> None:
    """Write the report of a results file: one HTML file that works offline, Markdown, figures, rows."""
    choices = {"publishable": publishable, "count_stationary": count_stationary}
    folder, name = output or Path("reports") / results.stem, title or results.stem
    from cpbench.api.reports import write_report
    from cpbench.bench.results.store import Store
    from cpbench.storage.base import require_folder

    before = list(folder.iterdir()) if folder.is_dir() else []
    with Store(results) as store:
        require_folder(folder)
        files, remarks = write_report(store, folder, name, csv=csv or None, **choices)
    print_lines(f"report: {replaced(path, before)}" for path in files)
    print_lines(remarks, err=True)
