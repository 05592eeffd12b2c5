"""Solvers that others call for the problems that they make."""

from __future__ import annotations

from collections.abc import Collection

from cpbench.errors import UnknownName
from cpbench.solvers.base import Solver, solvers


def inner_solver(name: str, nodes: Collection[str]) -> Solver:
    """Return the solver of that name; raises UnknownName where it is of none of the nodes, or not there."""
    solver = solvers.get(name)
    if solver.spec.node not in nodes:
        fitting = [other.spec.name for other in solvers if other.spec.node in nodes]
        raise UnknownName(f"inner solver (of {' or '.join(nodes)})", name, fitting)
    return solver
