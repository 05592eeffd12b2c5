"""Draw a figure of a run (profile, convergence) or of a problem (contacts)."""

from __future__ import annotations

import inspect
import math
import sys
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cpbench.cli.options import ListOption, format_option, publishable_option
from cpbench.cli.terminal import print_lines, replaced
from cpbench.cli.types import ADDRESS, LENGTH, PATH, POSITIVE
from cpbench.errors import FormatError, UnknownName

if TYPE_CHECKING:
    from cpbench.report.figure_kinds import Drawing, FigureKind

RUNS = "cpbench.report.plots"
OF_RUNS, OF_PROBLEMS = "runs", "problems"
OF_ROWS = ("node", "solvers", "families", "tolerance", "publishable")
"""Options that figures of runs share."""
OF_PROBLEM = ("file_format", "answer")
"""Options that figures of problems share."""
SETTINGS = ("start", "set", "measure", "threads")
"""Columns by which -p chooses rows."""


def packages() -> dict[str, str]:
    """Return the packages of kinds of figures, cpbench's own and those of the entry points, with what they draw."""
    from cpbench.foundation.extensions import FIGURES, added

    more = {entry.value: OF_RUNS if entry.name == OF_RUNS else OF_PROBLEMS for entry in added(FIGURES).values()}
    return {RUNS: OF_RUNS} | more


@cache
def _kinds() -> dict[str, tuple[str, str]]:
    """Return the package and the summary of each kind of figure."""
    from cpbench.report.figure_kinds import summaries

    return {name: (package, text) for package in packages() for name, text in summaries(package).items()}


def _kind(name: str) -> FigureKind:
    from cpbench.report.figure_kinds import find

    if name not in _kinds():
        raise UnknownName("figure", name, _kinds())
    return find(_kinds()[name][0], name)


def _draws_runs(name: str) -> bool:
    return packages()[_kinds()[name][0]] == OF_RUNS


class PlotCommand(click.Command):
    """A command whose help has the kinds of figures, or what the kind shows that its first argument names."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if args and not args[0].startswith("-"):
            ctx.meta["kind"] = _kind(args[0])
        return super().parse_args(ctx, args)

    def format_help_text(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write what the named kind shows and its parameters; without one, all kinds with a line each."""
        if "kind" in ctx.meta:
            kind: FigureKind = ctx.meta["kind"]
            formatter.write_paragraph()
            with formatter.indentation():
                formatter.write_text(inspect.cleandoc(sys.modules[kind.draw.__module__].__doc__ or ""))
            if kind.options:
                with formatter.section("Parameters (-p)"):
                    formatter.write_dl([(f"{name}={kind.options[name]}", text) for name, text in kind.helps.items()])
            return
        super().format_help_text(ctx, formatter)
        for title, of_runs in (("Kinds of runs", True), ("Kinds of problems", False)):
            kinds = [(name, text) for name, (_, text) in _kinds().items() if _draws_runs(name) == of_runs]
            if kinds:  # none of problems without the laboratory
                with formatter.section(title):
                    formatter.write_dl(kinds)


def _parameters(kind: FigureKind, given: tuple[str, ...]) -> tuple[dict[str, Any], dict[str, str]]:
    """Return the parameters of the kind, each of the type of its default, and the settings by which rows are chosen."""
    options: dict[str, Any] = {}
    settings: dict[str, str] = {}
    parameters = [*kind.options, *(SETTINGS if _draws_runs(kind.name) else ())]
    for text in given:
        name, _, value = text.partition("=")
        if name not in parameters:
            raise UnknownName(f"parameter of {kind.name}, in -p NAME=VALUE", name, parameters)
        if name in kind.options:
            options[name] = click.types.convert_type(type(kind.options[name])).convert(value, None, None)
        else:
            settings[name] = value
    return options, settings


