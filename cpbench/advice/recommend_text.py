"""A recommendation as lines for a reader, and as data for programs."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from itertools import islice
from pathlib import Path
from textwrap import shorten
from typing import Any

from cpbench.advice import validation
from cpbench.advice.candidates import Candidate
from cpbench.advice.recommend import Recommended
from cpbench.advice.recommendation import Recommendation
from cpbench.analysis.training_cases import TrainingCases
from cpbench.formulations import Problem

CHECKED = 200
"""Problems of the formulation on which the advice is tried: a few seconds, however many were measured."""
SHOWN, LONGEST = 4, 160
"""Labels that were passed over, named with the reason; characters of a reason."""


def checked_rates(known: TrainingCases, node: str) -> Mapping[Any, Any] | None:
    """Return how good such advice is on origins that were left out, None where there are not two of them."""
    if len(set(known.origins)) < 2:
        return None
    rates = validation.rates(known, validation.evaluate(known, node, CHECKED)).to_dict("records")
    return rates[0] if rates and rates[0]["node"] == node else None


def lines(
    problem: Problem, advised: Recommended, checked: Mapping[Any, Any] | None, commands: Sequence[str]
) -> Iterator[str]:
    """Yield the solvers with their routes, the command that runs the first, and how sure the advice is.

    Parameters
    ----------
    checked : what `checked_rates` returned. commands : one for each solver that is named.
    """
    width = max(len(one.advice.label) for one in advised.taken)
    for place, one in enumerate(advised.taken, 1):
        kind = "" if one.kind in ("equivalent", "one-way") else f", {one.kind}"
        yield f"  {place}. {one.advice.label:<{width}} {one.route}{kind}: {one.summary}"
        if one.here:
            yield f"     cannot run here: {one.here}"
    yield f"  run it     {commands[0]}"
    yield f"  alike      {_alike(advised.found, problem.node)}"
    yield f"  checked    {_checked(checked, problem.node)}"
    for one in islice(advised.passed, SHOWN):
        yield f"  passed     {one.advice.label}: {shorten(one.obstacle, LONGEST, placeholder=' ...')}"
    if len(advised.passed) > SHOWN:
        yield f"  passed     and {len(advised.passed) - SHOWN} more"
    yield from (f"  remark     {remark}" for remark in advised.remarks)


def record(
    problem: Problem, advised: Recommended, checked: Mapping[Any, Any] | None, commands: Sequence[str]
) -> dict[str, Any]:
    """Return the same as data that JSON takes."""
    found = advised.found
    return {
        "problem": problem.name,
        "node": problem.node,
        "fingerprint": problem.fingerprint,
        "source": advised.source,
        "recommended": [
            {
                **asdict(one.advice),
                "times_the_fastest": 2**one.advice.loss if one.advice.measured else None,
                "route": one.route,
                "kind": one.kind,
                "cannot_run": one.here,
                "command": command,
            }
            for one, command in zip(advised.taken, commands, strict=True)
        ],
        "passed": {one.advice.label: one.obstacle for one in advised.passed},
        "measured": found.measured,
        "similar": found.similar,
        "nearest": found.nearest,
        "distance": found.distance if math.isfinite(found.distance) else None,
        "checked": checked,
        "remarks": list(advised.remarks),
    }


def command_words(address: str, problem: Problem, one: Candidate, tolerance: float | None, warm: bool) -> list[str]:
    """Return the words of the command that runs a solver on the problem.

    A step of a scene starts warm from the step before, another problem from the guess in its file.
    """
    from cpbench.generators.collection import builtin_folder

    inside = Path(address).is_relative_to(builtin_folder())
    place = f"builtin/{Path(address).relative_to(builtin_folder())}" if inside else address
    options = [*shlex.split(one.options), *(["--tolerance", f"{tolerance:g}"] if tolerance is not None else [])]
    if warm and getattr(problem, "sequence", None) is not None:
        scene = place.partition("::")[0] if "::" in place else str(Path(place).parent)
        return ["run", scene, *options, "--start", "previous"]
    return ["solve", place, *options, *(["--start", "file"] if warm else [])]


def _alike(found: Recommendation, node: str) -> str:
    """Return how many problems like it were measured."""
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


def _checked(rate: Mapping[Any, Any] | None, node: str) -> str:
    """Return how good such advice is for origins that were left out."""
    if rate is None:
        return f"not at all: no {node} problem was measured, or all problems are of one origin"
    return (
        f"cross-validation by origin: the recommended solver solved {rate['solved']}/{rate['problems']} "
        f"{node} problems, {rate['within']} of them within 2× of the fastest; the best one of all, in hindsight, "
        f"{rate['single_within']}"
    )
