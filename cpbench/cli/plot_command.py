"""Draw a figure of a run (profile, pairs, scaling, ...) or of a problem (friction cone, contacts, ...)."""

from __future__ import annotations

import inspect
import math
import sys
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cpbench.cli.options import ListOption
from cpbench.cli.terminal import print_lines, replaced
from cpbench.cli.types import ADDRESS, DURATION, FACET_LIST, LENGTH, PATH, POSITIVE
from cpbench.errors import FormatError, UnknownName

if TYPE_CHECKING:
    from cpbench.report.figure_kinds import Drawing, FigureKind

RUNS = "cpbench.report.plots"
OF_RUNS, OF_PROBLEMS = "runs", "problems"
RUN_OPTIONS = ("node", "solvers", "families", "tolerance", "only", "publishable")
"""Parameters that figures of runs share."""
SETTINGS = ("start", "set", "measure", "threads")
"""Columns by which --only chooses."""


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
    """A command that takes, beside its own options, those of the kind of figure that its first argument names."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if args and not args[0].startswith("-"):
            ctx.meta["kind"] = _kind(args[0])
        try:
            return super().parse_args(ctx, args)
        except click.NoSuchOption as refusal:
            flag = refusal.option_name
            users = [name for name in _kinds() if flag in _flags(self, ctx, name)]
            if "kind" not in ctx.meta or not users:
                raise
            text = f"{flag} is no option of {ctx.meta['kind'].name}; it is one of {', '.join(users)}"
            raise click.UsageError(text, ctx) from None

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        params = super().get_params(ctx)
        return _params_of(ctx.meta["kind"], params) if "kind" in ctx.meta else params

    def format_help_text(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write what the named kind shows; without one, all kinds with a line each."""
        if "kind" in ctx.meta:
            formatter.write_paragraph()
            with formatter.indentation():
                formatter.write_text(inspect.cleandoc(sys.modules[ctx.meta["kind"].draw.__module__].__doc__ or ""))
            return
        super().format_help_text(ctx, formatter)
        for title, of_runs in (("Kinds of runs", True), ("Kinds of problems", False)):
            with formatter.section(title):
                formatter.write_dl(
                    [(name, text) for name, (_, text) in _kinds().items() if _draws_runs(name) == of_runs]
                )


def _params_of(kind: FigureKind, shared: list[click.Parameter]) -> list[click.Parameter]:
    """Return the parameters of a kind: those of `shared` that it uses, and its own."""
    unused = ["file_format", "answer"] if _draws_runs(kind.name) else list(RUN_OPTIONS)
    if not _draws_runs(kind.name):
        unused += ["file", "file_format"] if kind.problem == "none" else []
        unused += ["answer"] if kind.answer == "none" else []
    own = [_own_option(name, default, kind.helps[name]) for name, default in kind.options.items()]
    names = {option.name for option in own}
    head, *rest = (param for param in shared if param.name not in unused and param.name not in names)
    return [head, *rest[:1], *own, *rest[1:]]


def _flags(command: click.Command, ctx: click.Context, name: str) -> set[str]:
    return {flag for param in _params_of(_kind(name), click.Command.get_params(command, ctx)) for flag in param.opts}


def _own_option(name: str, default: Any, text: str) -> click.Option:
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


