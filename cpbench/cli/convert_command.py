"""`cpbench convert`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
import psutil

from cpbench import checking, graph, storage
from cpbench.api.problems import convert, load
from cpbench.bench import starts
from cpbench.cli.options import (
    Address,
    Command,
    ListOption,
    Memory,
    facets_option,
    force_option,
    format_option,
    number,
    require_with_via,
    tolerance_option,
)
from cpbench.cli.progress import converting
from cpbench.cli.routes import kinds_option, sizes_line
from cpbench.errors import CpbenchError
from cpbench.formulations import Kind, Problem, formulations
from cpbench.generators.collection import address_text
from cpbench.report.show import slip_angle
from cpbench.storage.base import require_new


@click.command(cls=Command)
@click.argument("source", metavar="IN", type=Address())
@click.argument("target_file", metavar="OUT", type=click.Path(path_type=Path))
@click.option(
    "--to", "node", metavar="NODE", help="Formulation to reach (cpbench list formulations).  [default: its own]"
)
@click.option(
    "--set",
    "settings",
    cls=ListOption,
    metavar="NAME=VALUE",
    help="Another value of a named parameter first.",
)
@click.option(
    "--via",
    cls=ListOption,
    metavar="CONVERSION",
    help="Go through this conversion (full name or its end).",
)
@facets_option
@click.option("--angle", type=float, default=0.0, show_default=True, help="Angle of the first facet [rad].")
@click.option("--as", "written", metavar="NAME", help="Format of OUT, where its suffix does not tell.")
@click.option("--check", is_flag=True, help="Send an answer there and back: errors, amplification, times; exit 1.")
@click.option(
    "--memory",
    type=Memory(),
    help="Refuse a conversion that may make more than this, 8G say; 0: no limit.  [default: what is available]",
)
@kinds_option
@tolerance_option
@format_option
@force_option
def command(
    source: str,
    target_file: Path,
    node: str | None,
    settings: tuple[str, ...],
    via: tuple[str, ...],
    facets: int,
    angle: float,
    written: str | None,
    check: bool,
    memory: int | None,
    kinds: frozenset[Kind],
    tolerance: float,
    file_format: str | None,
    force: bool,
) -> None:
    """Convert a problem to another formulation, format, or parameters; OUT knows how to lift an answer back.

    With --check, the solution in IN is carried there and back, or, where there is none that passes, an answer that a
    native solver finds there; exit code 1 when an exact conversion's lifted answer does not pass, or there is none.
    """
    if node is not None:
        formulations.get(node)
    require_with_via(via)
    require_new(target_file, force)
    problem = load(source, format=file_format)
    node = node or problem.node
    if settings:
        problem = problem.with_parameters(_values(settings))
    room = psutil.virtual_memory().available if memory is None else memory
    done = graph.Memory()
    apply = lambda edge, p: converting(edge, p, done, room)  # noqa: E731
    arrival = convert(problem, node, via, kinds=kinds, knobs={"facets": facets, "angle": angle}, apply=apply).arrival
    guesses, lost = _carried(storage.guesses(source), arrival)
    storage.save(arrival.problem, target_file, format=written, force=force, guesses=guesses)
    click.echo(f"{address_text(source)} ({problem.node}: {sizes_line(problem)})")
    click.echo(f"  by {arrival.route.label} ({arrival.kind})")
    for remark in filter(None, map(slip_angle, arrival.problem.provenance[len(problem.provenance) :])):
        click.echo(f"  {remark}")
    click.echo(f"{target_file} ({node}: {sizes_line(arrival.problem)})")
    for reason in lost:
        click.echo(f"left out: {reason}", err=True)
    if check:
        found = None if settings else storage.solution(source)
        known = None if found is None else found[0]
        report = checking.examine(problem, arrival, done.seconds(problem, arrival.route), known, tolerance)
        _print(problem, report, tolerance)
        if not report.passed:
            sys.exit(1)


def _carried(points: Sequence[Any], arrival: graph.Arrival) -> tuple[list[Any], list[str]]:
    """The starting points on the converted problem, and which could not be carried, and why."""
    carried: list[Any] = []
    lost: list[str] = []
    for k, point in enumerate(points, 1):
        try:
            carried.append(starts.carry(point, arrival.problem, len(arrival.route.steps)))
        except CpbenchError as cause:
            lost.append(f"starting point {k}: {cause}")
    return carried, lost


def _values(settings: tuple[str, ...]) -> dict[str, float]:
    found: dict[str, float] = {}
    for name, value in map(_setting, settings):
        if found.setdefault(name, value) != value:
            raise click.BadParameter(f"{name} is {found[name]:g} and {value:g}: give it once", param_hint="--set")
    return found


def _setting(text: str) -> tuple[str, float]:
    name, _, value = text.rpartition("=")
    try:
        return name, float(value)
    except ValueError:
        raise click.BadParameter(f"'{text}' is not NAME=VALUE, as in nu=0.5", param_hint="--set") from None


def _print(problem: Problem, report: checking.CheckReport, tolerance: float) -> None:
    target, promise = report.arrival.problem, report.arrival.kind
    if not report.how:
        click.echo(f"check: not possible, no answer at {number(tolerance)} to {target.node}: {'; '.join(report.tried)}")
        return
    passes = "passes" if report.source.solved else "does not pass"
    note = "" if promise.exact else f"; the route is {promise}: it need not"
    click.echo(f"check: {report.how}")
    for reason in report.tried:
        click.echo(f"  not used       {reason}")
    click.echo(f"  error there    {number(report.target.error)} on {target.node}")
    click.echo(
        f"  error here     {number(report.source.error)} on {problem.node}, {passes} at {number(tolerance)}{note}"
    )
    if report.moved is not None:
        beside = f"{number(report.moved)} at most over {checking.MOVES} answers moved by {number(checking.MOVED)}"
        click.echo(f"  amplification  {number(report.amplification)} by the lift; {beside}")
    for remark in report.remarks:
        click.echo(f"  note           {remark}")
    click.echo(f"  seconds        convert {number(report.apply)}, lift {number(report.lift)}")