@click.command(cls=PlotCommand)
@click.argument("kind")
@click.argument("file", required=False, type=ADDRESS, metavar="[RESULTS|FILE]")
@click.option(
    "-p",
    "parameters",
    multiple=True,
    metavar="NAME=VALUE",
    help=f"Parameter of the kind (cpbench plot KIND --help); of rows, where the results have several: "
    f"{', '.join(SETTINGS)}. Repeatable.",
)
@click.option("--node", default="", metavar="NAME", help="Formulation, where the results have several.")
@click.option("-s", "--solver", "solvers", cls=ListOption, metavar="GLOB", help="Solvers or labels. Repeatable.")
@click.option("--family", "families", cls=ListOption, metavar="GLOB", help="Families of problems. Repeatable.")
@click.option("-t", "--tolerance", type=POSITIVE, help="Tolerance, where the results have several.")
@publishable_option
@format_option
@click.option("--answer", type=PATH, help="Answer to FILE (.h5, .npy, .npz, .csv); default: the one in it.")
@click.option(
    "--width", type=LENGTH, default=math.nan, help="Width, as 3.5in or 89mm; of a column without explanation."
)
@click.option("--height", type=LENGTH, default=math.nan, help="Height, without title and explanation.")
@click.option("-o", "--output", type=PATH, required=True, help="Output file: x.svg, .png or .pdf.")
@click.option("--bare", is_flag=True, help="Leave out the title and the explanation below it.")
@click.pass_context
def command(
    ctx: click.Context,
    kind: str,
    parameters: tuple[str, ...],
    output: Path,
    width: float,
    height: float,
    bare: bool,
    **given: Any,
) -> None:
    """Draw a figure of a run or of a problem, as SVG, PNG or PDF: `cpbench plot profile my.sqlite -o profile.svg`.

    `cpbench plot KIND --help` has the parameters of a kind.
    """
    from cpbench.report import canvas

    canvas.require_suffix(output)
    before = [output] if output.exists() else []
    chosen: FigureKind = ctx.meta["kind"]
    of_runs = _draws_runs(kind)
    for name in OF_PROBLEM if of_runs else OF_ROWS:
        if given.pop(name):
            raise click.UsageError(f"--{name}: a figure of {'runs' if of_runs else 'problems'} has no such choice")
    options, settings = _parameters(chosen, parameters)
    column = canvas.narrow(width)
    with canvas.drawing(formulas=not of_runs):
        drawn = (
            _drawn_run(chosen, options, **given, **settings) if of_runs else _drawn_problem(chosen, options, **given)
        )
        canvas.resize(drawn.figure, width, height)
    with canvas.drawing():
        canvas.write(drawn, output, bare=bare, guide=not column)
    caption = [f"caption: {drawn.guide}".replace(r"\$", "$")] if column else []
    print_lines([f"{kind}: {replaced(output, before)}", *caption])


def _drawn_run(
    kind: FigureKind,
    options: Mapping[str, Any],
    file: str | None,
    tolerance: float | None,
    publishable: bool,
    **chosen: Any,
) -> Drawing:
    from cpbench.analysis.run_table import RunTable
    from cpbench.bench import history
    from cpbench.bench.results.store import Store
    from cpbench.report.chosen import Choice
    from cpbench.report.run import assembled

    choice = Choice(**chosen, tolerance=math.nan if tolerance is None else tolerance)
    with Store(_required(file, "RESULTS")) as store:
        table, histories = RunTable.of(store.table(), store.meta()), history.table(store.histories())
        run = assembled(table, Path(), histories, publishable=publishable)
    return kind.draw(run, choice, **options)


def _required(file: str | None, what: str) -> Path:
    if file is None:
        raise click.UsageError(f"Missing argument '{what}'.")
    return Path(file)


def _drawn_problem(
    kind: FigureKind,
    options: Mapping[str, Any],
    file: str | None,
    file_format: str | None,
    answer: Path | None,
) -> Drawing:
    from cpbench import storage

    _required(file, "FILE")
    problem, point = storage.load(str(file), format=file_format), None
    if answer is not None and kind.answer == "none":
        raise click.UsageError(f"--answer: {kind.name} shows none")
    if answer is not None:
        point = storage.load_answer(answer, problem)
    elif kind.answer != "none":
        stored = storage.solution(str(file))
        if stored is None and kind.answer == "required":
            remedy = "is missing; give an answer with --answer FILE (cpbench solve makes one)"
            raise FormatError(str(file), "solution", remedy)
        point = None if stored is None else stored[0]
    return kind.draw(problem, point, **options)
