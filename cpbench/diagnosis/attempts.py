"""One solve as a diagnosis needs it: with its last iterates, and measured on the problem that was asked."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cpbench import brackets, graph, verification
from cpbench.bench.judging import judge_answer, look_for_proof
from cpbench.bench.planning import plan
from cpbench.errors import NoRoute, NotApplicable, Unavailable
from cpbench.formulations.base import Kind, Problem
from cpbench.matrices import Vector
from cpbench.solvers import warming
from cpbench.solvers.base import Budget, Solver, Trait, parse_options, solvers
from cpbench.verification import MET_TOLERANCE, PROVEN, Status

KEPT = 400
"""Iterates that are kept: half of them the first ones, half the last."""
BYTES = 32e6
"""Bytes of iterates that are kept."""
PROOF_SECONDS = 2.0
"""Time within which a claim that there is no solution is proved [s]."""


@dataclass(frozen=True, kw_only=True)
class Trial:
    """What is tried.

    Attributes
    ----------
    solver : a name, with options where wanted. via : conversions to take, () for the cheapest exact ones.
    start : where the solver begins, a point of `problem`; None where it begins by itself.
    """

    problem: Problem
    solver: str
    tolerance: float = 1e-6
    seconds: float = 10.0
    via: tuple[str, ...] = ()
    start: Any = None


@dataclass(frozen=True, eq=False, kw_only=True)
class Attempt:
    """What became of a trial.

    Attributes
    ----------
    status : as in a run. answer : the answer to the problem that was asked, None without one.
    error, floor : measured on it, and what rounding alone may cause. target_error : on the solver's own problem.
    route, kind : the conversions, and what they promise. seconds : of set-up and solve.
    residuals : the solver's own. iterates : the first and the last ones, (k, n), of its own problem, and the
    iterations that they are of.
    """

    trial: Trial
    status: str
    claim: str = ""
    message: str = ""
    answer: Any = None
    error: float = math.inf
    floor: float = 0.0
    target_error: float = math.nan
    route: str = ""
    kind: Kind = Kind.EQUIVALENT
    seconds: float = 0.0
    counters: Mapping[str, int] = field(default_factory=dict)
    residuals: Vector = field(default_factory=lambda: np.zeros(0))
    iterates: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)))
    iterations: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    def __bool__(self) -> bool:
        """Whether the answer meets the tolerance, or the lack of one is proved."""
        return self.status in (*MET_TOLERANCE, *PROVEN)


class _Recorder:
    """Keeps the first and the last iterates of a solve, and all of the solver's residuals."""

    def __init__(self, size: int) -> None:
        self._room = max(2, min(KEPT, int(BYTES / (8 * size + 1)))) // 2
        self._first: list[tuple[int, Vector]] = []
        self._last: deque[tuple[int, Vector]] = deque(maxlen=self._room)
        self._residuals: list[float] = []

    def __call__(self, iteration: int, residual: float, point: Callable[[], Any]) -> None:
        self._residuals.append(residual)
        kept = self._first if len(self._first) < self._room else self._last
        kept.append((iteration, np.concatenate([np.zeros(0), *point().arrays().values()])))

    def trail(self) -> dict[str, Any]:
        """Return what was kept, as an attempt has it."""
        kept = [*self._first, *self._last]
        return {
            "residuals": np.array(self._residuals),
            "iterations": np.array([k for k, _ in kept], dtype=np.int64),
            "iterates": np.array([x for _, x in kept]) if kept else np.zeros((0, 0)),
        }


def attempt(trial: Trial) -> Attempt:
    """Solve in this process, whatever comes of it; raises UnknownName."""
    solver, options = _named(trial.solver)
    state = solver.availability()
    if not state.ok:
        return Attempt(trial=trial, status=Status.UNAVAILABLE, message=state.detail)
    try:
        arrival = brought(trial)
    except (NoRoute, NotApplicable) as refusal:
        return Attempt(trial=trial, status=Status.UNSUPPORTED, message=str(refusal))
    converted, steps = arrival.problem, len(arrival.route.steps)
    found: dict[str, Any] = {"trial": trial, "route": arrival.route.label, "kind": arrival.kind}
    why = solver.obstacle(converted)
    if why is not None:
        return Attempt(status=Status.UNSUPPORTED, message=f"{trial.solver}: {why}", **found)
    recorder = _Recorder(sum(converted.point_sizes.values()))
    budget = Budget(tolerance=graph.tolerance(converted, trial.tolerance, steps), seconds=trial.seconds)
    begun = time.perf_counter()
    try:
        warming.warm_up_quickly(solver)
        start = None if trial.start is None else graph.push(converted, trial.start, steps)
        begun = time.perf_counter()
        record = recorder if Trait.HISTORY in solver.spec.traits else None
        output = solver.run(converted, budget, options, start, record)
    except (NotApplicable, Unavailable) as refusal:
        return Attempt(status=Status.UNSUPPORTED, message=str(refusal), **found)
    except Exception as error:
        status = Status.MEMOUT if isinstance(error, MemoryError) else Status.ERROR
        return Attempt(status=status, message=f"{type(error).__name__}: {error}", **found, **recorder.trail())
    spent = time.perf_counter() - begun
    judged = judge_answer(
        trial.problem,
        converted,
        steps,
        None if output.point is None else output.point.arrays(),
        tolerance=trial.tolerance,
        claim=output.claim,
        kind=max(arrival.kind, solver.spec.kind, key=lambda kind: kind.rank),
        promise=solver.spec.kind,
        prove=lambda: look_for_proof(
            lambda kind, certificate, seconds: verification.prove(trial.problem, kind, certificate, seconds),
            not steps,
            output.claim,
            output.certificate,
            PROOF_SECONDS,
        ),
    )
    late = spent > trial.seconds and judged.status not in MET_TOLERANCE
    return Attempt(
        **(found | {"kind": max(arrival.kind, solver.spec.kind, key=lambda kind: kind.rank)}),
        status=Status.TIMEOUT if late else judged.status,
        claim=str(output.claim),
        message="; ".join(filter(None, [judged.message, output.message])),
        answer=judged.point,
        error=judged.verdict.error,
        floor=floor_of(trial.problem, judged.point),
        target_error=math.nan if judged.target is None else judged.target.error,
        seconds=spent,
        counters=dict(output.counters),
        **recorder.trail(),
    )


def brought(trial: Trial) -> graph.Arrival:
    """Bring the problem to the solver's formulation; raises NoRoute, NotApplicable."""
    target = _named(trial.solver)[0].spec.node
    kinds, pinned = plan.parse_request(plan.pinned(list(trial.via), {})) if trial.via else (graph.EXACT, ())
    return graph.arrive(trial.problem, target, kinds, pinned)


def floor_of(problem: Problem, point: Any) -> float:
    """Return the error that rounding alone may cause at a point; 0 without one."""
    from cpbench.verification.measures import measure

    return 0.0 if point is None or not point.finite else measure(problem, point).floor


def _named(text: str) -> tuple[Solver, Any]:
    name, given = brackets.read("solver", text)
    solver = solvers.get(name)
    return solver, parse_options(solver.spec, given)
