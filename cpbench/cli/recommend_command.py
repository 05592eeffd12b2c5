"""`cpbench recommend`."""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Sequence
from dataclasses import asdict
from itertools import islice
from pathlib import Path
from textwrap import shorten
from typing import TYPE_CHECKING, Any

import click

from cpbench.cli import next_command
from cpbench.cli.options import Address, Command, force_option, format_option

if TYPE_CHECKING:
    from cpbench.analysis.recommendation import Recommendation
    from cpbench.analysis.training_cases import TrainingCases
    from cpbench.api.candidates import Candidate
    from cpbench.formulations import Problem

CHECKED = 200
"""Problems of the formulation on which the advice is tried: a few seconds, however many were measured."""
SHOWN, LONGEST = 4, 160
"""Labels that were passed over, named with the reason; characters of a reason."""


@click.command(cls=Command)
@click.argument("problem", type=Address(), required=False)
@click.option(
    "--results",
    multiple=True,
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Results of a run, or a table that --make wrote, instead of the table that is shipped. Repeatable.",
)
@click.option(
    "-t",
    "--tolerance",
    type=click.FloatRange(min=0, min_open=True),
    help="With --results of runs: only what was measured at this tolerance; the command asks for it.",
)
@click.option("--warm", is_flag=True, help="For a solve that starts from a point near the answer.")
@click.option("--top", type=click.IntRange(min=1), default=3, show_default=True, help="How many solvers to name.")
@click.option("--any", "missing", is_flag=True, help="Solvers, too, that are not installed here.")
@click.option(
    "--routes",
    type=click.Choice(["exact", "all"]),
    default="exact",
    show_default=True,
    help="all: labels, too, that some route led to which promises less than an answer.",
)
@click.option("--evaluate", is_flag=True, help="Leave one origin out after the other: how often is the advice good?")
@click.option("--make", type=click.Path(path_type=Path, dir_okay=False), metavar="TABLE", help="Write a table to ship.")
@click.option("--json", "as_json", is_flag=True, help="For programs.")
@format_option
@force_option
def command(
    problem: str | None,
    results: tuple[Path, ...],
    tolerance: float | None,
    warm: bool,
    top: int,
    missing: bool,
    routes: str,
    evaluate: bool,
    make: Path | None,
    as_json: bool,
    file_format: str | None,
    force: bool,
) -> None:
    """Say which solver suits a problem, by what route, how sure that is, and the command that runs it.

    It goes by features of the problem (cpbench info shows more of them), and by what solvers came to on problems like
    it: those that are shipped, or of your own runs. Being sure means: how many problems like it were measured, and how
    often such advice is good for problems of an origin that was left out.
    """
    if sum((problem is not None, evaluate, make is not None)) != 1:
        raise click.UsageError("give a PROBLEM, or --evaluate, or --make TABLE")
    from cpbench.api import evidence
    from cpbench.cli import advice_tables

    if make is not None:
        advice_tables.make(make, results, force)
        return

    known, source, remarks = evidence.gather(results, warm, routes == "all", tolerance)
    if evaluate:
        advice_tables.evaluate(known, source, remarks, as_json)
    elif problem is not None:
        _recommend(problem, file_format, known, source, remarks, tolerance, warm, top, missing, as_json)


# ----------------------------------------------------------------------------------------------- problem


