"""Suites of built-in problems, for runs that name no problem.

    quick       ten problems of each formulation of the core, by the solvers of `SolverSpec.quick`: an answer within a
                minute
    standard    all built-in problems, by the same solvers
    full        all built-in problems, by every solver that is installed, approximate routes too

A suite is nothing but values of a set: what is said on the command line or in a plan wins over them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from cpbench.solvers.base import solvers

QUICK, STANDARD, FULL = "quick", "standard", "full"
SUITES = (QUICK, STANDARD, FULL)
QUICK_SECONDS, QUICK_REPEATED = 5.0, 0.02
"""Limit of a solve of the quick suite, and below what it is repeated [s]: its results are to come within a minute."""


def values(suite: str, problems: Callable[[], Sequence[str]]) -> dict[str, Any]:
    """Return the values that a suite gives a set; `problems` finds the addresses of the small ones.

    >>> values("full", list)
    {'suite': 'full', 'problems': ('builtin',), 'routes': 'facets'}
    """
    if suite == QUICK:
        return {
            "suite": suite,
            "routes": "exact",
            "problems": tuple(problems()),
            "solvers": quick_solvers(),
            "timeout": QUICK_SECONDS,
            "repeat_below": QUICK_REPEATED,
        }
    if suite == STANDARD:
        return {"suite": suite, "problems": ("builtin",), "solvers": quick_solvers(), "routes": "exact"}
    return {"suite": suite, "problems": ("builtin",), "routes": "facets"}


def quick_solvers() -> tuple[str, ...]:
    """Return the names of the solvers in the quick suite."""
    return tuple(solver.spec.name for solver in solvers if solver.spec.quick)
