"""Which functions make the planted cases of a formulation."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

from cpbench.formulations import Problem

Make: TypeAlias = Callable[[], dict[str, tuple[Problem, Any]]]
PLANTED: dict[str, tuple[Make, ...]] = {}
"""Node -> functions that return problems with a solution, by name."""


def plants(node: str) -> Callable[[Make], Make]:
    """Return a decorator that enters a function as one more maker of cases of a formulation; a plugin may do so."""

    def enter(make: Make) -> Make:
        PLANTED[node] = (*PLANTED.get(node, ()), make)
        return make

    return enter
