"""Small changes of a problem that make it a neighbour: other units, repeated parts, ties, stiffer operators.

Those of units and repetition keep a solution where there is one; others may not, and the reference solver decides.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from cpbench.errors import CpbenchError
from cpbench.formulations.base import Problem
from cpbench.foundation import matrices
from cpbench.foundation.matrices import dense
from cpbench_lab.reduction.numbers import FIXED, FRICTION, OPERATORS, rounded
from cpbench_lab.reduction.parts import RemovablePart, bare, kinds, without
from cpbench_lab.reduction.reduce import semidefinite

Rng = np.random.Generator
Mutation = Callable[[Problem, Any, Rng], Problem]
BOUNDS = ("lb", "ub")
"""Vectors in the units of the unknowns, where others are in those of the rows."""


def mutated(problem: Problem, solution: Any, rng: Rng) -> tuple[str, Problem]:
    """Return the name of a mutation and what it makes of the problem; raises CpbenchError where none applies.

    Parameters
    ----------
    solution : a point that solves the problem, None where none is known.
    """
    for k in rng.permutation(len(MUTATIONS)).tolist():
        name = list(MUTATIONS)[k]
        try:
            changed = MUTATIONS[name](problem, solution, rng)
        except CpbenchError:
            continue
        if any(semidefinite(problem, op) and not semidefinite(changed, op) for op in OPERATORS):
            continue  # a monotone problem stays one
        if changed.fingerprint != problem.fingerprint and sum(changed.point_sizes.values()):
            return name, changed
    raise CpbenchError(f"no mutation of {problem.node} applies")


def _any_part(problem: Problem, rng: Rng) -> RemovablePart:
    groups = list(kinds(problem).values())
    group = groups[int(rng.integers(len(groups)))]
    return group[int(rng.integers(len(group)))]


def _affine_only(problem: Problem) -> None:
    if problem.has_maps():
        raise CpbenchError(f"{problem.node} has maps, which are not rewritten")


def _units(problem: Problem, solution: Any, rng: Rng) -> Problem:
    """Give a part other units: its rows and columns times a power of ten."""
    _affine_only(problem)
    part, factor = _any_part(problem, rng), 10.0 ** float(rng.integers(-4, 5))
    changed: dict[str, Any] = {}
    for name, shape in problem.shapes().items():
        if name in (*FIXED, *FRICTION) or not set(shape) & part.places.keys():
            continue
        value: Any = getattr(problem, name)
        array = np.array(dense(value) if len(shape) == 2 else value)
        for axis, symbol in enumerate(shape):
            if symbol in part.places and symbol != "nc":
                where = (slice(None),) * axis + (part.places[symbol],)
                array[where] *= 1.0 / factor if name in BOUNDS else factor
        changed[name] = array
    return bare(problem, changed)


def _repeated(problem: Problem, solution: Any, rng: Rng) -> Problem:
    """Repeat a part: a contact beside itself, a row that says the same again."""
    _affine_only(problem)
    if hasattr(problem, "cone_kind"):
        raise CpbenchError("cones are not repeated")
    part = _any_part(problem, rng)
    if "n" in part.places and hasattr(problem, "mu"):
        raise CpbenchError("a body that is there twice has no masses of its own")
    changed: dict[str, Any] = {}
    sizes = problem.sizes()
    for name, shape in problem.shapes().items():
        value: Any = getattr(problem, name)
        array = np.array(dense(value) if len(shape) == 2 else value)
        for axis, symbol in enumerate(shape):
            if symbol in part.places:
                array = np.take(array, np.r_[np.arange(sizes[symbol]), part.places[symbol]], axis=axis)
        changed[name] = array
    return bare(problem, changed)


def _fewer(problem: Problem, solution: Any, rng: Rng) -> Problem:
    """Leave a part out."""
    return without(problem, [_any_part(problem, rng)], solution)


def _ties(problem: Problem, solution: Any, rng: Rng) -> Problem:
    """Round the numbers to one digit or two, so that ratios tie."""
    _affine_only(problem)
    count = int(rng.integers(1, 3))
    changed = {
        name: rounded(dense(v) if v.ndim == 2 else v, count)  # type: ignore[arg-type]
        for name, v in problem.data().items()
        if name not in FIXED
    }
    return bare(problem, changed)


def _stiffer(problem: Problem, solution: Any, rng: Rng) -> Problem:
    """Add t·aaᵀ to the operator, a of one or two entries and t up to 1e6: definiteness stays, conditioning does not."""
    name = next((name for name in OPERATORS if name in problem.data()), None)
    if name is None:
        raise CpbenchError(f"{problem.node} has no operator")
    M = np.array(dense(getattr(problem, name)))
    if not M.size:
        raise CpbenchError(f"{problem.node}.{name} is empty")
    a = np.zeros(len(M))
    a[rng.integers(len(M), size=2)] = rng.choice([-1.0, 1.0], 2)
    return bare(problem, {name: M + 10.0 ** rng.uniform(-6, 6) * matrices.max_abs(M) * np.outer(a, a)})


def _load(problem: Problem, solution: Any, rng: Rng) -> Problem:
    """Make a vector of the data larger or smaller, or one of its numbers 0 or of the other sign; friction stays ≥ 0."""
    names = [n for n, v in problem.data().items() if v.ndim == 1 and v.size and n not in (*FIXED, *BOUNDS)]
    if not names:
        raise CpbenchError(f"{problem.node} has no vector")
    name = names[int(rng.integers(len(names)))]
    vector = np.array(problem.data()[name])
    if rng.random() < 0.4:
        vector *= 10.0 ** float(rng.integers(-6, 7))
    else:
        vector[int(rng.integers(vector.size))] *= float(rng.choice([0.0, 1.0 if name in FRICTION else -1.0, 1e-3, 1e3]))
    return bare(problem, {name: vector})


def _degenerate(problem: Problem, solution: Any, rng: Rng) -> Problem:
    """Take from q the slack of a row at the solution, which stays one: the pair of this row is then both 0."""
    q: Any = problem.data().get("q")
    slack = None if solution is None else next(iter(problem.slacks(solution).values()), None)
    if q is None or slack is None or slack.shape != q.shape or hasattr(problem, "mu"):
        raise CpbenchError("no solution is known whose slacks are rows of q")
    row = int(rng.integers(q.size))
    return bare(problem, {"q": q - np.where(np.arange(q.size) == row, slack, 0.0)})


MUTATIONS: Mapping[str, Mutation] = {
    change.__name__.strip("_"): change for change in (_units, _repeated, _fewer, _ties, _stiffer, _load, _degenerate)
}
