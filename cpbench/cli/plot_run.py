"""The commands of `cpbench plot` that draw a run, made from the kinds in `report/plots`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import click

from cpbench.analysis.run_table import RunTable
from cpbench.bench import history
from cpbench.bench.results.store import Store
from cpbench.cli.options import Command, ListOption
from cpbench.cli.plot_options import OUTPUT, SIZE, caption, help_text, kind_option
from cpbench.cli.terminal import print_lines, replaced
from cpbench.cli.types import PATH, POSITIVE
from cpbench.report import canvas, run_canvas
from cpbench.report.chosen import Choice
from cpbench.report.figure_kinds import FigureKind
from cpbench.report.run import assembled

CHOICE: tuple[click.Option, ...] = (
    click.Option(["--node"], default="", metavar="NAME", help="Formulation, where the results have several."),
    ListOption(["--solver", "-s", "solvers"], metavar="GLOB", help="Solvers or labels to show (globs). Repeatable."),
    ListOption(["--family", "families"], metavar="GLOB", help="Families to show (globs). Repeatable."),
    click.Option(["--tolerance", "-t"], type=POSITIVE, help="Tolerance, where the results have several."),
    *(
        click.Option([f"--{name}"], default="", metavar=value, help=f"{name.title()}, where the results have several.")
        for name, value in (("start", "POLICY"), ("set", "NAME"), ("measure", "NAME"))
    ),
    click.Option(["--threads"], type=int, default=0, help="Number of threads, where the results have several."),
)
_PUBLISHABLE = click.Option(
    ["--publishable"], is_flag=True, help="Leave out solvers that restrict the publishing of figures."
)


def command_of(kind: FigureKind) -> click.Command:
    """Build `cpbench plot KIND RESULTS -o FIGURE` with the options of the kind and those that choose rows."""
    parameters: list[click.Parameter] = [click.Argument(["results"], type=PATH)]
    parameters += [kind_option(name, default, kind.helps[name]) for name, default in kind.options.items()]
    parameters += [*CHOICE, _PUBLISHABLE, *SIZE, *OUTPUT]

    def draw(results: Path, output: Path, bare: bool, publishable: bool, **given: Any) -> None:
        width, height = given.pop("width"), given.pop("height")
        canvas.require_suffix(output)
        before = [output] if output.exists() else []
        own = {name: given.pop(name) for name in kind.options}
        tolerance = given.pop("tolerance")
        choice = Choice(**given, tolerance=math.nan if tolerance is None else tolerance)
        with Store(results) as store:
            histories = history.table(store.histories())
            table = RunTable.of(store.table(), store.meta())
            run = assembled(table, Path(), histories, publishable=publishable)
        with run_canvas.drawing():
            drawn = kind.draw(run, choice, **own)
            canvas.resize(drawn.figure, width, height)
        column = canvas.narrow(width)
        with canvas.drawing():
            canvas.write(drawn, output, bare=bare, guide=not column)
        print_lines([f"{kind.name}: {replaced(output, before)}", *([caption(drawn)] if column else [])])

    return Command(kind.name, params=parameters, callback=draw, help=help_text(kind))
