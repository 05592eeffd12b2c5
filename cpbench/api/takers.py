"""Solvers that take a problem which cpbench's own do not, asked of the registry."""

from __future__ import annotations

from dataclasses import replace

from cpbench import graph
from cpbench.api.solution import Solution
from cpbench.errors import NoRoute
from cpbench.formulations.base import Problem
from cpbench.foundation.plurals import some_of
from cpbench.solvers.automatic import automatic_solvers
from cpbench.solvers.base import missing, solvers
from cpbench.verification import Status

SHOWN = 6
"""The most solvers that are named."""


def advised(solution: Solution) -> Solution:
    """Return the solution; where the automatic choice ends without any answer, its message says who else takes the
    problem."""
    failed = solution.status is Status.FAILED and solution.point is None
    if not failed or solution.solver not in automatic_solvers().values():
        return solution
    advice = other_takers(solution.problem)
    return replace(solution, message="; ".join(filter(None, (solution.message, advice))))


def other_takers(problem: Problem) -> str:
    """Say which installed solvers of others take a problem: as it is, else by the nearest exact conversions; '' where
    none does."""
    if names := _takers(problem, native=False):
        return f"name a solver that takes it as it is: {some_of(names, SHOWN)}"
    for node in _nearest(problem):
        try:
            arrival = graph.arrive(problem, node)
        except NoRoute:
            continue
        if names := _takers(arrival.problem, native=False):
            return f"name a solver that takes it by {arrival.route.label}: {some_of(names, SHOWN)}"
    return ""


def direct_takers(problem: Problem) -> str:
    """Say which installed solvers take a problem as it is."""
    names = _takers(problem, native=True)
    if not names:
        return f"name a solver; cpbench list solvers {problem.node} has those that take it as it is"
    return f"name a solver that takes it as it is: {', '.join(names)}"


def _takers(problem: Problem, *, native: bool) -> list[str]:
    """Return installed solvers of the formulation that do not refuse the problem; those of cpbench if `native`."""
    of_node = (one for one in solvers if one.spec.node == problem.node and one.spec.by_default)
    asked = (one for one in of_node if (native or one.origin != "native") and not missing(one.spec))
    return [one.spec.name for one in asked if one.obstacle(problem) is None]


def _nearest(problem: Problem) -> list[str]:
    """Return the other formulations that paths of conversions lead to, those at the least cost first."""
    others = (node for node in graph.reachable(problem.node) if node != problem.node)
    costs = {node: routes[0].cost for node in others if (routes := graph.candidates(problem.node, node))}
    return sorted(costs, key=costs.__getitem__)
