"""One solve as a diagnosis needs it: with its iterates, and measured on the problem that was asked."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from cpbench import graph, proofs
from cpbench.bench.judging import judge_answer, look_for_proof
from cpbench.bench.planning import plan
from cpbench.errors import NoRoute, NotApplicable, Unavailable, described
from cpbench.formulations.base import Kind, Problem
from cpbench.foundation.matrices import Vector
from cpbench.foundation.text import read_brackets
from cpbench.solvers.base import Budget, Solver, Trait, parse_options, solvers, warm_up
from cpbench.verification import MET_TOLERANCE, Status
from cpbench.verification.verdict import error_of

KEPT = 400
"""Iterates that are kept: half of them the first ones, half the last."""
BYTES = 32e6
"""Bytes of iterates that are kept."""
PROOF_SECONDS = 2.0
"""Time within which a claim that there is no solution is proved [s]."""


@dataclass(frozen=True, kw_only=True)
class SolverTrial:
    """A question to a solver: a problem, limits, a start.

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

    @property
    def named(self) -> tuple[Solver, Any]:
        """The solver and its options; raises UnknownName."""
        return named(self.solver)

    def arrive(self) -> graph.Arrival:
        """Bring the problem to the solver's formulation; raises NoRoute, NotApplicable."""
        kinds, pinned = plan.parse_request(plan.pinned(self.via)) if self.via else (graph.EXACT, ())
        return graph.arrive(self.problem, self.named[0].spec.node, kinds, pinned)


@dataclass(frozen=True, eq=False, kw_only=True)
class Raw:
    """Output of a solver with its iterates, nothing of it believed.

    Attributes
    ----------
    status : how it ended, where it has no claim. answer : to its own problem, parts one after the other; None without.
    residuals : its own. iterates : the first and the last ones, (k, n), and the `iterations` that they are of.
    """

    status: str = ""
    claim: str = ""
    message: str = ""
    answer: Vector | None = None
    certificate: Vector | None = None
    counters: Mapping[str, int] = field(default_factory=dict)
    seconds: float = 0.0
    residuals: Vector = field(default_factory=lambda: np.zeros(0))
    iterations: Vector = field(default_factory=lambda: np.zeros(0))
    iterates: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)))


@dataclass(frozen=True, eq=False, kw_only=True)
class TrialOutcome:
    """Outcome of a trial, measured on the problem that was asked.

    Attributes
    ----------
    status : as in a run. answer : the answer to the problem that was asked, None without one.
    error, floor : measured on it, and what rounding alone may cause. target_error : on the solver's own problem.
    route, kind : the conversions, and what they promise with the solver. raw : what the solver said.
    """

    trial: SolverTrial
    status: str
    message: str = ""
    answer: Any = None
    error: float = math.inf
    floor: float = 0.0
    target_error: float = math.nan
    route: str = ""
    kind: Kind = Kind.EQUIVALENT
    raw: Raw = field(default_factory=Raw)

    @property
    def solved(self) -> bool:
        """Whether the answer meets the tolerance."""
        return self.status in MET_TOLERANCE


Run: TypeAlias = Callable[[str, Problem, Budget, Any], Raw]
"""Runs a solver (by its text) on a problem of its own formulation, from a start or from none."""


class _Recorder:
    """Recorder of the first and the last iterates of a solve, and all of the solver's residuals."""

    def __init__(self, size: int) -> None:
        self._room = max(2, min(KEPT, int(BYTES / (8 * size + 1)))) // 2
        self._first: list[tuple[int, Vector]] = []
        self._last: deque[tuple[int, Vector]] = deque(maxlen=self._room)
        self._residuals: list[float] = []

    def __call__(self, iteration: int, residual: float, point: Callable[[], Any]) -> None:
        self._residuals.append(residual)
        kept = self._first if len(self._first) < self._room else self._last
        kept.append((iteration, point().vector))

    def trail(self) -> dict[str, Any]:
        """Return what was kept, as `Raw` has it."""
        kept = [*self._first, *self._last]
        return {
            "residuals": np.array(self._residuals),
            "iterations": np.array([float(k) for k, _ in kept]),
            "iterates": np.array([x for _, x in kept]) if kept else np.zeros((0, 0)),
        }


