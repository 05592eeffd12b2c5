"""`cpbench plot table`: the rankings of a run as text."""

from __future__ import annotations

from pathlib import Path

import click

from cpbench.analysis.run_table import RunTable
from cpbench.bench.results.store import Store
from cpbench.cli.options import Command, force_option, publishable_option
from cpbench.cli.types import PATH
from cpbench.errors import UnknownName
from cpbench.report import ranking_table
from cpbench.report.run import assembled
from cpbench.storage.base import write_atomic


@click.command("table", cls=Command)
@click.argument("results", type=PATH)
@click.option("--format", "form", type=click.Choice(list(ranking_table.WRITERS)), default="md", show_default=True)
@click.option("--node", metavar="NAME", help="Formulation, where the results have several; default: all.")
@publishable_option
@click.option("-o", "--output", type=PATH, help="Output file; default: print it.")
@force_option
def command(results: Path, form: str, node: str | None, publishable: bool, output: Path | None, force: bool) -> None:
    """Write the rankings of a run as a table with digits, to be pasted.

    Times are in milliseconds, in csv in seconds and with all digits.
    """
    with Store(results) as store:
        run = assembled(RunTable.of(store.table(), store.meta()), Path(), publishable=publishable)
    chosen = [ranking for ranking in run.rankings if node in (None, ranking.group.node)]
    if not chosen and node is not None:
        raise UnknownName("formulation of the results", node, sorted({r.group.node for r in run.rankings}))
    text = ranking_table.WRITERS[form](chosen)
    if output is None:
        click.echo(text, nl=False)
        return
    write_atomic(output, text.encode(), force=force)
    click.echo(f"table: {output}")
