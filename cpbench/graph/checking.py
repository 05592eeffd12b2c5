"""Checks of a conversion on one problem: an answer there, the lifted answer here, and what the lift does to errors.

An answer is the problem's known solution, carried forward, or what a solver finds on the converted problem, or on
what that converts to exactly. No claim is believed: every answer is measured at both ends.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cpbench import graph, verification
from cpbench.conversions import Conversion
from cpbench.errors import NoRoute, NotApplicable
from cpbench.formulations import Kind, Problem
from cpbench.solvers.base import Budget, Solver, solvers
from cpbench.verification import Verdict

MOVED = 1e-6
"""Size of the moves of a target answer, relative to its parts."""
MOVES = 8
"""Random directions in which it is moved."""
ROUNDING = float(np.finfo(float).eps)
SECONDS = 10.0
"""Time limit of a solve."""


@dataclass(frozen=True)
class Answer:
    """An answer to a problem: the point, where it is from, its error there."""

    point: Any
    how: str
    error: float


@dataclass(frozen=True)
class CheckReport:
    """Effect of a conversion on a problem and on one answer.

    Attributes
    ----------
    arrival : the converted problem, its route and what was promised.
    how : where the answer is from, '' when there is none; `tried` : why not from elsewhere.
    target, source : verdicts on the answer to the converted problem and on the lifted one.
    moved : largest error on the source over error on the target, over MOVES answers beside this one; None when the
        target has no unknowns. apply, lift : seconds. remarks : what the conversions say of this answer.
    """

    arrival: graph.Arrival
    how: str
    tried: tuple[str, ...]
    target: Verdict
    source: Verdict
    moved: float | None
    apply: float
    lift: float
    remarks: tuple[str, ...] = ()

    @property
    def amplification(self) -> float:
        """Error on the source over error on the target."""
        return ratio(self.source.error, self.target.error)

    @property
    def passed(self) -> bool:
        """An exact conversion must give an answer; any other one need not."""
        return self.source.within or (bool(self.how) and not self.arrival.kind.exact)


def check(
    problem: Problem,
    target: str,
    kinds: frozenset[Kind] = graph.EXACT,
    via: Sequence[Conversion] = (),
    known: Any | None = None,
    tolerance: float = 1e-6,
) -> CheckReport:
    """Bring `problem` to `target` and examine what arrived; raises NoRoute, and PointError on an unfit `known`."""
    memory = graph.Memory()
    arrival = graph.arrive(problem, target, kinds, via, memory)
    return examine(problem, arrival, memory.seconds(problem, arrival.route), known, tolerance)


def examine(
    problem: Problem, arrival: graph.Arrival, seconds: float, known: Any | None = None, tolerance: float = 1e-6
) -> CheckReport:
    """Get an answer to a problem that was converted in `seconds`, lift it and measure both ends.

    `known` is a candidate solution of the source; it is used when it verifies there and can be pushed. Otherwise the
    native solvers are asked for what the route needs.
    """
    converted, steps = arrival.problem, len(arrival.route.steps)
    tried: list[str] = []
    answer = None if known is None else pushed(problem, converted, steps, known, tolerance, tried)
    if answer is None:
        wanted = graph.tolerance(converted, tolerance, steps)
        answer = next(answers(converted, wanted, tried), None)
    nothing = verification.no_answer(tolerance)
    if answer is None:
        return CheckReport(arrival, "", tuple(tried), nothing, nothing, None, seconds, 0.0)
    begun = time.perf_counter()
    back = graph.lift(converted, answer.point, steps)
    lifted = time.perf_counter() - begun
    return CheckReport(
        arrival,
        answer.how,
        tuple(tried),
        verification.judge(converted, answer.point, tolerance),
        verification.judge(problem, back, tolerance),
        _largest_ratio(problem, converted, steps, answer.point),
        seconds,
        lifted,
        tuple(graph.remarks(converted, answer.point, steps)),
    )


def pushed(
    problem: Problem, converted: Problem, steps: int, known: Any, tolerance: float, tried: list[str]
) -> Answer | None:
    """Return the known solution carried forward over the last `steps` conversions; why not goes into `tried`."""
    error = verification.judge(problem, known, tolerance).error
    if error > tolerance:
        tried.append(f"the known solution has error {error:.1e}")
        return None
    try:
        point = graph.push(converted, known, steps)
    except NotApplicable as refusal:
        tried.append(str(refusal))
        return None
    return Answer(point, "known solution, pushed", converted.residuals(point).error)


def answers(problem: Problem, tolerance: float, tried: list[str]) -> Iterator[Answer]:
    """Yield answers of native solvers whose error on `problem` is at most `tolerance`, one solver at a time.

    Those of the problem's own node come before those behind further exact conversions. A solver that was tried in vain
    goes into `tried`, with the reason; none is asked for less than rounding.
    """
    if tolerance < ROUNDING:
        tried.append(f"an answer to {tolerance:.0e} is wanted, which rounding does not allow")
        return
    for arrival, solver in _solvers_ahead(problem, tried):
        steps = len(arrival.route.steps)
        label = f"{solver.spec.name} after {arrival.route.label}" if steps else solver.spec.name
        why = solver.obstacle(arrival.problem)
        if why is None:
            wanted = graph.tolerance(arrival.problem, tolerance, steps)
            try:
                out = solver.run(arrival.problem, Budget(tolerance=wanted, seconds=SECONDS))
            except Exception as failure:  # a plugin may raise anything
                tried.append(f"{label}: {type(failure).__name__}: {failure}")
                continue
            error = math.inf
            if out.point is not None:
                point = graph.lift(arrival.problem, out.point, steps)
                error = verification.judge(problem, point, tolerance).error
                if error <= tolerance:
                    yield Answer(point, f"solved by {label}", error)
                    continue
            why = f"ended {out.claim} with error {error:.1e}, asked for {tolerance:.1e}"
        tried.append(f"{label}: {why}")


def _solvers_ahead(problem: Problem, tried: list[str]) -> Iterator[tuple[graph.Arrival, Solver]]:
    """Yield native solvers that may serve, each with the problem brought to its node; nearest nodes first."""
    serving: dict[str, list[Solver]] = {}
    for solver in solvers:
        if solver.spec.kind.exact and not solver.spec.requires and solver.availability().ok:
            serving.setdefault(solver.spec.node, []).append(solver)
    ahead = [(routes[0].cost, node) for node in serving if (routes := graph.candidates(problem.node, node))]
    if not ahead:
        tried.append(f"no native solver is registered on {problem.node} or beyond")
    for _, node in sorted(ahead):
        try:
            arrival = graph.arrive(problem, node)
        except NoRoute as refusal:
            tried.append(str(refusal))
            continue
        for solver in serving[node]:
            yield arrival, solver


def _largest_ratio(problem: Problem, converted: Problem, steps: int, point: Any) -> float | None:
    """Return largest error on the source over error on the target, of answers beside `point`."""
    parts = point.arrays()
    if not any(part.size for part in parts.values()):
        return None
    rng = np.random.default_rng(0)
    largest = 0.0
    for _ in range(MOVES):
        moved = {name: part + _scale(part) * rng.standard_normal(part.size) for name, part in parts.items()}
        moved_point = type(point)(**moved)
        back = graph.lift(converted, moved_point, steps)
        largest = max(largest, ratio(problem.residuals(back).error, converted.residuals(moved_point).error))
    return largest


def _scale(part: Any) -> float:
    return MOVED * (float(np.abs(part).max(initial=0.0)) or 1.0)


def ratio(source: float, target: float) -> float:
    """Return source/target; 0 where there is no error here, ∞ where there is one here and none there."""
    return source / target if target > 0 else (0.0 if source == 0 else math.inf)
