"""`cpbench solve`."""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from cpbench import storage
from cpbench.bench import starts
from cpbench.bench.lane import Lane
from cpbench.bench.planning import plan
from cpbench.bench.results import answers
from cpbench.bench.staff import Setting
from cpbench.cli.answers import write_plain
from cpbench.cli.options import (
    Command,
    ListOption,
    facets_option,
    force_option,
    format_option,
    limit_options,
    number,
    require_with_via,
    tolerance_option,
)
from cpbench.cli.progress import compiling
from cpbench.cli.types import Address
from cpbench.errors import CpbenchError, NoRoute
from cpbench.plain_text import printable
from cpbench.solvers.base import solvers
from cpbench.storage.base import require_new
from cpbench.verification import MET_TOLERANCE, PROVEN


@click.command(cls=Command)
@click.argument("problem", type=Address())
@click.option("-s", "--solver", required=True, metavar="NAME[opt=value]", help="Solver (cpbench list solvers).")
@click.option("--via", cls=ListOption, metavar="CONVERSION", help="Go through this conversion.")
@facets_option
@click.option("--routes", type=click.Choice(["exact", "all"]), default="exact", show_default=True)
@click.option(
    "--start",
    default="cold",
    show_default=True,
    metavar="POLICY",
    help="Where the solver starts: cold, file or file:K (the file's guesses), perturbed:σ (near its solution).",
)
@tolerance_option
@limit_options
@click.option("-o", "--output", type=click.Path(path_type=Path), help="Write the answer (.h5, .npy, .csv).")
@click.option("--json", "as_json", is_flag=True, help="Print the row as JSON.")
@format_option
@force_option
def command(
    problem: str,
    solver: str,
    via: tuple[str, ...],
    facets: int,
    routes: str,
    start: str,
    tolerance: float,
    timeout: float,
    memory: int,
    threads: int,
    output: Path | None,
    as_json: bool,
    file_format: str | None,
    force: bool,
) -> None:
    """Solve one problem by one solver, in a process of its own, and say what the answer is worth.

    Ends with 1 unless the answer is verified, or the lack of one proved, so that `solve ... && lift ...` carries no
    wrong answer on. The answer is written all the same.
    """
    if output is not None:
        require_new(output, force)
    require_with_via(via)
    entry = plan.parse_entry(solver)
    policy = starts.parse_start(start)
    if policy.kind is starts.StartKind.PREVIOUS:
        raise CpbenchError(
            "--start previous: a problem by itself has no step before it; see cpbench run --start previous"
        )
    if policy.guess == starts.EVERY:
        raise CpbenchError("--start file:all: one solve has one start, as file:2; see cpbench run --start file:all")
    if via:
        asked = [plan.pinned(via, {"facets": facets})]
    else:
        asked = [plan.exact(), *(plan.requests("all", ())[1:] if routes == "all" else [])]
    asked = [replace(request, nodes=_only(entry, request)) for request in asked]
    limits = plan.Limits(timeout, memory, threads, repeats=1)
    with Lane(Setting(threads, memory, single=True)) as lane:
        lane.workers.begin(entry.solver, memory)
        survey = lane.survey(problem, asked, file_format, timeout)
        pairs = plan.pairs(
            [survey], [entry], asked, tolerance, limits, relaxations=routes == "all" or not via, start=str(policy)
        )
        if not pairs:
            raise NoRoute(
                f"no {routes} route from {survey['node']} to {solver}; "
                f"see: cpbench route {shlex.quote(problem)} --explain"
            )
        pair = pairs[0]
        prepared = lane.prepare(pair)
        lane.start([pair.entry.solver], limits, _warming)
        outcome = lane.run(pair, prepared)
    row, answer = outcome.row, outcome.answer
    if as_json:
        click.echo(json.dumps({"problem": pair.problem, "solver": pair.label, **row}))
    else:
        _print(pair, row)
    if answer is not None and output is not None:
        asked_problem = storage.load(problem, format=file_format)
        point = asked_problem.point_from_vector(answers.unpack(answer))
        if not write_plain(point, output, force=force):
            said = {"solver": pair.label, "claim": row["claim"], "verdict": row["status"], "residual": row["error"]}
            said |= {"tolerance": tolerance}
            storage.save_answer(output, asked_problem, point, said, force=force, with_problem=True)
        click.echo(f"answer: {output}", err=as_json)
    elif output is not None:
        click.echo("no answer to write", err=True)
        sys.exit(1)
    if row["status"] not in (*MET_TOLERANCE, *PROVEN):
        sys.exit(1)


def _only(entry: plan.Entry, request: plan.Request) -> tuple[str, ...]:
    """The solver's own node where the request is meant for it: no other one is looked for."""
    node = solvers.get(entry.solver).spec.node
    return (node,) if node in request.nodes or not request.nodes else request.nodes


def _warming(event: str, solver: str) -> None:
    if event == "compiling":
        click.echo(compiling(solver), err=True)


def _print(pair: plan.Pair, row: Mapping[str, Any]) -> None:
    click.echo(f"{pair.problem} ({pair.node}) by {pair.label}: {row['status']}")
    if row.get("started") not in (None, "cold"):
        click.echo(f"  started    {row['started']}")
    if row.get("route"):
        click.echo(f"  route      {row['route']} ({row['kind']})")
    if row.get("error") is not None:
        click.echo(f"  error      {number(row['error'])}, asked for {number(pair.tolerance)}; claimed {row['claim']}")
    if row.get("route") != "direct" and row.get("target_error") is not None:
        there, asked = number(row["target_error"]), number(row["target_tolerance"])
        click.echo(f"  there      {there}, asked for {asked}: the error on the solver's own problem")
    if row.get("flags"):
        click.echo(f"  flags      {row['flags']}")
    for name, value in json.loads(row.get("parts") or "{}").items():
        click.echo(f"    {name:<28} {number(value)}")
    times = {k: row[k] for k in ("load", "convert", "setup", "solve", "lift", "verify") if row.get(k) is not None}
    if times:
        click.echo("  seconds    " + ", ".join(f"{k} {number(v)}" for k, v in times.items()))
    counters = json.loads(row.get("counters") or "{}")
    if counters:
        click.echo("  counters   " + ", ".join(f"{k} {v}" for k, v in counters.items()))
    if row.get("message"):
        click.echo(f"  message    {printable(row['message'])}")
