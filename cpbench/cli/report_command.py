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
def command(results: Path, output: Path | None, title: str | None, publishable: bool) -> None:
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
        )
    finally:
        store.close()
    click.echo(f"report: {path}")