@click.command(cls=PlotCommand)
@click.argument("kind")
@click.argument("file", required=False, type=ADDRESS, metavar="[RESULTS|FILE]")
@click.option("--node", default="", metavar="NAME", help="Formulation, where the results have several.")
@click.option("-s", "--solver", "solvers", cls=ListOption, metavar="GLOB", help="Solvers or labels. Repeatable.")
@click.option("--family", "families", cls=ListOption, metavar="GLOB", help="Families of problems. Repeatable.")
@click.option("-t", "--tolerance", type=POSITIVE, help="Tolerance, where the results have several.")
@click.option(
    "--only",
    cls=ListOption,
    metavar="NAME=VALUE",
    help=f"Rows, where the results have several: {', '.join(SETTINGS)}. Repeatable.",
)
@click.option("--publishable", is_flag=True, help="Leave out solvers that restrict the publishing of figures.")
@click.option("--format", "file_format", metavar="NAME", help="Format of FILE.")
@click.option("--answer", type=PATH, help="Answer to FILE (.h5, .npy, .npz, .csv); default: the one in it.")
@click.option(
    "--width", type=LENGTH, default=math.nan, help="Width, as 3.5in or 89mm; of a column without explanation."
)
@click.option("--height", type=LENGTH, default=math.nan, help="Height, without title and explanation.")
@click.option("-o", "--output", type=PATH, required=True, help="Output file: x.svg, .png or .pdf.")
@click.option("--bare", is_flag=True, help="Leave out the title and the explanation below it.")
@click.pass_context
def command(ctx: click.Context, kind: str, output: Path, width: float, height: float, bare: bool, **given: Any) -> None:
    """Draw a figure of a run or of a problem, as SVG, PNG or PDF: `cpbench plot profile my.sqlite -o profile.svg`.

    `cpbench plot KIND --help` has the options of a kind.
    """
    from cpbench.report import canvas, run_canvas

    canvas.require_suffix(output)
    before = [output] if output.exists() else []
    chosen: FigureKind = ctx.meta["kind"]
    own = {name: given.pop(name) for name in chosen.options}
    column = canvas.narrow(width)
    with run_canvas.drawing() if _draws_runs(kind) else canvas.drawing():
        drawn = _drawn_run(chosen, own, **given) if _draws_runs(kind) else _drawn_problem(chosen, own, **given)
        canvas.resize(drawn.figure, width, height)
    with canvas.drawing():
        canvas.write(drawn, output, bare=bare, guide=not column)
    caption = [f"caption: {drawn.guide}".replace(r"\$", "$")] if column else []
    print_lines([f"{kind}: {replaced(output, before)}", *caption])


def _drawn_run(
    kind: FigureKind,
    own: Mapping[str, Any],
    file: str | None,
    only: tuple[str, ...],
    tolerance: float | None,
    publishable: bool,
    **chosen: Any,
) -> Drawing:
    from cpbench.analysis.run_table import RunTable
    from cpbench.bench import history
    from cpbench.bench.results.store import Store
    from cpbench.report.chosen import Choice
    from cpbench.report.run import assembled

    for text in only:
        name, _, value = text.partition("=")
        if name not in SETTINGS:
            raise UnknownName("name in --only NAME=VALUE", name, SETTINGS)
        chosen[name] = value
    choice = Choice(**chosen, tolerance=math.nan if tolerance is None else tolerance)
    with Store(_required(file, "RESULTS")) as store:
        table, histories = RunTable.of(store.table(), store.meta()), history.table(store.histories())
        run = assembled(table, Path(), histories, publishable=publishable)
    return kind.draw(run, choice, **own)


def _required(file: str | None, what: str) -> Path:
    if file is None:
        raise click.UsageError(f"Missing argument '{what}'.")
    return Path(file)


def _drawn_problem(
    kind: FigureKind,
    own: Mapping[str, Any],
    file: str | None = None,
    file_format: str | None = None,
    answer: Path | None = None,
) -> Drawing:
    from cpbench import storage

    if kind.problem == "required":
        _required(file, "FILE")
    problem = None if file is None else storage.load(file, format=file_format)
    point = None
    if problem is None:
        if answer is not None:
            raise click.UsageError("--answer is of a problem: give its FILE too")
    elif answer is not None:
        point = storage.load_answer(answer, problem)
    elif kind.answer != "none":
        stored = storage.solution(str(file))
        if stored is None and kind.answer == "required":
            remedy = "is missing; give an answer with --answer FILE (cpbench solve makes one)"
            raise FormatError(str(file), "solution", remedy)
        point = None if stored is None else stored[0]
    return kind.draw(problem, point, **own)
