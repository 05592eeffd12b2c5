"""A conversion there and back on one problem: convert, solve, lift and measure; push a known answer and measure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from cpbench import Budget, Claim, CpbenchError, Kind, Point, Problem, arrive, lift, make
from cpbench.errors import NoRoute, NotApplicable
from cpbench.foundation.matrices import Vector
from cpbench.graph import Arrival
from cpbench.solvers.base import solve

TOLERANCE = 1e-12
"""Asked of every solver; what it reached is measured."""
HOMES = {
    "qp": (("qp", "daqp"),),
    "lcp": (("lcp", "lemke"),),
    "mlcp": (("lcp", "lemke"),),
    "avi": (("lcp", "lemke"),),
    "relay": (("lcp", "lemke"),),
    "coneqp": (("soclcp", "newton-soclcp"), ("coneqp", "interior-point-coneqp")),
    "soclcp": (("soclcp", "newton-soclcp"),),
    "fc": (("fc", "nsgs"),),
    "afc": (("fc", "nsgs"),),
    "fcm": (("fc", "nsgs"),),
    "gfc": (("fc", "nsgs"),),
    "rfc": (("rfc", "nsgs-rfc"),),
    "grfc": (("rfc", "nsgs-rfc"),),
    "nlp": (("micp", "josephy-newton"),),
    "ncp": (("micp", "josephy-newton"),),
    "micp": (("micp", "josephy-newton"),),
    "ge": (("micp", "josephy-newton"), ("vi", "newton-vi")),
    "vi": (("micp", "josephy-newton"), ("vi", "newton-vi")),
    "cp": (("vi", "newton-vi"),),
    "qvi": (("qvi", "newton-qvi"),),
    "equation": (("equation", "newton-equation"),),
    "nfc": (("nfc", "newton-nfc"),),
}
"""Where a problem of a node is solved, and by what, the first that it can be brought to: solvers that come with every
installation."""


@dataclass(frozen=True, eq=False)
class Answer:
    """An answer, how it was found, its measured error on the problem, and what the solver counted."""

    point: Any
    by: str
    error: float
    counters: Mapping[str, int]


def answer(problem: Problem, solver: str = "") -> Answer:
    """Solve a small problem at home, or by `solver` of its own node; raises CpbenchError when the solver gives up."""
    arrived, chosen = _bring(problem, ((problem.node, solver),) if solver else HOMES[problem.node])
    done = solve(arrived.problem, chosen, Budget(tolerance=TOLERANCE))
    if done.point is None or done.claim is not Claim.SOLVED:
        raise CpbenchError(f"{chosen} on {problem.name or problem.node}: {done.message or done.claim}")
    steps = arrived.route.steps
    point = lift(arrived.problem, done.point, len(steps)) if steps else done.point
    by = " → ".join([*(step.label for step in steps), chosen])
    return Answer(point, by, problem.residuals(point).error, done.counters)


def outcome(problem: Problem, solver: str) -> Vector | None:
    """All unknowns of the answer of a solver of the problem's own node; None where it gives up."""
    try:
        return np.concatenate(list(answer(problem, solver).point.arrays().values()))
    except CpbenchError:
        return None


def _bring(problem: Problem, homes: tuple[tuple[str, str], ...]) -> tuple[Arrival, str]:
    """The problem at the first home that a route leads to, and the solver there."""
    *others, (last, solver) = homes
    for home, usual in others:
        try:
            return arrive(problem, home), usual
        except NoRoute:
            continue
    return arrive(problem, last), solver


@dataclass(frozen=True, eq=False)
class RoundTrip:
    """What a conversion did to one problem.

    Attributes
    ----------
    target : the converted problem. kind : the promise for this very problem. by : what solved the target.
    target_error, source_error : of the solver's answer there, and of what it lifts to here.
    lifted : that answer. pushed_error : of a known answer to the source, pushed there; None where there is no push.
    """

    edge: str
    equation: str
    kind: Kind
    source: Problem
    target: Problem
    by: str
    target_error: float
    lifted: Point
    source_error: float
    pushed_error: float | None


def round_trip(problem: Problem, edge: str, **parameters: Any) -> RoundTrip:
    """Take `edge` there and back; the known answer for the way there is that of `answer`.

    Raises NotApplicable with the obstacle when the problem cannot take the edge.

    >>> from lecture.numerics.examples import problems
    >>> trip = round_trip(problems()["lcp"], "lcp-qp")
    >>> trip.kind, trip.source_error < 1e-9, trip.pushed_error < 1e-9
    (<Kind.EQUIVALENT: 'equivalent'>, True, True)
    """
    conversion = make(edge, parameters)
    target, trace = conversion.apply(problem)
    there = answer(target)
    lifted = conversion.lift(there.point, trace)
    try:
        pushed = target.residuals(conversion.push(answer(problem).point, trace)).error
    except NotApplicable:
        pushed = None
    return RoundTrip(
        conversion.label,
        conversion.equation,
        conversion.exactness(problem),
        problem,
        target,
        there.by,
        there.error,
        lifted,
        problem.residuals(lifted).error,
        pushed,
    )


def refusal(problem: Problem, edge: str) -> str:
    """The obstacle that stands in the way of `edge`, "" when there is none."""
    return make(edge).obstacle(problem) or ""
