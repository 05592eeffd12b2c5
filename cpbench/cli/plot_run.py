"""The commands of `cpbench plot` that draw a run, made from the kinds in `report/plots`."""

from __future__ import annotations

import inspect
import math
import sys
from pathlib import Path
from typing import Any

import click

from cpbench.bench import history
from cpbench.bench.results.sealed import sealed
from cpbench.cli.options import Command, ListOption
from cpbench.cli.outputs import replaced
from cpbench.cli.types import Duration, Length
from cpbench.report import arrangement, canvas, run_canvas
from cpbench.report.chosen import Choice
from cpbench.report.figure_kinds import FigureKind
from cpbench.report.run import assembled

CHOICE: tuple[click.Option, ...] = (
    click.Option(["--node"], default="", metavar="NAME", help="Formulation, where the results have several."),
    ListOption(["--solver", "-s", "solvers"], metavar="GLOB", help="Only these solvers or labels. Repeatable."),
    ListOption(["--family", "families"], metavar="GLOB", help="Only these families. Repeatable."),
    click.Option(
        ["--tolerance", "-t"],
        type=click.FloatRange(min=0, min_open=True),
        help="Of the rows; another than was asked for judges their answers again.",
    ),
    click.Option(["--start"], default="", metavar="POLICY", help="Start, where the results have several."),
    click.Option(["--set"], default="", metavar="NAME", help="Set of the plan, where the results have several."),
    click.Option(["--measure"], default="", metavar="NAME", help="Measure, where the results have several."),
    click.Option(["--threads"], type=int, default=0, help="Number of threads, where the results have several."),
)
_ALWAYS = (
    click.Option(["--publishable"], is_flag=True, help="Leave out solvers that restrict the publishing of figures."),
    click.Option(["-o", "--output"], type=click.Path(path_type=Path), required=True, help="x.svg, .png or .pdf."),
    click.Option(["--width"], type=Length(), default=math.nan, help="Of the figure, as 3.5in or 89mm."),
    click.Option(["--height"], type=Length(), default=math.nan, help="Of what is between its title and its guide."),
    click.Option(["--legend"], type=click.Choice(arrangement.PLACES), help="Where the legend stands."),
    click.Option(["--bare"], is_flag=True, help="Leave out the title and the words on how to read it."),
)


def command_of(kind: FigureKind) -> click.Command:
    """`cpbench plot KIND RESULTS -o FIGURE` with the options of the kind and those that choose rows."""
    parameters: list[click.Parameter] = [click.Argument(["results"], type=click.Path(path_type=Path))]
    parameters += [_option(name, default, kind.helps[name]) for name, default in kind.options.items()]
    parameters += [*CHOICE, *_ALWAYS]

    def draw(results: Path, output: Path, bare: bool, publishable: bool, **given: Any) -> None:
        size, place = (given.pop("width"), given.pop("height")), given.pop("legend") or ""
        canvas.require_suffix(output)
        before = [output] if output.exists() else []
        own = {name: given.pop(name) for name in kind.options}
        tolerance = given.pop("tolerance")
        choice = Choice(**given, tolerance=math.nan if tolerance is None else tolerance)
        with sealed(results) as store:
            told = history.table(store.histories())
            run = assembled(store.table(), store.meta(), Path(), told, publishable=publishable)
        with run_canvas.drawing():
            drawn = kind.draw(run, choice, **own)
            arrangement.arrange(drawn.figure, *size, place)
        with canvas.drawing():
            canvas.write(drawn, output, bare=bare)
        click.echo(f"{kind.name}: {replaced(output, before)}")

    told = inspect.cleandoc(sys.modules[kind.draw.__module__].__doc__ or "")
    return Command(kind.name, params=parameters, callback=draw, help=told)


def _option(name: str, default: Any, told: str) -> click.Option:
    """An option of the type of its default; a number that has none is a duration."""
    flag = f"--{name.replace('_', '-')}"
    if isinstance(default, bool):
        return click.Option([flag], is_flag=True, default=default, help=told)
    if isinstance(default, float):
        return click.Option([flag], type=Duration(), default=default, help=told)
    return click.Option([flag], type=type(default), default=default, show_default=default != "", help=told)
