"""Draw a figure of a run (profile, pairs, scaling, ...) or of a problem (friction cone, contacts, ...).

A command a kind of figure, each with its own options, imported when it is called.
"""

from __future__ import annotations

import importlib
from functools import cache
from typing import Any

import click

RUNS = "cpbench.report.plots"
OF_RUNS, OF_PROBLEMS = ("cpbench.cli.plot_run", "Of runs"), ("cpbench.cli.plot_problem", "Of problems")
"""The module whose `command_of` makes a command of a kind of figure, and the heading in the help."""
TABLE = "table"
"""The command that writes the numbers behind the figures."""


def packages() -> dict[str, tuple[str, str]]:
    """Return the packages of kinds of figures: of runs cpbench's own, then those of installed packages, whose entry
    point is named by what their figures are of."""
    from cpbench.foundation.extensions import FIGURES, added

    of = {"runs": OF_RUNS}
    return {RUNS: OF_RUNS} | {entry.value: of.get(entry.name, OF_PROBLEMS) for entry in added(FIGURES).values()}


@cache
def _kinds() -> dict[str, tuple[str, str]]:
    """Return the package and the summary of each kind of figure."""
    from cpbench.report.figure_kinds import summaries

    return {name: (package, text) for package in packages() for name, text in summaries(package).items()}


class Kinds(click.Group):
    """The kinds of figures as subcommands."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return [*_kinds(), TABLE]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name == TABLE:
            from cpbench.cli.plot_table import command as table

            return table
        if cmd_name not in _kinds():
            return None
        from cpbench.report.figure_kinds import find

        package = _kinds()[cmd_name][0]
        command: click.Command = importlib.import_module(packages()[package][0]).command_of(find(package, cmd_name))
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        for one in (OF_RUNS, OF_PROBLEMS):
            own = [(name, text) for name, (package, text) in _kinds().items() if packages()[package] == one]
            with formatter.section(one[1]):
                formatter.write_dl(own)
        with formatter.section("No figure"):
            formatter.write_dl([(TABLE, "The rankings of a run as a table for a paper: Markdown or CSV.")])

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        if args and args[0] not in (*_kinds(), TABLE):
            from cpbench.errors import UnknownName

            raise UnknownName("figure", args[0], _kinds())
        return super().resolve_command(ctx, args)


command = Kinds(
    "plot",
    help="Draw a single figure, as SVG, PNG or PDF, or write a table.\n\n"
    "`cpbench plot KIND --help` has the options of a kind.",
    context_settings={"help_option_names": ["-h", "--help"]},
    subcommand_metavar="KIND [RESULTS|FILE] -o FIGURE",
)
