"""`cpbench report`."""

from __future__ import annotations

from pathlib import Path

import click

from cpbench.bench.results.store import Store


@click.command()
@click.argument("results", type=click.Path(path_type=Path))
@click.option("-o", "--output", type=click.Path(path_type=Path), help="Folder (default: reports/NAME).")
@click.option("--title", help="Title of the report (default: name of the results file).")
@click.option(
    "--publishable", is_flag=True, help="Leave out solvers whose licence restricts the publishing of figures."
)
@click.option("--with-imported", is_flag=True, help="Rank times of imported answers, made elsewhere, with the others.")
def command(results: Path, output: Path | None, title: str | None, publishable: bool, with_imported: bool) -> None:
    """Write the report of a results file: one HTML file that works offline, Markdown, figures, CSV."""
    from cpbench.bench import history
    from cpbench.report.html.page import write_html
    from cpbench.report.markdown import write_report

    store = Store(results)
    try:
        table, meta, iterates = store.table(), store.meta(), history.table(store.histories())
    finally:
        store.close()
    folder, name = output or Path("reports") / results.stem, title or results.stem
    for write in (write_report, write_html):
        path = write(table, meta, folder, name, iterates, publishable=publishable, with_imported=with_imported)
        click.echo(f"report: {path}")
