"""`cpbench results`, the group of commands that make results files of others, or other files of them."""

from __future__ import annotations

import click

from cpbench.foundation.extensions import commands, summary
from cpbench.foundation.help_text import RESULT_COMMANDS, RESULTS


class ResultsGroup(click.Group):
    """A group of commands that the program itself finds by their names, too."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(RESULT_COMMANDS | commands(RESULTS))

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in self.list_commands(ctx):
            return None
        from cpbench.cli import cli

        return cli.get_command(ctx, cmd_name)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            added = {name: summary(entry) for name, entry in commands(RESULTS).items()}
            formatter.write_dl(list((RESULT_COMMANDS | added).items()))


@click.group(cls=ResultsGroup)
def command() -> None:
    """Merge, import or export results, or keep their outcomes as text."""
