"""Options that all figures share, and those that a kind of figure declares."""

from __future__ import annotations

import inspect
import math
import sys
from typing import Any

import click

from cpbench.cli.options import ListOption
from cpbench.cli.types import DURATION, FACET_LIST, LENGTH, PATH
from cpbench.report import canvas
from cpbench.report.figure_kinds import Drawing, FigureKind

OUTPUT = (
    click.Option(["-o", "--output"], type=PATH, required=True, help="Output file: x.svg, .png or .pdf."),
    click.Option(["--bare"], is_flag=True, help="Leave out the title and the explanation below it."),
)
SIZE = (
    click.Option(
        ["--width"],
        type=LENGTH,
        default=math.nan,
        help=f"Width of the figure, as 3.5in or 89mm; below {canvas.NARROW:g}in without the explanation, which is "
        "printed.",
    ),
    click.Option(
        ["--height"], type=LENGTH, default=math.nan, help="Height of the figure, without title and explanation."
    ),
)


def caption(drawn: Drawing) -> str:
    """Return the explanation of a figure that has no room for it, as a line for its caption."""
    return f"caption: {drawn.guide}".replace(r"\$", "$")


def help_text(kind: FigureKind) -> str:
    """Return what the module of a figure says of it."""
    return inspect.cleandoc(sys.modules[kind.draw.__module__].__doc__ or "")


def kind_option(name: str, default: Any, text: str) -> click.Option:
    """Return an option of the type of its default; a tuple is a list of facet counts, NaN an unset duration."""
    flag = f"--{name.replace('_', '-')}"
    if isinstance(default, bool):
        return click.Option([flag], is_flag=True, default=default, help=text)
    if isinstance(default, tuple):
        shown = ",".join(map(str, default))
        return ListOption([flag], type=FACET_LIST, default=(shown,), show_default=shown, help=text)
    if isinstance(default, float) and math.isnan(default):
        return click.Option([flag], type=DURATION, default=default, help=text)
    return click.Option([flag], type=type(default), default=default, show_default=default not in ("", -1), help=text)
