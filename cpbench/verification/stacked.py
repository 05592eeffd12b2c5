"""Verdicts on answers to many problems of one formulation and size, as arrays.

Problems side by side are one large problem, of which each is a group of rows with sizes of its own. So answers to
thousands of problems are measured in one go, by the code and the definition that measure one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cpbench.errors import CpbenchError, PointError
from cpbench.formulations.base import Point, Problem
from cpbench.formulations.stack import Stack
from cpbench.foundation.matrices import Vector, is_psd
from cpbench.verification.contacts import ContactAnswer, contact_error
from cpbench.verification.linear import linear_error
from cpbench.verification.rows import ROWS, STACKED, Groups, System
from cpbench.verification.sets import Flags

Numbers: TypeAlias = NDArray[np.int64]
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


def judge_beside(problems: Sequence[Problem], points: Sequence[Point], tolerance: float) -> Verdicts:
    """Measure one answer to each of several problems of one formulation, whatever their sizes.

    Errors are those of `verdict.judge` to the accuracy of the equilibration (1e-3 of themselves, mostly).

    Raises PointError where an answer does not fit its problem, CpbenchError where the formulations differ.
    """
    kind, count = type(problems[0]), len(problems)
    for problem, point in zip(problems, points, strict=True):
        problem.check_point(point)
        if type(problem) is not kind:
            raise CpbenchError(f"{problem.node} beside {kind.node}: problems side by side have one formulation")
    rows = [problem.data() for problem in problems]
    dimension = getattr(problems[0], "dimension", None)
    others: dict[str, Any] = {} if dimension is None else {"dimension": dimension}
    whole = kind(**{name: _joined([row[name] for row in rows]) for name in rows[0]}, **others)
    finite = np.array([point.finite for point in points])
    answers, owners = {}, {}
    for name in whole.point_sizes:
        parts = [getattr(point, name) for point in points]
        owners[name] = np.repeat(np.arange(count), [part.size for part in parts])
        answers[name] = np.where(finite[owners[name]], np.concatenate(parts), 0.0)
    error, unresolvable = _errors(whole, answers, owners, finite, tolerance)
    return Verdicts(tolerance, (error <= tolerance) & ~unresolvable, error, unresolvable, np.zeros(count, dtype=bool))


def _joined(parts: Sequence[Any]) -> Any:
    if parts[0].ndim == 1:
        return np.concatenate(parts)
    return sp.block_diag([sp.csr_array(part) for part in parts], format="csr")


def _measured(stack: Stack, some: slice, answers: dict[str, Any], tolerance: float) -> tuple[Vector, Flags]:
    """Errors of the answers to some problems, and whether rounding decides of them."""
    count = some.stop - some.start
    finite = np.ones(count, dtype=bool)
    for x in answers.values():
        finite &= np.isfinite(x).all(axis=1)
    owners = {name: np.repeat(np.arange(count), x.shape[1]) for name, x in answers.items()}
    given = {name: np.where(finite[:, None], x, 0.0).ravel() for name, x in answers.items()}
    return _errors(stack.direct_sum(some), given, owners, finite, tolerance)


def _errors(
    problem: Any, answers: Mapping[str, Vector], owners: Mapping[str, Numbers], finite: Flags, tolerance: float
) -> tuple[Vector, Flags]:
    """Errors of answers to problems side by side, and whether rounding decides of them; `owners` : the problem that
    each number of an answer belongs to."""
    count = finite.size
    with np.errstate(all="ignore"):
        answer = ROWS[problem.node](problem, problem.point_type(**answers))
        if isinstance(answer, ContactAnswer):
            groups = Groups(owners["r"][:: problem.dimension], count, problem.nc)
            errors = contact_error(answer, groups)
            error, floor = groups.largest(errors.errors), groups.largest(errors.floors)
        else:
            if not answer.frame.k:
                return np.where(finite, 0.0, np.inf), np.zeros(count, dtype=bool)
            errors = linear_error(answer, Groups(_of_blocks(answer, owners), count, answer.frame.k))
            error, floor = errors.errors, errors.floors
    hidden = errors.hidden(error, floor, tolerance) | errors.ill_posed
    return np.where(finite & np.isfinite(error), error, np.inf), finite & hidden


def _of_blocks(system: System, owners: Mapping[str, Numbers]) -> Numbers:
    """Return which of the problems side by side has which block, (k,): the parts of answers come one after the
    other."""
    numbers = np.concatenate(list(owners.values()))[: system.x.size]  # what follows are multipliers of bounds
    if system.frame.block is None:
        return numbers
    of = np.zeros(system.frame.k, dtype=np.int64)
    of[system.frame.block] = numbers
    return of
