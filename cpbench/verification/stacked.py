"""Verdicts on answers to many problems of one formulation and size, as arrays.

The judge measures a problem part by part (`part_error`), and problems side by side are parts of one large problem: its
blocks have the errors that they have by themselves. So answers to thousands of problems are measured in one go, by the
code and the definition that measure one. What belongs to a whole problem is taken for each: which numbers are finite,
and the largest error.
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
from cpbench.verification.frame import System, largest_of
from cpbench.verification.measures import BY_PARTS, SYSTEMS
from cpbench.verification.part_error import block_errors
from cpbench.verification.parts import Parts
from cpbench.verification.sets import Flags
from cpbench.verification.tables import STACKED

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
    error, floor = np.zeros(stack.count), np.zeros(stack.count)

    for some in stack.pieces(ENTRIES):
        error[some], floor[some] = _measured(stack, some, {name: x[some] for name, x in parts.items()})
    unresolvable = np.maximum(error, tolerance) <= floor
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


def _measured(stack: Stack, some: slice, answers: dict[str, Any]) -> tuple[Vector, Vector]:
    """Errors of the answers to some problems, and what rounding may cause."""
    count = some.stop - some.start
    finite = np.ones(count, dtype=bool)
    for x in answers.values():
        finite &= np.isfinite(x).all(axis=1)
    problem = stack.direct_sum(some)
    with np.errstate(all="ignore"):
        system = _system(problem, answers, finite)
        if not system.frame.k:
            return np.where(finite, 0.0, np.inf), np.zeros(count)
        own = _owners(system, answers)
        sums = system.frame.terms.sums(system.sizes)
        bounded = np.bincount(own, ~np.isfinite(sums + system.frame.constants), count) == 0
        if not bounded.all():  # squares of such unknowns are no numbers any more
            finite &= bounded
            system = _system(problem, answers, finite)
            sums = system.frame.terms.sums(system.sizes)
        node = stack.kind.node
        parts = Parts.of(system.frame, system.frame.terms.sizes, BY_PARTS[node], own)
        found = block_errors(system, parts, sums)
        error = largest_of(own, np.maximum(found.errors, found.grown**2), count)
        floor = largest_of(own, found.floors, count)
    return np.where(finite & np.isfinite(error), error, np.inf), np.where(finite, floor, 0.0)


def _system(problem: Any, answers: dict[str, Any], finite: Flags) -> System:
    """Return the rows of the answers, 0 in place of those that are no numbers."""
    whole = {name: np.where(finite[:, None], x, 0.0).ravel() for name, x in answers.items()}
    return SYSTEMS[problem.node](problem, problem.point_type(**whole))


def _owners(system: System, answers: dict[str, Any]) -> NDArray[np.int64]:
    """Return which of the problems side by side has which block, (k,): the parts of answers come one after the
    other."""
    numbers = [np.repeat(np.arange(len(x)), x.shape[1]) for x in answers.values()]
    # what follows the unknowns are multipliers of bounds, which are none here
    components, block = np.concatenate(numbers)[: system.x.size], system.frame.block
    if block is None:
        return components
    blocks = np.empty(system.frame.k, np.int64)
    blocks[block] = components
    return blocks
