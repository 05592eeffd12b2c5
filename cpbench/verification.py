"""From an answer to a verdict and a status; knows no solver.

The verdict is measured on the problem that was asked. The claim is what the solver said. The status of a row
is made of both, here and nowhere else.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from cpbench.formulations.base import Problem, Residuals
from cpbench.matrices import Vector

DIRECTION_DEGREES = 5.0
"""An accepted contact answer whose slip angle is above this carries the flag `direction`."""
INACCURATE_FACTOR = 100.0
"""A claimed answer within this factor of the tolerance is `inaccurate`, beyond it `wrong`."""


class Status(StrEnum):
    """Outcome of a planned pair. Every planned pair has one."""

    SOLVED = "solved"
    STATIONARY = "stationary"
    """Optimality conditions hold, but the problem is not convex."""
    INACCURATE = "inaccurate"
    """Not solved: claimed and close, or right in one measure only (flag `scale`)."""
    WRONG = "wrong"
    """Claimed, and is not."""
    INFEASIBLE = "infeasible"
    """No solution exists: the solver's certificate was checked."""
    FAILED = "failed"
    """The solver gave up and said so."""
    MAX_ITER = "max_iter"
    TIMEOUT = "timeout"
    MEMOUT = "memout"
    CRASH = "crash"
    ERROR = "error"
    UNSUPPORTED = "unsupported"
    UNAVAILABLE = "unavailable"
    NOT_RUN = "not_run"


VERIFIED = (str(Status.SOLVED), str(Status.STATIONARY))
"""Statuses of an answer that meets the tolerance on the problem that was asked."""


@dataclass(frozen=True)
class Verdict:
    """What was measured of one answer at one tolerance.

    Attributes
    ----------
    solved : every judged number is at most the tolerance. error : the largest of them (NaN counts as ∞).
    flags : `direction` (accepted, but some contact slips or rolls more than 5° off), `scale` (the natural residual
    passes and the energy norm does not), `stationary`, `absolute`, ...
    """

    tolerance: float
    solved: bool
    error: float
    judged: Mapping[str, float] = field(default_factory=dict)
    parts: Mapping[str, float] = field(default_factory=dict)
    flags: tuple[str, ...] = ()


def judge(problem: Problem, point: Any, tolerance: float, measure: str | None = None) -> Verdict:
    """Measure `point` on `problem`; raises PointError when it is not an answer to it.

    With `measure`, that one number (judged or part: `natural`, `siconos_mlcp`, `fclib2018`) decides alone.
    """
    problem.check_point(point)
    if not point.finite:
        return Verdict(tolerance, False, math.inf, flags=("not finite",))
    residuals = problem.residuals(point, tolerance)
    error = residuals.error if measure is None else measured(residuals, measure)
    solved = error <= tolerance
    flags = list(residuals.flags)
    natural, energy = residuals.judged.get("natural", 0.0), residuals.judged.get("energy", 0.0)
    if natural <= tolerance < energy:
        flags.append("scale")
    if solved and any(residuals.parts.get(f"{k}_angle [deg]", 0.0) > DIRECTION_DEGREES for k in ("slip", "rolling")):
        flags.append("direction")
    return Verdict(tolerance, solved, error, residuals.judged, residuals.parts, tuple(flags))


def measured(residuals: Residuals, name: str) -> float:
    """One named number of the residuals; raises UnknownName."""
    from cpbench.errors import UnknownName

    both = {k.split(" [")[0]: v for k, v in {**residuals.parts, **residuals.judged}.items()}
    if name not in both:
        raise UnknownName("measure", name, both)
    return both[name]


def no_answer(tolerance: float) -> Verdict:
    """The verdict on nothing."""
    return Verdict(tolerance, False, math.inf, flags=("no answer",))


def status(verdict: Verdict, claim: str, *, proven_infeasible: bool = False) -> Status:
    """Status of a finished solve from what was measured and what was claimed (a `solvers.Claim` value)."""
    if verdict.solved:
        return Status.STATIONARY if "stationary" in verdict.flags else Status.SOLVED
    if proven_infeasible:
        return Status.INFEASIBLE
    if "scale" in verdict.flags:
        return Status.INACCURATE
    if claim == "solved":
        close = verdict.error <= INACCURATE_FACTOR * verdict.tolerance
        return Status.INACCURATE if close else Status.WRONG
    if claim == "inaccurate":
        return Status.INACCURATE
    return Status.MAX_ITER if claim == "max_iter" else Status.FAILED


def certified_infeasible(problem: Problem, certificate: Vector | None) -> bool:
    """Whether a solver's certificate proves that the problem has no solution."""
    return certificate is not None and problem.certifies_infeasibility(certificate)
