"""Every published solution of a nonlinear problem, reproduced to 1e-10 by three solvers of different kinds or more."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

import generated
import numpy as np
import pytest
from tiers import some_by_day

from cpbench import graph
from cpbench.conversions.base import conversions
from cpbench.errors import CpbenchError
from cpbench.formulations.base import Kind, Point, Problem
from cpbench.generators import Instance
from cpbench.solvers.base import Budget, solvers

TOLERANCE = 1e-10
CLOSE = 1e-3
"""How far from the published numbers, of the largest of them: where a problem is singular, a residual of 1e-12 holds an
answer to that only. Other solutions of the same problem are farther away."""
ENOUGH = 3
KINDS: Mapping[str, tuple[str, ...]] = {
    "semismooth Newton": ("newton-fb-micp", "newton-vi", "newton-qvi", "newton-equation"),
    "linearization": ("josephy-newton",),
    "normal map": ("path-search", "newton-normal-map"),
    "smoothing": ("smoothing-newton",),
    "Powell's hybrid method": ("scipy-root-hybr",),
    "Levenberg and Marquardt": ("scipy-root-lm",),
    "interior point": ("casadi-ipopt-nlp",),
    "sequential quadratic program": ("casadi-sqpmethod", "scipy-slsqp"),
    "projection": ("extragradient-vi", "projection-qvi"),
}
"""Solvers by what their steps are made of: a kind has reproduced a solution when one of its solvers has."""
HOMOGENEOUS = {"mathiesen": 1, "mathiesen-hard": 1}
"""Problems whose solutions are rays: from this unknown on they are told up to a factor."""
LISTED = {f"{entry.node}-{entry.name}": entry for entry in generated.shipped(maps=True) if entry.known == "published"}


@cache
def _there(label: str, node: str) -> Problem | None:
    """The problem as another node; a program by its first-order conditions, which are necessary."""
    problem = generated.instance(LISTED[label]).problem
    ways = frozenset({Kind.EQUIVALENT, Kind.ONE_WAY, Kind.NECESSARY})
    via = [conversions.get("nlp-micp")(qualified=1)] if problem.node == "nlp" and node != "nlp" else []
    try:
        return graph.arrive(problem, node, ways, via).problem
    except CpbenchError:
        return None


def _starts(instance: Instance) -> Iterator[Point | None]:
    """The problem's own, the published ones, and one near the solution, for problems that have others."""
    yield None
    yield from instance.starts
    rng = np.random.default_rng(1)
    parts = instance.solution.arrays().items()
    yield type(instance.solution)(**{k: v + 0.05 * (1.0 + abs(v)) * rng.uniform(-1.0, 1.0, v.size) for k, v in parts})


def _answers(label: str, name: str) -> Iterator[Any]:
    """Of one solver from every start that conversions carry to it, on the problem itself."""
    solver, instance = solvers.get(name), generated.instance(LISTED[label])
    there = _there(label, solver.spec.node)
    if there is None or solver.obstacle(there) is not None:
        return
    for start in _starts(instance):
        try:
            begin = None if start is None else graph.push(there, start)
            output = solver.run(there, Budget(tolerance=1e-12, seconds=3.0), start=begin)
            if output.point is not None:
                yield graph.lift(there, output.point)
        except CpbenchError:  # a start or an answer that a conversion does not carry
            continue


def _reproduced(label: str, answer: Any) -> bool:
    instance = generated.instance(LISTED[label])
    if not instance.problem.residuals(answer).error <= TOLERANCE:
        return False
    found, known, first = answer.z.copy(), instance.solution.z.copy(), HOMOGENEOUS.get(instance.name)
    for z in (found, known) if first is not None else ():
        z[first:] /= np.abs(z[first:]).max()
    return bool(np.abs(found - known).max() <= CLOSE * (1.0 + np.abs(known).max()))


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("label", some_by_day(LISTED, 21))
def test_three_kinds_of_solvers_reproduce_it(label: str, record_property: Any) -> None:
    by: dict[str, str] = {}
    for kind, names in KINDS.items():
        for name in names:
            if any(_reproduced(label, answer) for answer in _answers(label, name)):
                by[kind] = name
                break
        if len(by) == ENOUGH:
            break
    record_property("by", ", ".join(by.values()))
    assert len(by) == ENOUGH, by


def test_the_table_has_all_that_is_published() -> None:
    nodes = [entry.node for entry in LISTED.values()]
    assert {node: nodes.count(node) for node in set(nodes)} == {"ncp": 10, "vi": 4, "qvi": 2, "nlp": 41, "equation": 5}
