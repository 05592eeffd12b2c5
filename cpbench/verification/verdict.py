"""Verdict on an answer: what was measured of it on the problem that was asked."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

# these enter their rows
import cpbench.verification.conic_systems  # pyright: ignore[reportUnusedImport]
import cpbench.verification.contact_systems  # pyright: ignore[reportUnusedImport]
import cpbench.verification.systems  # noqa: F401  # pyright: ignore[reportUnusedImport]
from cpbench.errors import UnknownName
from cpbench.formulations.base import Problem
from cpbench.foundation import extensions
from cpbench.verification.contacts import ContactAnswer, contact_error
from cpbench.verification.linear import linear_error
from cpbench.verification.nonlinear import row_errors
from cpbench.verification.published import named
from cpbench.verification.rows import ROWS, AnswerError

DIRECTION_DEGREES = 5.0
"""An accepted contact answer whose slip angle is above this carries the flag `direction`."""


@dataclass(frozen=True)
class Verdict:
    """A measurement of one answer at one tolerance.

    Attributes
    ----------
    within : `error` is at most the tolerance, and rounding does not decide that. error : the backward error, or the
    measure that was named (NaN counts as ∞). judged : the number that decides. parts : further measures, those of the
    literature among them.
    flags : `stationary` (conditions of optimality were measured, which do not show that the answer is a minimum),
    `convexity declared` (they do if the problem is convex, as its author says), `direction` (accepted, but some contact
    slips or rolls more than 5° off), `absolute` (the data give no size), `unresolvable` (rounding decides, or
    `ill-posed`: the answer has no digit of the difference of two rows that are nearly the same),
    `multipliers completed` (they are not the author's, but computed here).
    """

    tolerance: float
    within: bool
    error: float
    judged: Mapping[str, float] = field(default_factory=dict)
    parts: Mapping[str, float] = field(default_factory=dict)
    flags: tuple[str, ...] = ()

    @property
    def solved(self) -> bool:
        """Whether the answer is a solution at the tolerance; a stationary point of a problem that is not convex is not
        known to be one."""
        return self.within and "stationary" not in self.flags

    def __bool__(self) -> bool:
        return self.solved


@np.errstate(all="ignore")
def error_of(problem: Any, point: Any) -> AnswerError:
    """Return the error of an answer that the problem has accepted."""
    if problem.node not in ROWS:  # a formulation of a plugin is measured by its own residuals
        return AnswerError(np.array([problem.residuals(point).error]), np.zeros(1))
    answer = ROWS[problem.node](problem, point)
    if isinstance(answer, ContactAnswer):
        return contact_error(answer)
    return linear_error(answer) if answer.frame.linear else row_errors(answer)


def error_text(error: float) -> str:
    """Return a backward error as a share of the problem's own terms; one above 1 is no share, its size says nothing."""
    return f"{error:.3g}" if error <= 1.0 or not math.isfinite(error) else "above 1"


@np.errstate(all="ignore")
def judge(problem: Problem, point: Any, tolerance: float, measure: str | None = None) -> Verdict:
    """Measure `point` on `problem`; raises PointError when it is not an answer to it.

    The backward error decides (`error_of`). With `measure`, a published number does: one of the
    verdict's parts (`natural`, `siconos_mlcp`, `fclib2018`, ...), or of those that the hook `all_measures` gives
    (`path_fischer`, `osqp_primal`, ...).
    """
    problem.check_point(point)
    if not point.finite:
        return Verdict(tolerance, False, math.inf, flags=("not finite",))
    residuals = problem.residuals(point, tolerance)
    parts = {**residuals.parts, **residuals.measured}
    flags = [flag for flag in residuals.flags if flag != "absolute"]
    answer = error_of(problem, point)
    if measure is not None:
        if measure not in named(parts) and measure != "backward":
            parts |= {row.name: row.value for row in extensions.hook("all_measures")(problem, point, tolerance)}
        error = measured(parts, measure, answer.error)
        parts["backward"] = answer.error
    else:
        error = answer.error
        if answer.absolute:
            flags.append("absolute")
        ill_posed = bool(answer.ill_posed.any())
        if ill_posed or answer.hidden(error, answer.floor, tolerance):
            flags += ["unresolvable", "ill-posed"] if ill_posed else ["unresolvable"]
    within = error <= tolerance and "unresolvable" not in flags
    if within and any(parts.get(f"{k}_angle [deg]", 0.0) > DIRECTION_DEGREES for k in ("slip", "rolling")):
        flags.append("direction")
    return Verdict(tolerance, within, error, {measure or "backward": error}, parts, tuple(flags))


def measured(parts: Mapping[str, float], name: str, backward: float) -> float:
    """Return one named number of an answer; raises UnknownName."""
    both = named(parts) | {"backward": backward}
    if name not in both:
        raise UnknownName("measure", name, both)
    return both[name]


def no_answer(tolerance: float) -> Verdict:
    """Return the verdict on nothing."""
    return Verdict(tolerance, False, math.inf, flags=("no answer",))
