"""Warm-ups that wait until they are needed: a process that solves one problem loads what this one takes.

A run warms a solver up completely before it times anything, so that nothing below happens there.
"""

from __future__ import annotations

from cpbench.solvers.base import Solver, solvers
from cpbench.solvers.clock import off_the_clock

_warm: set[str] = set()
"""Solvers that have warmed up completely in this process."""
_begun: set[str] = set()
"""Solvers that have warmed up as far as every solve needs."""


def ready(name: str, *, quickly: bool) -> Solver:
    """Return the solver of a name, warmed up completely, or as far as every solve needs.

    Raises UnknownName.
    """
    if name in (_begun if quickly else _warm):
        return solvers.get(name)
    with off_the_clock():
        solver = solvers.get(name)
        (warm_up_quickly if quickly else warm_up)(solver)
    return solver


def warm_up(solver: Solver) -> None:
    """Warm a solver up completely, once a process."""
    if solver.spec.name not in _warm:
        with off_the_clock():
            solver.warmup()
        _warm.add(solver.spec.name)
        _begun.add(solver.spec.name)


def warm_up_quickly(solver: Solver) -> None:
    """Warm a solver up as far as every solve needs, once a process."""
    if solver.spec.name not in _begun:
        with off_the_clock():
            solver.warmup_quickly()
        _begun.add(solver.spec.name)
