"""The page of the commands: their help, as the command line prints it."""

from __future__ import annotations

from collections.abc import Iterator

import click
from page_parts import verbatim

from cpbench.cli import cli


def page() -> str:
    """Return every command with its help."""
    return "\n\n".join(["# Commands", *_described(cli, click.Context(cli, info_name="cpbench"), "cpbench")])


def _described(command: click.Command, context: click.Context, name: str) -> Iterator[str]:
    yield f"## {name}\n\n{verbatim(command.get_help(context))}"
    if isinstance(command, click.Group):
        for child in command.list_commands(context):
            found = command.get_command(context, child)
            if found is not None:
                yield from _described(found, click.Context(found, context, child), f"{name} {child}")
