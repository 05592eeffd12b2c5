"""The answers to a problem for several values of one of its parameters."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cpbench.analysis.contact_freedom import freedom_lines
from cpbench.api.solution import Solution, objective_of
from cpbench.api.solving import solve
from cpbench.bench.planning import grids
from cpbench.errors import CpbenchError, ProblemError, UnknownName
from cpbench.formulations.base import Problem
from cpbench.formulations.contact import ContactProblem
from cpbench.foundation.text import some_of
from cpbench.verification import error_text

COEFFICIENTS = ("mu", "mu_r")
"""Vectors of which all entries get the value."""
FEW = 3
"""Unknowns of an answer that have a column each."""


@dataclass(frozen=True, eq=False)
class SweptAnswer:
    """The answer for one `value` of the parameter."""

    value: float
    solution: Solution


def over(text: str) -> tuple[str, list[float]]:
    """Return a name and its values of ``mu=0.1:2.0:0.1`` (with the last) or ``mu=0.1|0.5``; raises CpbenchError.

    >>> over("mu=0.1:0.4:0.1")
    ('mu', [0.1, 0.2, 0.3, 0.4])
    """
    name, equals, written = text.partition("=")
    try:
        values = [float(value) for value in grids.values(written, 0.0, text)] if equals else []
    except ValueError:
        values = []
    if not (name and values and np.isfinite(values).all()):
        raise CpbenchError(f"--over '{text}': write NAME=first:last:step, as in mu=0.1:2.0:0.1, or mu=0.1|0.5")
    return name, values


def with_value(problem: Problem, name: str, value: float) -> Problem:
    """Return the problem with a parameter of its maps, or with all coefficients of friction, set to a value.

    Raises UnknownName where it has none of that name, ProblemError where it has none at all, or for
    a value that is not allowed.
    """
    if name in problem.parameters:
        return problem.with_parameters({name: value})
    given: Any = getattr(problem, name, None) if name in COEFFICIENTS and isinstance(problem, ContactProblem) else None
    if given is None or name not in problem.data():
        known = [*problem.parameters, *(other for other in COEFFICIENTS if other in problem.data())]
        if not known:
            raise ProblemError(problem.node, f"has no parameter {name}, nor another: its numbers are no parameters")
        raise UnknownName(f"parameter of this {problem.node}", name, known)
    if "joints" in problem.info.properties:
        raise ProblemError(f"{problem.node}.{name}", f"is not of contacts alone: {problem.info.properties['joints']}")
    info = replace(problem.info, properties={})
    return replace(problem, info=info, provenance=(), **{name: np.full(given.shape, value)})


def sweep(
    problem: Problem, name: str, values: Sequence[float], *, tolerance: float = 1e-6, seconds: float = 10.0
) -> Iterator[SweptAnswer]:
    """Yield the answer for each value of a parameter, by the automatic choice, in this process; raises as `solve`."""
    changed = [(value, with_value(problem, name, value)) for value in values]
    for value, one in changed:
        yield SweptAnswer(value, solve(one, tolerance=tolerance, seconds=seconds))


def head(problem: Problem, name: str) -> list[str]:
    """Return the names of the columns of `cells`."""
    if isinstance(problem, ContactProblem):
        return [name, "status", "error", "stick", "slip", "open", "rolls", "largest sliding speed"]
    objective = ["objective"] if hasattr(problem, "objective") else []
    part, size = next(iter(problem.point_sizes.items()), ("", 0))
    return [name, "status", "error", *objective, *(f"{part}[{i}]" for i in range(min(size, FEW)))]


def cells(answer: SweptAnswer) -> list[str]:
    """Return a row: value, status, error, and what contacts do, or the objective and the first unknowns."""
    solution = answer.solution
    first = [f"{answer.value:g}", str(solution.status), error_text(solution.error)]
    if isinstance(solution.problem, ContactProblem):
        table = solution.contacts
        if table is None:
            return [*first, *["-"] * 5]
        counts = table.counts()
        states = (str(counts.get(state, 0)) for state in ("stick", "slip", "open", "rolls"))
        return [*first, *states, f"{table.sliding[table.state != 'open'].max(initial=0.0):.3g}"]
    columns = len(head(solution.problem, "")) - 3
    if solution.point is None:
        return [*first, *["-"] * columns]
    objective = objective_of(solution.problem, solution.point)
    numbers = [] if objective is None else [objective]
    numbers += next(iter(solution.point.arrays().values()))[:FEW].tolist()
    return [*first, *(f"{number:.9g}" for number in numbers)]


def remarks(name: str, answers: Sequence[SweptAnswer]) -> Iterator[str]:
    """Yield what solved answers with contacts leave open, as `cpbench solve` says it, with the values where they do."""
    found: dict[str, list[str]] = {}
    for answer in answers:
        solution = answer.solution
        if solution and isinstance(solution.problem, ContactProblem):
            for line in freedom_lines(solution.problem, solution.point, solution.tolerance):
                found.setdefault(line.strip(), []).append(f"{answer.value:g}")
    for line, values in found.items():
        yield f"  {name} = {some_of(values, FEW)}: {line}"
