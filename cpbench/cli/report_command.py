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
    """Write the report of a results file: Markdown, figures, CSV."""
    from cpbench.bench import history
    from cpbench.report.markdown import write_report

    store = Store(results)
    try:
        path = write_report(
            store.table(),
            store.meta(),
            output or Path("reports") / results.stem,
            title or results.stem,
            history.table(store.histories()),
            publishable=publishable,
            with_imported=with_imported,
        )
    finally:
        store.close()
    click.echo(f"report: {path}")
