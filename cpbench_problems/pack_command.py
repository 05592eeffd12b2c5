"""Make a problem file from matrices and vectors."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click
import numpy as np

from cpbench import storage
from cpbench.cli.info_command import sizes_line
from cpbench.cli.options import force_option
from cpbench.cli.terminal import print_lines
from cpbench.cli.types import PATH
from cpbench.errors import CpbenchError, FormatError
from cpbench.storage.base import NOTE, require_new
from cpbench_problems.formats import array_forms, array_problems
from cpbench_problems.formats.array_files import array_values
from cpbench_problems.formats.array_forms import ArrayForm
from cpbench_problems.formats.engine_arrays import GROUPED
from cpbench_problems.formats.named_arrays import shapes_of, symmetrized

ORDERS = ("NTT", "TTN", "NT", "TN", GROUPED)


@click.command()
@click.argument("arrays", metavar="[NAME=]FILE...", nargs=-1, required=True)
@click.option("-o", "--output", required=True, type=PATH, help="Problem file.")
@click.option("--as", "asked", metavar="FORM", help="Formulation, or form of arrays; default: by their names.")
@click.option("--axes", type=click.Choice(ORDERS), help="Order of the rows of contacts; default: N first in each.")
@click.option(
    "--symmetric",
    type=click.Choice(["part", "upper", "lower"]),
    help="What is meant by a Hessian that is not symmetric.",
)
@click.option("--name", default="", help="Name of the problem; default: that of the file.")
@force_option
def command(
    arrays: tuple[str, ...],
    output: Path,
    asked: str | None,
    axes: str | None,
    symmetric: str | None,
    name: str,
    force: bool,
) -> None:
    """Make a problem file from matrices and vectors in .npy, .npz (sparse), .mtx, .csv or .txt files, or from the named
    arrays of one .npz or .mat file.

    The name of a file is that of its array in the mathematics, unless NAME= says another. FORM is a formulation, or
    one of the forms of arrays that `cpbench list formats` shows.

    \b
      cpbench pack M.npy q.npy -o problem.h5
      cpbench pack W=delassus.mtx q=free.csv mu=friction.csv -o contact.h5 --as fc --axes TTN
      cpbench pack A.csv B.csv -o game.h5 --as game
    """
    files = dict(_split(text) for text in arrays)
    if len(files) < len(arrays):
        raise click.UsageError("two files have the name of one array: say NAME=FILE")
    require_new(output, force)
    values = _named_arrays(files)
    try:
        form, text = array_problems.choose(output, shapes_of(values), array_forms.named(asked) if asked else None)
        if axes and "order" not in form.arrays:
            raise CpbenchError(f"--axes is of contact problems, the arrays are of the form {form.name}")
        values |= {"order": np.array(axes)} if axes else {}
        if symmetric:
            values = _whole(values, form, symmetric)
        problem = array_problems.build_problem(output, values, form, text, name)
    except FormatError as cause:
        names = "; NAME=FILE names the array of a file" if cause.cause.endswith(("rename or remove it", "them")) else ""
        raise FormatError(files.get(cause.field, output), cause.field, cause.cause + names) from None
    storage.save(problem, output, force=force)
    notes = [problem.info.properties[NOTE]] if NOTE in problem.info.properties else []
    print_lines([f"{output} ({problem.node}: {sizes_line(problem)})", *notes])


def _split(text: str) -> tuple[str, Path]:
    """Return the name of an array and its file, from `NAME=FILE` or a file of that name."""
    name, equals, file = text.partition("=")
    return (name, Path(file)) if equals else (Path(text).stem, Path(text))


def _named_arrays(files: Mapping[str, Path]) -> dict[str, Any]:
    """Return the array of each file by name, or all of one file; raises FormatError."""
    ((key, file),) = [*files.items()][:1]
    if len(files) == 1 and key == file.stem and file.suffix in (".npz", ".mat"):
        return array_values(file)
    return {key: storage.read_array(file) for key, file in files.items()}


def _whole(values: dict[str, Any], form: ArrayForm, how: str) -> dict[str, Any]:
    """Return the arrays with a symmetric Hessian; raises CpbenchError where the form has none."""
    name = form.meaning.hessian if form.meaning else ""
    if name not in values:
        raise CpbenchError(f"--symmetric is of the Hessian of a program, the arrays are of the form {form.name}")
    return {**values, name: symmetrized(values[name], how)}
