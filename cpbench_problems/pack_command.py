"""Make a problem file from matrices and vectors."""

from __future__ import annotations

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
from cpbench.formulations.base import formulations
from cpbench.formulations.contact import ContactProblem
from cpbench.storage.base import require_new
from cpbench_problems.formats import array_forms, array_problems
from cpbench_problems.formats.array_forms import ArrayForm
from cpbench_problems.formats.named_arrays import shapes_of


@click.command()
@click.argument("arrays", metavar="[NAME=]FILE...", nargs=-1, required=True)
@click.option("-o", "--output", required=True, type=PATH, help="Problem file.")
@click.option("--as", "asked", metavar="FORM", help="Formulation, or form of arrays; default: by their names.")
@click.option("--axes", type=click.Choice(["TTN", "TN"]), help="Order of the rows of a contact with the normal last.")
@click.option("--name", default="", help="Name of the problem; default: that of the file.")
@force_option
def command(arrays: tuple[str, ...], output: Path, asked: str | None, axes: str | None, name: str, force: bool) -> None:
    """Make a problem file from matrices and vectors in .npy, .npz (sparse), .mtx, .csv or .txt files.

    The name of a file is that of its array in the mathematics, unless NAME= says another. FORM is a formulation, or
    qpsolvers, osqp, quadprog, cvxopt, contactbench, boxed-lcp, least-squares or game.

    \b
      cpbench pack M.npy q.npy -o problem.h5
      cpbench pack W=delassus.mtx q=free.csv mu=friction.csv -o contact.h5 --as fc --axes TTN
      cpbench pack A.csv B.csv -o game.h5 --as game
    """
    files = dict(_split(text) for text in arrays)
    if len(files) < len(arrays):
        raise click.UsageError("two files have the name of one array: say NAME=FILE")
    require_new(output, force)
    values = {key: storage.read_array(file) for key, file in files.items()}
    try:
        form, text = array_problems.choose(output, shapes_of(values), array_forms.named(asked) if asked else None)
        if axes:
            values = _normal_first(values, form, axes)
        problem = array_problems.build_problem(output, values, form, text, name)
    except FormatError as cause:
        raise FormatError(files.get(cause.field, output), cause.field, cause.cause) from None
    storage.save(problem, output, force=force)
    print_lines([f"{output} ({problem.node}: {sizes_line(problem)})"])


def _split(text: str) -> tuple[str, Path]:
    """Return the name of an array and its file, from `NAME=FILE` or a file of that name."""
    name, equals, file = text.partition("=")
    return (name, Path(file)) if equals else (Path(text).stem, Path(text))


def _normal_first(values: dict[str, Any], form: ArrayForm, axes: str) -> dict[str, Any]:
    """Return the arrays with the last row of each contact as its first; raises CpbenchError."""
    cls = formulations.get(form.node)
    if not (form.own and issubclass(cls, ContactProblem)):
        raise CpbenchError(f"--axes is of contact problems, the arrays are of the form {form.name}")
    (symbol,) = form.arrays[cls.rows_of]
    result = dict(values)
    for key, symbols in form.arrays.items():
        for axis, size in enumerate(symbols if key in values else ()):
            rows = values[key].shape[axis]
            if size == symbol and rows % len(axes):
                raise CpbenchError(f"{key} has {rows} rows of contacts, --axes {axes} names {len(axes)} a contact")
            if size == symbol:
                order = np.roll(np.arange(rows).reshape(-1, len(axes)), 1, axis=1).ravel()
                result[key] = result[key][order] if axis == 0 else result[key][:, order]
    return result
