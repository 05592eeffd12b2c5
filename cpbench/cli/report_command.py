"""`cpbench report`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import click

from cpbench.bench.results.sealed import sealed
from cpbench.cli.options import Command, ListOption
from cpbench.cli.outputs import replaced, require_folder
from cpbench.errors import UnknownName


@click.command(cls=Command)
@click.argument("results", type=click.Path(path_type=Path))
@click.option("-o", "--output", type=click.Path(path_type=Path), help="Folder (default: reports/NAME).")
@click.option("--title", help="Title of the report (default: name of the results file).")
@click.option(
    "--format",
    "form",
    type=click.Choice(["html", "tex"]),
    default="html",
    show_default=True,
    help="html: with Markdown and figures; tex: one LaTeX document, numbers as macros, refs.bib.",
)
@click.option(
    "--facet",
    "facets",
    cls=ListOption,
    metavar="NAMES",
    help="With tex: profiles by family, tolerance, or both.",
)
@click.option(
    "--baseline",
    type=click.Path(path_type=Path),
    metavar="OTHER",
    help="Compare with this run (or baseline .csv) in a section of the Markdown report.",
)
@click.option(
    "--publishable", is_flag=True, help="Leave out solvers whose licence restricts the publishing of figures."
)
@click.option(
    "--data",
    cls=ListOption,
    metavar="NAMES",
    help="Rows as csv, json, parquet. Default: all; CSV and Parquet ([arrow]) up to 200000 rows, JSON up to 20000.",
)
@click.option("--with-imported", is_flag=True, help="Rank times of imported answers, made elsewhere, with the others.")
@click.option("--count-stationary", is_flag=True, help="Count answers that are stationary only among the solved.")
def command(
    results: Path,
    output: Path | None,
    title: str | None,
    form: str,
    facets: tuple[str, ...],
    baseline: Path | None,
    publishable: bool,
    data: tuple[str, ...],
    with_imported: bool,
    count_stationary: bool,
) -> None:
    """Write the report of a results file: one HTML file that works offline, Markdown, figures, rows; or LaTeX."""
    chosen = {"publishable": publishable, "with_imported": with_imported, "count_stationary": count_stationary}
    folder, name = output or Path("reports") / results.stem, title or results.stem
    if form == "tex":
        if baseline is not None:
            raise click.UsageError("--baseline is a section of the Markdown report: leave --format tex out")
        if data:
            raise click.UsageError("--data is of the report as HTML: leave --format tex out")
        before = _there(folder)
        click.echo(f"report: {replaced(_tex(results, folder, name, facets, chosen), before)}")
        return
    if facets:
        raise click.UsageError("--facet is of the LaTeX document: add --format tex")
    from cpbench.api.reports import write_report
    from cpbench.report import row_files
    from cpbench.report.html import vega

    for unknown in [form for form in data if form not in row_files.FORMATS]:
        raise UnknownName("format of rows", unknown, row_files.FORMATS)
    with sealed(results) as store:
        table = comparison = None
        if baseline is not None:
            from cpbench.analysis.comparison import compare
            from cpbench.api.sides import base, side_of

            new = side_of(store)
            table, comparison = new.table, compare(base(baseline, new), new)
        before = _there(folder)
        made, told = write_report(store, folder, name, table, data=data or None, comparison=comparison, **chosen)
    for path in made:
        click.echo(f"report: {replaced(path, before)}")
    for line in (*told, *filter(None, [vega.lacking()])):
        click.echo(line, err=True)


def _there(folder: Path) -> list[Path]:
    """What the folder of the report has already; makes it. Raises FormatError where it cannot be."""
    require_folder(folder)
    return list(folder.iterdir())


def _tex(results: Path, folder: Path, title: str, facets: tuple[str, ...], chosen: Mapping[str, bool]) -> Path:
    from cpbench.bench.results.citations import citations
    from cpbench.report.document.page import write_document

    with sealed(results) as store:
        return write_document(
            store.table(),
            store.meta(),
            folder,
            title,
            citations=citations(store),
            facets=facets,
            **chosen,
        )
