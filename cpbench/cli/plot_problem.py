"""The commands of `cpbench plot` that draw a problem, made from the kinds of installed packages."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import click

from cpbench import storage
from cpbench.cli.options import Command
from cpbench.cli.plot_options import OUTPUT, SIZE, caption, help_text, kind_option
from cpbench.cli.terminal import print_lines, replaced
from cpbench.cli.types import ADDRESS, PATH
from cpbench.errors import FormatError
from cpbench.formulations import Problem
from cpbench.report import canvas
from cpbench.report.figure_kinds import FigureKind, Need


def command_of(kind: FigureKind) -> click.Command:
    """Build `cpbench plot KIND [FILE] [--answer FILE] -o FIGURE` with the options of the kind."""
    parameters: list[click.Parameter] = []
    needed = kind.problem is Need.REQUIRED
    if kind.problem is not Need.NONE:
        parameters += [
            click.Argument(["source"], metavar="FILE" if needed else "[FILE]", type=ADDRESS, required=needed),
            click.Option(["--format", "file_format"], metavar="NAME", help="Format of the input."),
        ]
    if kind.answer is not Need.NONE:
        text = "Answer file (.h5, .npy, .npz, .csv); default: the candidate in the file's own /solution."
        parameters.append(click.Option(["--answer"], type=PATH, help=text))
    parameters += [kind_option(name, default, kind.helps[name]) for name, default in kind.options.items()]
    parameters += [*SIZE, *OUTPUT]

    def draw(
        output: Path,
        bare: bool,
        source: str | None = None,
        file_format: str | None = None,
        answer: Path | None = None,
        width: float = math.nan,
        height: float = math.nan,
        **options: Any,
    ) -> None:
        canvas.require_suffix(output)
        before = [output] if output.exists() else []
        problem = None if source is None else storage.load(source, format=file_format)
        point = None if kind.answer is Need.NONE else _answer(kind, source, problem, answer)
        with canvas.drawing():
            drawn = kind.draw(problem, point, **options)
            canvas.resize(drawn.figure, width, height)
            column = canvas.narrow(width)
            canvas.write(drawn, output, bare=bare, guide=not column)
        print_lines([f"{kind.name}: {replaced(output, before)}", *([caption(drawn)] if column else [])])

    return Command(kind.name, params=parameters, callback=draw, help=help_text(kind))


def _answer(kind: FigureKind, source: str | None, problem: Problem | None, answer: Path | None) -> Any:
    """Return the answer that was given, or stands in the file; None where there is none and none is needed."""
    if problem is None or source is None:
        if answer is not None:
            raise click.UsageError("--answer is of a problem: give its FILE too")
        return None
    if answer is not None:
        return storage.load_answer(answer, problem)
    stored = storage.solution(source)
    if stored is None and kind.answer is Need.REQUIRED:
        raise FormatError(source, "solution", "is missing; give an answer with --answer FILE (cpbench solve makes one)")
    return None if stored is None else stored[0]
