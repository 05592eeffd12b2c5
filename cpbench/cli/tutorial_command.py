"""`cpbench tutorial`."""

from __future__ import annotations

from pathlib import Path

import click

from cpbench.cli.options import Command


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
def command() -> None:
    """Build a tutorial on this machine."""


@command.command(cls=Command)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("reports/lecture"),
    show_default=True,
    help="Folder of the page and its problems.",
)
def lecture(output: Path) -> None:
    """Walk the equations of Acary's lecture: one offline page, every number computed while it is built."""
    from cpbench.report.lecture.page import write

    click.echo(f"lecture: {write(output)}")
