"""`cpbench history`."""

from __future__ import annotations

from pathlib import Path

import click

from cpbench.cli.options import Command, ListOption, outputs_option


@click.command(cls=Command)
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="RESULTS...")
@click.option("--label", "labels", cls=ListOption, metavar="GLOB", help="Labels of solvers to show. Repeatable.")
@outputs_option(
    (".md", ".csv", ".json", ".svg", ".png"), "Output file .md, .csv, .json, .svg or .png; default: print. Repeatable."
)
def command(files: tuple[Path, ...], labels: tuple[str, ...], outputs: tuple[Path, ...]) -> None:
    """Show how solvers change over time: the problems that each solved in every results file, and its speed compared
    with the first file.

    Times are compared with the label's first file from the same machine, over the pairs solved in both; a file from
    another machine begins a new series. The drift of the machine itself, measured by the solve that every run repeats,
    is shown beside the times.
    """
    from cpbench.advice.history import history

    timeline = history(files, labels)
    for remark in timeline.remarks:
        click.echo(remark, err=True)
    for path in outputs:
        timeline.write(path)
        click.echo(f"history: {path}")
    if not outputs:
        click.echo("\n".join(timeline.lines()))