def attempt(trial: SolverTrial, run: Run | None = None) -> TrialOutcome:
    """Solve, whatever comes of it, and measure the answer here; raises UnknownName.

    `run` solves a problem of the solver's own formulation; None: in this process.
    """
    solver = trial.named[0]
    state = solver.availability()
    if not state.ok:
        return TrialOutcome(trial=trial, status=Status.UNAVAILABLE, message=state.detail)
    try:
        arrival = trial.arrive()
    except (NoRoute, NotApplicable) as refusal:
        return TrialOutcome(trial=trial, status=Status.UNSUPPORTED, message=str(refusal))
    converted, steps = arrival.problem, len(arrival.route.steps)
    why = solver.obstacle(converted)
    if why is not None:
        message = f"{trial.solver}: {why}"
        return TrialOutcome(trial=trial, status=Status.UNSUPPORTED, message=message, route=arrival.route.label)
    budget = Budget(tolerance=graph.tolerance(converted, trial.tolerance, steps), seconds=trial.seconds)
    try:
        start = None if trial.start is None else graph.push(converted, trial.start, steps)
    except NotApplicable as refusal:
        return TrialOutcome(trial=trial, status=Status.UNSUPPORTED, message=str(refusal), route=arrival.route.label)
    raw = (run or solve_here)(trial.solver, converted, budget, start)
    kind = max(arrival.kind, solver.spec.kind, key=lambda kind: kind.rank)
    if raw.status:
        found: dict[str, Any] = {"route": arrival.route.label, "kind": kind, "raw": raw}
        return TrialOutcome(trial=trial, status=raw.status, message=raw.message, **found)
    judged = judge_answer(
        trial.problem,
        converted,
        steps,
        None if raw.answer is None else converted.point_from_vector(raw.answer).arrays(),
        tolerance=trial.tolerance,
        claim=raw.claim,
        kind=kind,
        promise=solver.spec.kind,
        prove=lambda claim: look_for_proof(
            partial(proofs.prove, trial.problem, tolerance=trial.tolerance),
            not steps,
            claim,
            raw.certificate,
            PROOF_SECONDS,
        ),
    )
    late = raw.seconds > trial.seconds and judged.status not in MET_TOLERANCE
    return TrialOutcome(
        trial=trial,
        status=Status.TIMEOUT if late else judged.status,
        message="; ".join(filter(None, [judged.message, raw.message])),
        answer=judged.point,
        error=judged.verdict.error,
        floor=floor_of(trial.problem, judged.point),
        target_error=math.nan if judged.target is None else judged.target.error,
        route=arrival.route.label,
        kind=kind,
        raw=raw,
    )


def solve_here(text: str, problem: Problem, budget: Budget, start: Any = None) -> Raw:
    """Run a solver on a problem of its own formulation in this process, and keep what it records."""
    solver, options = named(text)
    recorder = _Recorder(sum(problem.point_sizes.values()))
    try:
        warm_up(solver)
        begun = time.perf_counter()
        record = recorder if Trait.HISTORY in solver.spec.traits else None
        output = solver.run(problem, budget, options, start, record)
        spent = time.perf_counter() - begun
    except (NotApplicable, Unavailable) as refusal:
        return Raw(status=Status.UNSUPPORTED, message=str(refusal))
    except Exception as error:
        status = Status.MEMOUT if isinstance(error, MemoryError) else Status.ERROR
        return Raw(status=status, message=described(error), **recorder.trail())
    return Raw(
        claim=str(output.claim),
        message=output.message,
        answer=None if output.point is None else output.point.vector,
        certificate=output.certificate,
        counters=dict(output.counters),
        seconds=spent,
        **recorder.trail(),
    )


def named(text: str) -> tuple[Solver, Any]:
    """Return a solver and its options; raises UnknownName."""
    name, given = read_brackets("solver", text)
    solver = solvers.get(name)
    return solver, parse_options(solver.spec, given)


def floor_of(problem: Problem, point: Any) -> float:
    """Return the error that rounding alone may cause at a point; 0 without one."""
    return 0.0 if point is None or not point.finite else error_of(problem, point).floor


# --------------------------------------------------------------------------------------------------- the time of it all

T = TypeVar("T")


class OutOfTime(Exception):
    """The time of the diagnosis is over."""


@dataclass(frozen=True)
class Deadline:
    """End of a diagnosis, on the clock of `time.monotonic` [s]; by default there is none."""

    at: float = math.inf

    @classmethod
    def after(cls, seconds: float) -> Deadline:
        """Return the one in so many seconds."""
        return cls(time.monotonic() + seconds)

    @property
    def left(self) -> float:
        """Seconds until then, 0 when it has passed."""
        return max(0.0, self.at - time.monotonic())

    def run(self, function: Callable[[], T]) -> T:
        """Return what the function returns; raises OutOfTime when it is not done by then, and what it raises.

        With a limit it runs in a thread, because a factorization cannot be interrupted; what is late ends with the
        process, unheeded.
        """
        if math.isinf(self.at):
            return function()
        kept: dict[str, Any] = {}

        def keep() -> None:
            try:
                kept["value"] = function()
            except BaseException as error:
                kept["error"] = error

        thread = threading.Thread(target=keep, daemon=True)
        thread.start()
        thread.join(self.left)
        if thread.is_alive():
            raise OutOfTime
        if "error" in kept:
            raise kept["error"]
        return kept["value"]
