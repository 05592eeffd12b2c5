"""`cpbench generate`."""

from __future__ import annotations

import filecmp
import sys
import tempfile
from pathlib import Path

import click

from cpbench.cli.options import Command, ListOption
from cpbench.generators.collection import builtin_folder, write_collections


@click.command(cls=Command)
@click.argument("folder", required=False, type=click.Path(path_type=Path, file_okay=False))
@click.option(
    "--collection",
    "names",
    cls=ListOption,
    metavar="NAME",
    help="Collection to write; needs FOLDER. Repeatable.",
)
@click.option("--check", is_flag=True, help="Write nothing; exit with 1 unless the files are the same bit for bit.")
def command(folder: Path | None, names: tuple[str, ...], check: bool) -> None:
    """Write the built-in problems again from their formulas (default: into the shipped folder).

    Larger contact problems and scenes are written only when they are named: contact-planted-large, contact-stacks,
    contact-sequence, contact-sequence-global.
    """
    if names and folder is None:
        raise click.UsageError("--collection needs a FOLDER to write to: the shipped one holds the built-in problems")
    target = folder or builtin_folder()
    if not check:
        for path in write_collections(target, names):
            click.echo(str(path))
        return
    with tempfile.TemporaryDirectory() as fresh:
        different = [
            str(path.relative_to(fresh))
            for path in write_collections(Path(fresh), names)
            if not (target / path.relative_to(fresh)).exists()
            or not filecmp.cmp(path, target / path.relative_to(fresh), shallow=False)
        ]
    for name in different:
        click.echo(f"differs: {target / name}", err=True)
    if different:
        sys.exit(1)
    click.echo(f"{target}: every file is what its formula gives, bit for bit")
