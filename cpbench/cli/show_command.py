"""Show a problem in numbers or as block structure, with its equations."""

from __future__ import annotations

import click

from cpbench.api.problems import convert, load
from cpbench.api.results import is_results_file
from cpbench.cli.answer import print_results
from cpbench.cli.options import (
    format_option,
    kinds_option,
    via_option,
)
from cpbench.cli.types import ADDRESS
from cpbench.formulations import Kind
from cpbench.report import show


@click.command()
@click.argument("source", metavar="FILE", type=ADDRESS)
@click.option("--as", "node", metavar="NODE", help="Formulation to convert to first (cpbench list formulations).")
@via_option
@kinds_option()
@format_option
def command(
    source: str,
    node: str | None,
    via: tuple[str, ...],
    kinds: frozenset[Kind] | None,
    file_format: str | None,
) -> None:
    """Show a problem: its equations and its data, in numbers when small, as block structure when large.

    With --as or --via the problem is converted first; the conversions are shown with their equations. For a results
    file the command shows which solver to use, as at the end of the run.
    """
    if is_results_file(source):
        if node or via or file_format:
            raise click.UsageError("a results file is shown without options; its report: cpbench report")
        print_results(source)
        return
    problem = load(source, format=file_format)
    problem = convert(problem, node, via, kinds=kinds).problem
    click.echo(show.text(problem))
