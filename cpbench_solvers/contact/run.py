"""Base of iterative methods on contact problems: the loop that watches the judged error, records and ends.

A method says how one iterate follows from another; the loop keeps the best, which is the answer.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.contact import FCPoint
from cpbench.foundation.matrices import Vector
from cpbench.solvers.base import Budget, Claim, Record, SolverOutput
from cpbench.solvers.shared.progress import SHARE, Progress
from cpbench_solvers.contact.by_parts import SolverByParts
from cpbench_solvers.contact.sweeps import ScaledContacts, conclude
from cpbench_solvers.lcp.claims import concluded


class ContactMethod(ABC):
    """The iterates of one run. counters : what it counts beside iterations. `pieces` : whether an iteration costs as
    little as a measurement, so that several are made between two of them."""

    pieces: ClassVar[bool] = False
    counters: dict[str, int]

    @property
    @abstractmethod
    def r(self) -> Vector:
        """The reactions of the present iterate."""

    @abstractmethod
    def step(self, many: int, error: float, seconds: float) -> str | None:
        """Make `many` iterations from an iterate of that judged error; return the obstacle, else None.

        seconds : the time that is left; only long iterations look at it.
        """


@dataclass(frozen=True)
class ContactResult:
    """The best reactions, their error, and what to say where that is not small enough."""

    r: Vector
    error: float
    claim: Claim
    message: str
    counters: dict[str, int]


def iterate(
    method: ContactMethod,
    judged: Callable[[Vector], float],
    answer: Callable[[Vector], Any],
    budget: Budget,
    limit: int,
    window: int,
    record: Record | None,
) -> ContactResult:
    """Take steps until the judged error is at most the tolerance, the limits are reached, or nothing gains.

    Parameters
    ----------
    judged, answer : error of reactions, and the point that they make. window : iterations without gain that end it.
    """
    deadline, progress = time.monotonic() + budget.seconds, Progress(window)
    best, done = method.r, 0
    error = least = judged(best)
    claim, message = Claim.MAX_ITER, f"{limit} iterations"
    if record is not None:
        record(0, least, lambda: answer(best))
    while not least <= budget.tolerance and done < limit:
        left = deadline - time.monotonic()
        many = min(1 + done // SHARE, limit - done) if method.pieces else 1
        with np.errstate(all="ignore"):  # diverging iterates overflow, and are seen by their error
            why = f"out of time after {done} iterations" if left <= 0 else method.step(many, error, left)
        if why is not None:
            claim, message = Claim.FAILED, why
            break
        done += many
        r = method.r
        error = judged(r)
        if error < least:
            best, least = r, error
            if record is not None:
                record(done, error, lambda now=r: answer(now))
        why = None if least <= budget.tolerance else progress.trouble(done, error)
        if why is not None:
            claim, message = Claim.FAILED, why
            break
    return ContactResult(best, least, claim, message, {"iterations": done, **method.counters})


def finish(end: ContactResult, answer: Callable[[Vector], Any], budget: Budget) -> SolverOutput:
    """Claim solved exactly when the judged error is at most the tolerance."""
    if not np.isfinite(end.r).all():
        return SolverOutput(claim=Claim.FAILED, counters=end.counters, message=end.message)
    message = f"{end.message}, error {end.error:.1e}"
    return concluded(answer(end.r), end.error, budget, end.counters, end.claim, message)


@dataclass(frozen=True)
class MethodOptions:
    """Options of nsgs-gfc. `max_iterations`. `stall_window` : iterations without gain after which it gives up."""

    max_iterations: int = 100_000
    stall_window: int = 2_000


def iterate_on(
    measured: Callable[[Any], float],
    answer: Callable[[Vector], Any],
    method: ContactMethod,
    budget: Budget,
    options: MethodOptions,
    record: Record | None,
) -> SolverOutput:
    """Run `iterate` and `finish`, judged by what is measured of the point that `answer` makes of reactions."""

    def judged(r: Vector) -> float:
        return measured(answer(r)) if np.isfinite(r).all() else float("nan")

    limit = budget.iterations or options.max_iterations
    return finish(iterate(method, judged, answer, budget, limit, options.stall_window, record), answer, budget)


class ContactSolver(SolverByParts):
    """A method on the local problem. `method` makes one from the scaled data, options and reactions to start from."""

    method: ClassVar[Callable[[ScaledContacts, Any, Vector, Budget], ContactMethod]]

    def solve_part(
        self, prepared: ScaledContacts, budget: Budget, options: Any, start: Any, record: Record | None
    ) -> SolverOutput:
        problem = prepared.rows.problem
        r = np.zeros(problem.q.size) if start is None else np.array(start.r)
        method = type(self).method(prepared, options, r, budget)
        limit = budget.iterations or options.max_iterations
        end = iterate(method, prepared.rows.judged_error, FCPoint, budget, limit, options.stall_window, record)
        return conclude(problem, end.r, end.error, budget, end.claim, end.message, end.counters)
