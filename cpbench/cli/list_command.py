"""List formulations, conversions, solvers, formats or problems."""

from __future__ import annotations

import json

import click

from cpbench.cli import terminal
from cpbench.cli.options import Command
from cpbench.cli.terminal import print_lines


@click.command(cls=Command)
@click.argument("what", type=click.Choice(["formulations", "conversions", "solvers", "formats", "problems"]))
@click.argument("names", nargs=-1, metavar="[NAME|GLOB]...")
@click.option("--all", "every", is_flag=True, help="Include solvers that run only when they are named.")
@click.option("--available", is_flag=True, help="Show only solvers that can run here.")
@click.option("--node", metavar="NODE", help="Formulation of the solvers.")
@click.option(
    "--check", is_flag=True, help="Import the packages of all solvers, instead of looking whether they are installed."
)
@click.option("--json", "as_json", is_flag=True, help="Print the solvers as JSON.")
def command(
    what: str, names: tuple[str, ...], every: bool, available: bool, node: str | None, check: bool, as_json: bool
) -> None:
    """List formulations, conversions, solvers, formats or the built-in problems.

    cpbench list solvers NAME shows a solver with its options, cpbench list solvers NODE the solvers of a formulation,
    cpbench list conversions NAME the mathematics of a conversion.
    """
    from cpbench.api import lists

    if what == "solvers":
        listed = lists.solver_list(names, node=node, every=every, available=available, check=check)
        if as_json:
            click.echo(json.dumps(listed.records(), indent=1))
        elif listed.named:
            print_lines(terminal.fitted(listed.sheets(terminal.reading_width())))
        else:
            print_lines(terminal.table(listed.rows()))
            print_lines(terminal.fitted(listed.notes()))
        return
    if every or available or node or check or as_json or (names and what != "conversions"):
        raise click.UsageError(f"list {what}: takes no names and no options of solvers")
    if what == "problems":
        print_lines(lists.builtin_problems())
    elif names:
        print_lines(lists.conversion_sheets(names))
    else:
        rows = {
            "formulations": lists.formulation_rows,
            "conversions": lists.conversion_rows,
            "formats": lists.format_rows,
        }
        print_lines(terminal.table(rows[what]()))