def _recommend(
    address: str,
    file_format: str | None,
    known: TrainingCases,
    source: str,
    remarks: list[str],
    tolerance: float | None,
    warm: bool,
    top: int,
    missing: bool,
    as_json: bool,
) -> None:
    from cpbench import storage
    from cpbench.analysis import validation
    from cpbench.api.advice import recommended

    asked = storage.load(address, format=file_format)
    advised = recommended(asked, known, source, remarks, warm=warm, top=top, missing=missing)
    found, taken, passed, remarks = advised.found, advised.taken, advised.passed, list(advised.remarks)
    apart = len(set(known.origins)) > 1
    rates = validation.rates(known, validation.evaluate(known, asked.node, CHECKED)).to_dict("records") if apart else []
    checked = rates[0] if rates and rates[0]["node"] == asked.node else None
    cold = warm and getattr(asked, "sequence", None) is None and not storage.guesses(address)
    if cold:
        remarks.append("the file has no starting point (guesses), so the command starts cold")
    runs = [_command(address, asked, one, tolerance, warm and not cold) for one in taken]
    if as_json:
        click.echo(json.dumps(_record(asked, source, remarks, found, taken, passed, runs, checked), indent=1))
        return
    click.echo(f"{asked.name or address} ({asked.node}), by {source}")
    for place, one in enumerate(taken, 1):
        _print(place, one, max(len(other.advice.label) for other in taken))
    click.echo(f"  run it     {runs[0]}")
    click.echo(f"  alike      {_alike(found, asked.node)}")
    click.echo(f"  checked    {_checked(checked, asked.node)}")
    for one in islice(passed, SHOWN):
        click.echo(f"  passed     {one.advice.label}: {shorten(one.obstacle, LONGEST, placeholder=' ...')}")
    if len(passed) > SHOWN:
        click.echo(f"  passed     and {len(passed) - SHOWN} more")
    for remark in remarks:
        click.echo(f"  remark     {remark}")


def _print(place: int, one: Candidate, width: int) -> None:
    advice = one.advice
    kind = "" if one.kind in ("equivalent", "one-way") else f", {one.kind}"
    click.echo(f"  {place}. {advice.label:<{width}} {one.route}{kind}: {one.told}")
    if one.here:
        click.echo(f"     cannot run here: {one.here}")


def _alike(found: Recommendation, node: str) -> str:
    """How much like it was measured."""
    if not any(one.measured for one in found.advice):
        return "no solver that was measured takes this problem; these were never measured"
    if not found.measured:
        return f"nothing like it was measured: no {node} problem at all; this is what is best on other formulations"
    nearest = f"the nearest is {found.nearest} (distance {found.distance:.2g})"
    if not found.known:
        return (
            f"nothing like it was measured: of {found.measured} {node} problems {nearest}; this is what is best on most"
        )
    return f"{found.similar} of {found.measured} {node} problems are like it; {nearest}"


def _checked(rate: dict[Any, Any] | None, node: str) -> str:
    """How good such advice is for origins that were left out."""
    if rate is None:
        return f"not at all: no {node} problem was measured, or all problems are of one origin"
    return (
        f"cross-validation by origin: the recommended solver solved {rate['solved']}/{rate['problems']} "
        f"{node} problems, "
        f"{rate['within']} of them within 2× of the fastest; the best one of all, in hindsight, {rate['single_within']}"
    )


def _command(address: str, asked: Problem, one: Candidate, tolerance: float | None, warm: bool) -> str:
    """What runs it; a step of a scene starts warm from the step before, another problem from its file's guess."""
    from cpbench.generators.collection import builtin_folder

    inside = Path(address).is_relative_to(builtin_folder())
    place = f"builtin/{Path(address).relative_to(builtin_folder())}" if inside else address
    options = [*shlex.split(one.options), *(["--tolerance", f"{tolerance:g}"] if tolerance is not None else [])]
    if warm and getattr(asked, "sequence", None) is not None:
        scene = place.partition("::")[0] if "::" in place else str(Path(place).parent)
        return next_command.line("run", scene, *options, "--start", "previous")
    return next_command.line("solve", place, *options, *(["--start", "file"] if warm else []))


def _record(
    asked: Problem,
    source: str,
    remarks: Sequence[str],
    found: Recommendation,
    taken: Sequence[Candidate],
    passed: Sequence[Candidate],
    runs: Sequence[str],
    checked: dict[Any, Any] | None,
) -> dict[str, Any]:
    return {
        "problem": asked.name,
        "node": asked.node,
        "fingerprint": asked.fingerprint,
        "source": source,
        "recommended": [
            {
                **asdict(one.advice),
                "times_the_fastest": 2**one.advice.loss if one.advice.measured else None,
                "route": one.route,
                "kind": one.kind,
                "cannot_run": one.here,
                "command": run,
            }
            for one, run in zip(taken, runs, strict=True)
        ],
        "passed": {one.advice.label: one.obstacle for one in passed},
        "measured": found.measured,
        "similar": found.similar,
        "nearest": found.nearest,
        "distance": found.distance if math.isfinite(found.distance) else None,
        "checked": checked,
        "remarks": list(remarks),
    }
