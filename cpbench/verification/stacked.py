"""Verdicts on answers to many problems of one formulation and size, as arrays.

Problems side by side are one large problem, of which each is a group of rows with sizes of its own. So answers to
thousands of problems are measured in one go, by the code and the definition that measure one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cpbench.errors import PointError
from cpbench.formulations.stack import Stack
from cpbench.foundation.matrices import Vector, is_psd
from cpbench.verification.contacts import ContactAnswer, contact_error
from cpbench.verification.linear import linear_error
from cpbench.verification.rows import ROWS, STACKED, Groups, System
from cpbench.verification.sets import Flags

ENTRIES = 2**17
"""Numbers of the data that are judged in one go: what is made of them stays in the cache."""


@dataclass(frozen=True, eq=False)
class Verdicts:
    """Measurements of k answers at one tolerance, as `Verdict` has it of one.

    Attributes
    ----------
    solved : (k,) whether the error is at most the tolerance, and no matter of rounding. error : (k,) backward errors, ∞
    for what is no answer. unresolvable : (k,) whether rounding alone may cause the error. stationary : (k,) whether
    the problem is a program that is not convex.
    """

    tolerance: float
    solved: Flags
    error: Vector
    unresolvable: Flags
    stationary: Flags


def judge_stack(stack: Stack, answers: Mapping[str, Any], tolerance: float) -> Verdicts:
    """Measure answers to all problems of a stack.

    Parameters
    ----------
    answers : (k, size) of every part of a point, by name.

    Raises PointError where an answer has other shapes, ValueError for a formulation that is not in `STACKED`.
    """
    if stack.kind.node not in STACKED:
        raise ValueError(f"{stack.kind.node}: answers are judged as arrays for {', '.join(sorted(STACKED))}")
    parts = {name: np.asarray(answers[name], dtype=float) for name in (f.name for f in fields(stack.kind.point_type))}
    for name, size in stack.point_sizes.items():
        if parts[name].shape != (stack.count, size):
            raise PointError(f"{name} has shape {parts[name].shape}, expected {(stack.count, size)}")
    error, unresolvable = np.zeros(stack.count), np.zeros(stack.count, dtype=bool)
    for some in stack.pieces(ENTRIES):
        here = {name: x[some] for name, x in parts.items()}
        error[some], unresolvable[some] = _measured(stack, some, here, tolerance)
    return Verdicts(tolerance, (error <= tolerance) & ~unresolvable, error, unresolvable, ~_convex(stack))


def _convex(stack: Stack) -> Flags:
    """Return whether the objectives are convex, as `matrices.is_psd` has it; true for what has none."""
    result = np.ones(stack.count, dtype=bool)
    if "Q" not in stack.arrays:
        return result
    Q = stack.arrays["Q"]
    diagonal = np.einsum("kii->ki", Q)
    with np.errstate(all="ignore"):
        size = np.sqrt(diagonal)
        unit = Q / (size[:, :, None] * size[:, None, :])
    try:  # all at once, where all are definite
        if (diagonal > 0).all() and np.isfinite(np.linalg.cholesky(unit)).all():
            return result
    except np.linalg.LinAlgError:
        pass
    result[:] = [is_psd(matrix) for matrix in Q]
    return result


def _measured(stack: Stack, some: slice, answers: dict[str, Any], tolerance: float) -> tuple[Vector, Flags]:
    """Errors of the answers to some problems, and whether rounding decides of them."""
    count = some.stop - some.start
    finite = np.ones(count, dtype=bool)
    for x in answers.values():
        finite &= np.isfinite(x).all(axis=1)
    problem: Any = stack.direct_sum(some)
    point = problem.point_type(**{name: np.where(finite[:, None], x, 0.0).ravel() for name, x in answers.items()})
    with np.errstate(all="ignore"):
        answer = ROWS[problem.node](problem, point)
        if isinstance(answer, ContactAnswer):
            groups = Groups(np.repeat(np.arange(count), problem.nc // count), count, problem.nc)
            errors = contact_error(answer, groups)
            error, floor = groups.largest(errors.errors), groups.largest(errors.floors)
        else:
            if not answer.frame.k:
                return np.where(finite, 0.0, np.inf), np.zeros(count, dtype=bool)
            errors = linear_error(answer, Groups(_owners(answer, answers), count, answer.frame.k))
            error, floor = errors.errors, errors.floors
    hidden = errors.hidden(error, floor, tolerance) | errors.ill_posed
    return np.where(finite & np.isfinite(error), error, np.inf), finite & hidden


def _owners(system: System, answers: dict[str, Any]) -> NDArray[np.int64]:
    """Return which of the problems side by side has which unknown, (k,): the parts of answers come one after the
    other."""
    numbers = [np.repeat(np.arange(len(x)), x.shape[1]) for x in answers.values()]
    return np.concatenate(numbers)[: system.x.size]  # what follows the unknowns are multipliers of bounds
