"""The automatic choice: which of cpbench's own choosers a problem goes to where no solver is named."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

from cpbench import graph
from cpbench.solvers.automatic import automatic_solver, automatic_solvers
from cpbench.solvers.base import solvers

AUTO = "auto"
"""The name that stands for the automatic choice, whatever the formulation of a problem."""


def nearest_automatic(node: str) -> Iterator[str]:
    """Yield the automatic choices that a path of conversions reaches from a formulation, cheapest first; then our
    other solvers of that formulation."""
    own = automatic_solver(node)
    if own is not None:
        yield own
    known = automatic_solvers()
    # only the cheapest path of each: they come in this order
    first = {other: next(iter(graph.candidates(node, other)), None) for other in known if other != node}
    ordered = sorted((route.cost, known[other]) for other, route in first.items() if route is not None)
    yield from (name for _, name in ordered)
    yield from (name for name in _own(node) if name not in known.values())


def all_automatic() -> list[str]:
    """Return every solver that may be the automatic choice of some problem."""
    known = automatic_solvers()
    without = [node for node in graph.formulations.names() if node not in known]
    return [*known.values(), *(name for node in without for name in _own(node))]


@lru_cache(maxsize=2**10)
def nearest_reached(node: str, nodes: frozenset[str]) -> str:
    """Return the first of `nearest_automatic` whose formulation is one of `nodes`; '' where there is none."""
    return next((name for name in nearest_automatic(node) if solvers.get(name).spec.node in nodes), "")


def _own(node: str) -> Iterator[str]:
    ours = (one for one in solvers if one.spec.node == node and one.origin == "native")
    return (one.spec.name for one in ours if one.spec.by_default)
