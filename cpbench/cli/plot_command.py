"""`cpbench plot`: a command a kind of figure, each with its own options, imported when it is called."""

from __future__ import annotations

import importlib
from functools import cache
from typing import Any

import click

PACKAGES = {
    "cpbench.report.plots": ("cpbench.cli.plot_run", "Of runs"),
    "cpbench_lab.pictures": ("cpbench.cli.plot_problem", "Of problems"),
}
"""Rooms of kinds of figures: the module whose `command_of` makes a command of one, and the heading in the help."""


@cache
def _kinds() -> dict[str, tuple[str, str]]:
    """Return the package and the summary of each kind of figure."""
    from cpbench.report.figure_kinds import summaries

    return {name: (package, text) for package in PACKAGES for name, text in summaries(package).items()}


class Kinds(click.Group):
    """The kinds of figures as subcommands."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(_kinds())

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in _kinds():
            return None
        from cpbench.report.figure_kinds import find

        package = _kinds()[cmd_name][0]
        found: click.Command = importlib.import_module(PACKAGES[package][0]).command_of(find(package, cmd_name))
        return found

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        for package, (_, heading) in PACKAGES.items():
            with formatter.section(heading):
                formatter.write_dl([(name, text) for name, (own, text) in _kinds().items() if own == package])

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        if args and args[0] not in _kinds():
            from cpbench.errors import UnknownName

            raise UnknownName("figure", args[0], _kinds())
        return super().resolve_command(ctx, args)


command = Kinds(
    "plot",
    help="Draw a single figure, as SVG, PNG or PDF.\n\n`cpbench plot KIND --help` has the options of a kind.",
    context_settings={"help_option_names": ["-h", "--help"]},
    subcommand_metavar="KIND [RESULTS|FILE] -o FIGURE",
)
