"""Answers without multipliers, which are all that many solvers print."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass
from typing import Any

import numpy as np

from cpbench.errors import PointError, ProblemError
from cpbench.formulations.base import Problem
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Vector


@dataclass(frozen=True, eq=False)
class Primal:
    """The part `name` of an answer whose multipliers are not known.

    Attributes
    ----------
    name : z or x. values : (n,), finite or not.
    """

    name: str
    values: Vector


def primal_of(problem: Problem, x: Any) -> Primal | None:
    """Return a plain vector as an answer without multipliers, None where it has not exactly the numbers of one.

    It is one where it has as many numbers as the problem has unknowns, and a whole answer has more. Raises PointError
    where it is not a vector of numbers.
    """
    values, sizes = _vector(problem, x), problem.point_sizes
    if not problem.primal or values.size != sizes[problem.primal] or values.size == sum(sizes.values()):
        return None
    return Primal(problem.primal, values)


def primal_alone(problem: Problem, present: Container[str]) -> bool:
    """Return whether of the parts of an answer that have numbers, the unknowns are `present` and no other is."""
    parts = [name for name, size in problem.point_sizes.items() if size]
    return problem.primal in parts[:1] and len(parts) > 1 and [p for p in parts if p in present] == parts[:1]


def primal_part(problem: Problem, x: Any) -> Primal:
    """Return the part of an answer that has the unknowns; raises PointError unless it has their number."""
    values, size = _vector(problem, x), problem.point_sizes[problem.primal]
    if values.size != size:
        raise PointError(f"{problem.node}: the answer's {problem.primal} has {values.size} numbers, expected {size}")
    return Primal(problem.primal, values)


def _vector(problem: Problem, x: Any) -> Vector:
    try:
        return matrices.vector(np.ravel(x), "answer", finite=False)
    except (ProblemError, TypeError, ValueError) as cause:
        raise PointError(f"{problem.node}: the answer is not a vector of numbers ({cause})") from None
