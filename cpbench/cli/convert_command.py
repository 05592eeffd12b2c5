"""Convert a problem to another formulation; the file can lift answers back."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import click
import psutil

from cpbench import graph, storage
from cpbench.api.problems import convert, load
from cpbench.bench import starts
from cpbench.cli import verify_command
from cpbench.cli.info_command import sizes_line
from cpbench.cli.options import (
    ListOption,
    force_option,
    format_option,
    kinds_option,
    tolerance_option,
    via_option,
)
from cpbench.cli.terminal import print_lines
from cpbench.cli.types import ADDRESS, PATH, SETTINGS
from cpbench.conversions import Conversion
from cpbench.errors import CpbenchError, NotApplicable
from cpbench.formulations import Kind, Problem, formulations
from cpbench.generators.collection import address_text
from cpbench.graph import Apply, Arrival, checking
from cpbench.report.show import slip_angle
from cpbench.storage.answers import save_vector
from cpbench.storage.base import require_new
from cpbench.verification import error_text


@click.command()
@click.argument("source", metavar="IN", type=ADDRESS)
@click.argument("target_file", metavar="OUT", type=PATH)
@click.option("--to", "node", metavar="NODE", help="Formulation to reach; default: its own.")
@click.option(
    "--set", "settings", cls=ListOption, type=SETTINGS, metavar="NAME=VALUE", help="New value of a parameter."
)
@via_option
@click.option("--as", "written", metavar="NAME", help="Format of OUT, if its suffix does not determine it.")
@click.option("--check", is_flag=True, help="Carry an answer there and back, and show its errors and the times.")
@kinds_option()
@tolerance_option
@click.option("--lift", "converted", metavar="FILE", help="Converted problem whose answer IN is carried back to OUT.")
@format_option
@force_option
def command(
    source: str,
    target_file: Path,
    node: str | None,
    settings: tuple[tuple[str, float], ...],
    via: tuple[str, ...],
    written: str | None,
    check: bool,
    kinds: frozenset[Kind] | None,
    tolerance: float,
    converted: str | None,
    file_format: str | None,
    force: bool,
) -> None:
    """Convert a problem to another formulation, format, or parameters; the file OUT contains all that is needed to lift
    an answer back: `cpbench convert p.h5 q.h5 --to qp`.

    With --check, the solution in IN is pushed to the converted problem and lifted back. If IN has no solution that
    passes, an answer that a native solver finds to the converted problem is lifted. The exit code is 1 when the lifted
    answer of an exact conversion does not pass, or when there is none.

    With --lift q.h5, IN is an answer to q.h5 (.h5, .npy, .npz, .csv), and OUT (.h5, .npy, .csv) the answer to the
    problem that q.h5 was made of: `cpbench convert y.npy x.npy --lift q.h5`.
    """
    require_new(target_file, force)
    if converted is not None:
        if node or settings or via or written or check or kinds or file_format:
            raise click.UsageError("--lift goes back the way that its FILE came: it takes IN, OUT and --force alone")
        _lift(Path(source), target_file, converted, force)
        return
    if node is not None:
        formulations.get(node)
    problem = load(source, format=file_format)
    node = node or problem.node
    if settings:
        values = dict(settings)
        for name, value in settings:
            if values[name] != value:
                twice = f"{name} is {value:g} and {values[name]:g}: give it once"
                raise click.BadParameter(twice, param_hint="--set")
        problem = problem.with_parameters(values)
    done = graph.Memory()
    room = psutil.virtual_memory().available
    arrival = convert(problem, node, via, kinds=kinds, apply=lambda edge, p: _fitting(edge, p, done, room)).arrival
    guesses, lost = carried_starts(storage.guesses(source), arrival)
    storage.save(arrival.problem, target_file, format=written, force=force, guesses=guesses)
    print_lines([f"{address_text(source)} ({problem.node}: {sizes_line(problem)})"])
    print_lines([f"  by {arrival.route.label} ({arrival.kind})"])
    angles = map(slip_angle, arrival.problem.provenance[len(problem.provenance) :])
    print_lines(f"  {remark}" for remark in filter(None, angles))
    print_lines([f"{target_file} ({node}: {sizes_line(arrival.problem)})"])
    print_lines((f"left out: {reason}" for reason in lost), err=True)
    if check:
        stored = None if settings else storage.solution(source)
        known = None if stored is None else stored[0]
        report = checking.examine(problem, arrival, done.seconds(problem, arrival.route), known, tolerance)
        print_lines(check_lines(problem, report, tolerance))
        if not report.passed:
            sys.exit(1)


def _fitting(edge: Conversion, problem: Problem, apply: Apply, room: int) -> Problem:
    """Convert as `apply` does; raises NotApplicable, with the estimate, when the result may take more than `room` bytes
    of memory."""
    size = edge.predict(problem)
    if size is not None and size.bytes > room:
        raise NotApplicable(edge.label, f"would not fit: {size}, {room / 1e9:.3g} GB of memory are free")
    return apply(edge, problem)


def _lift(answer: Path, output: Path, address: str, force: bool) -> None:
    """Carry an answer to a converted problem back to the problem before all its conversions."""
    problem = load(address)
    if not problem.provenance:
        raise CpbenchError(f"{address}: was not converted by cpbench, there is nothing to lift")
    point = storage.load_answer(answer, problem)
    lifted, first = graph.lift(problem, point), problem.provenance[0]
    if not save_vector(lifted, output, force=force):
        name = {"name": problem.name}
        storage.save_point(output, lifted, node=first.source_node, fingerprint=first.source, attrs=name, force=force)
    print_lines((f"note: {remark}" for remark in graph.remarks(problem, point)), err=True)
    edges = " > ".join(step.conversion for step in problem.provenance)
    print_lines([f"{output}: answer to the {first.source_node} problem before {edges}"])


def carried_starts(points: Sequence[Any], arrival: Arrival) -> tuple[list[Any], list[str]]:
    """Return starting points on the converted problem, and a line for each that could not be carried."""
    carried: list[Any] = []
    lost: list[str] = []
    for k, point in enumerate(points, 1):
        try:
            carried.append(starts.carry(point, arrival.problem, len(arrival.route.steps)))
        except CpbenchError as cause:
            lost.append(f"starting point {k}: {cause}")
    return carried, lost


def check_lines(problem: Problem, report: checking.CheckReport, tolerance: float) -> Iterator[str]:
    """Yield the errors of an answer on both sides, what the lift does to them, and the times."""
    target, promise = report.arrival.problem, report.arrival.kind
    if not report.how:
        yield f"check: not possible, no answer at {tolerance:.3g} to {target.node}: {'; '.join(report.tried)}"
        return
    outcome = verify_command.outcome(problem, report.source)
    note = "" if promise.exact else f"; the route is {promise}: it need not"
    yield f"check: {report.how}"
    yield from (f"  not used       {reason}" for reason in report.tried)
    yield f"  error there    {error_text(report.target.error)} on {target.node}"
    yield f"  error here     {error_text(report.source.error)} on {problem.node}, {outcome}{note}"
    if report.moved is not None:
        beside = f"{report.moved:.3g} at most over {checking.MOVES} answers moved by {checking.MOVED:.3g}"
        yield f"  amplification  {report.amplification:.3g} by the lift; {beside}"
    yield from (f"  note           {remark}" for remark in report.remarks)
    yield f"  seconds        convert {report.apply:.3g}, lift {report.lift:.3g}"
