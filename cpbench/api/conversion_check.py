"""A conversion of a file in full: starting points carried along, and a check of the way there and back in lines."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from cpbench.api import verdict_text
from cpbench.bench import starts
from cpbench.errors import CpbenchError
from cpbench.formulations import Problem
from cpbench.graph import Arrival, checking
from cpbench.verification import error_text


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


def lines(problem: Problem, report: checking.CheckReport, tolerance: float) -> Iterator[str]:
    """Yield the errors of an answer on both sides, what the lift does to them, and the times."""
    target, promise = report.arrival.problem, report.arrival.kind
    if not report.how:
        yield f"check: not possible, no answer at {tolerance:.3g} to {target.node}: {'; '.join(report.tried)}"
        return
    outcome = verdict_text.outcome(problem, report.source)
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
