"""Solve one problem, and print the answer and what it is worth; or all solutions of a small one."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from cpbench.bench.processes.supervised import Stopped
from cpbench.bench.time_limits import GRACE, REFEREE, START, WARM_UP
from cpbench.cli import ahead
from cpbench.cli.options import (
    Command,
    facets_option,
    force_option,
    format_option,
    json_option,
    limit_options,
    require_with_via,
    tolerance_option,
    via_option,
)
from cpbench.cli.terminal import print_lines
from cpbench.cli.types import PATH
from cpbench.errors import CpbenchError
from cpbench.registry import PLUGIN_FILES


@click.command(cls=Command)
@click.argument("problem")
@click.option(
    "-s",
    "--solver",
    default=ahead.AUTO,
    show_default=True,
    metavar="NAME[opt=value]",
    help="Solver (cpbench list solvers); auto: cpbench chooses among its own, as cpbench.solve does.",
)
@via_option
@facets_option
@click.option(
    "--routes", type=click.Choice(["exact", "all"]), default="exact", show_default=True, help="Conversions to consider."
)
@click.option(
    "--start",
    default="cold",
    show_default=True,
    metavar="POLICY",
    help="Start of the solver: cold, file or file:K (the file's guesses).",
)
@tolerance_option
@limit_options
@click.option("-o", "--output", type=PATH, help="Output file of the answer (.h5, .npy, .csv).")
@click.option(
    "--all", "every", is_flag=True, help="List all solutions of a small LCP or MLCP, or of what is equivalent to one."
)
@click.option("-v", "--verbose", is_flag=True, help="Show all numbers of the answer, its route, times and measures.")
@json_option
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
    every: bool,
    verbose: bool,
    as_json: bool,
    file_format: str | None,
    force: bool,
) -> None:
    """Solve one problem, and print the answer and what it is worth.

    The answer is measured on the problem itself, whatever the solver says of it. Of a problem with contacts a table
    tells what each of them does. The solver runs in a separate process, which is stopped at the limits. With --all
    the command lists all solutions instead, found in exact arithmetic.

    The exit code is 1 unless the answer is verified, or it is proved that there is none, so that `solve ... && lift
    ...` lifts no wrong answer. The answer is written in either case.
    """
    require_with_via(via)
    if every and (solver != ahead.AUTO or via or start != "cold"):
        raise click.UsageError("--all looks at every complementary basis: leave out -s, --via and --start")
    asked = {
        "solver": solver,
        "via": via,
        "facets": facets,
        "routes": routes,
        "start": start,
        "tolerance": tolerance,
        "seconds": timeout,
        "memory": memory,
        "threads": threads,
        "output": None if output is None else str(output),
        "force": force,
        "format": file_format,
        "verbose": verbose,
        "all": every,
    }
    own = not os.environ.get(PLUGIN_FILES) and ahead.own_process(solver)
    answered = (_in_own_process if own else _apart)(problem, asked)
    for line in [json.dumps(answered["record"])] if as_json else answered["lines"]:
        click.echo(line)
    if output is not None and not answered["written"]:
        click.echo("no answer to write", err=True)
        sys.exit(1)
    if output is not None:
        print_lines([f"answer: {output}"], err=as_json)
    if not answered["good"]:
        sys.exit(1)


def _in_own_process(problem: str, asked: Mapping[str, Any]) -> Mapping[str, Any]:
    """Solve by a solver of cpbench, in one process; raises CpbenchError where there is nothing to solve."""
    seconds, known = asked["seconds"], {"address": problem, "problem": "", "node": "?"}
    around = REFEREE.limit(seconds)
    limits = {"read": START.limit(seconds) + around, "warm-up": WARM_UP.limit(seconds), "judge": around}

    def note(facts: Mapping[str, Any]) -> None:
        known.update(facts)
        if "compiling" in facts:
            _say_compiling(facts["compiling"])

    with ahead.solving(asked["threads"]) as process:
        try:
            reply = process.ask({**asked, "address": problem}, "read", {**limits, "solve": seconds + GRACE}, note)
        except Stopped as stopped:
            reply = _stopped(stopped, seconds, limits)
    if "refused" in reply:
        raise CpbenchError(reply["refused"])
    if "others" in reply:
        return _apart(problem, asked)
    return _without_answer(known, asked, reply) if "status" in reply else reply


def _stopped(stopped: Stopped, seconds: float, limits: Mapping[str, float]) -> dict[str, Any]:
    """Return status and message of a process that gave no answer."""
    if stopped.code is not None:
        cause = f"killed by signal {-stopped.code}" if stopped.code < 0 else f"exited with code {stopped.code}"
        return {"status": "crash", "message": f"{stopped.phase}: {cause}"}
    if stopped.phase == "solve":
        return {"status": "timeout", "message": f"killed after {seconds:g} s", "solve": seconds}
    return {"status": "error", "message": f"{stopped.phase}: not over after {limits[stopped.phase]:g} s"}


def _without_answer(known: Mapping[str, Any], asked: Mapping[str, Any], found: Mapping[str, Any]) -> dict[str, Any]:
    from cpbench.api.answered import Answered
    from cpbench.bench.results.rows import Outcome

    named = known["address"], known["problem"], known["node"]
    answered = Answered(*named, known.get("solver", asked["solver"]), asked["tolerance"], Outcome(**found))
    lines = list(answered.lines(verbose=asked["verbose"]))
    return {"lines": lines, "record": answered.record(), "good": False, "written": False}


def _apart(problem: str, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Solve by a solver of another package, in separate processes."""
    from cpbench.api.solve_apart import solve_apart
    from cpbench.bench.events import Compiling
    from cpbench.bench.planning.plan import Limits
    from cpbench.cli.types import ADDRESS
    from cpbench.storage.base import require_new

    if asked["output"] is not None:
        require_new(Path(asked["output"]), asked["force"])
    address = ADDRESS.convert(problem, None, None)
    if asked["all"]:
        from cpbench.foundation.extensions import hook

        reply: dict[str, Any] = hook("reply_to")(address, asked)
        return reply
    answered = solve_apart(
        address,
        asked["solver"],
        via=asked["via"],
        facets=asked["facets"],
        routes=asked["routes"],
        start=asked["start"],
        tolerance=asked["tolerance"],
        limits=Limits(asked["seconds"], asked["memory"], asked["threads"], repeats=1),
        format=asked["format"],
        on_event=lambda event: _say_compiling(event.solver) if isinstance(event, Compiling) else None,
    )
    output: str | None = asked["output"]
    written = output is not None and answered.point is not None
    if output is not None and written:
        answered.save(Path(output), force=asked["force"])
    lines = list(answered.lines(verbose=asked["verbose"]))
    return {"lines": lines, "record": answered.record(), "good": bool(answered), "written": written}


def _say_compiling(solver: str) -> None:
    from cpbench.cli.progress import compiling

    click.echo(compiling(solver), err=True)
