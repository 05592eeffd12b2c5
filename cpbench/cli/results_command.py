"""Merge, import or export results.

The group of commands that make results files of others, or other files of them.
"""

from __future__ import annotations

import click

from cpbench.cli import RESULT_COMMANDS, RESULTS, LazyGroup


class ResultsGroup(LazyGroup):
    """A group of commands that the program itself finds by their names, too."""

    listed, of_packages = RESULT_COMMANDS, RESULTS

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        return super().get_command(ctx, cmd_name) if cmd_name in self.list_commands(ctx) else None


@click.group(cls=ResultsGroup)
def command() -> None:
    """Merge, import or export results."""
