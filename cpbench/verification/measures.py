"""The error of an answer to any formulation, by which its verdict is given."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

import cpbench.verification.conic_systems  # noqa: F401  # pyright: ignore[reportUnusedImport]  (enters its rows)
from cpbench.verification import contact_systems
from cpbench.verification.backward_error import BackwardError
from cpbench.verification.frame import System
from cpbench.verification.mixed_error import mixed_error
from cpbench.verification.part_error import part_error, parts_between, parts_of
from cpbench.verification.parts import Measure
from cpbench.verification.tables import BY_PARTS, SYSTEMS

AT_START: dict[str, Callable[[Any], dict[str, Any]]] = {
    "nlp": lambda problem: {"z": problem.at_start},
    "nfc": lambda problem: {"v": problem.start},
}
"""Nodes of these whose matrix depends on the point, with another point of the problem."""
NOTICED = 0.1
"""An accepted answer in which a contact with load misses the law by so much of its own has the flag `contact`."""


def system_of(problem: Any, point: Any) -> System | None:
    """Return the rows of an answer that the problem has accepted; None for a formulation of a plugin."""
    with np.errstate(all="ignore"):
        return SYSTEMS[problem.node](problem, point) if problem.node in SYSTEMS else None


def measure(problem: Any, point: Any, system: System | None = None) -> BackwardError:
    """Return the error of an answer that the problem has accepted; `system` are its rows, where they are made
    already."""
    system = system or system_of(problem, point)
    if system is None:  # a formulation of a plugin is measured by its own residuals
        return BackwardError(problem.residuals(point).error, False, 0.0)
    with np.errstate(all="ignore"):
        if problem.node not in BY_PARTS:
            return mixed_error(system)
        measure = BY_PARTS[problem.node]
        if problem.node not in AT_START:
            return part_error(system, parts_of(system.frame, measure))
        there = dataclasses.replace(point, **AT_START[problem.node](problem))
        return part_error(system, parts_between(system.frame, SYSTEMS[problem.node](problem, there).frame, measure))


def misses_the_law(problem: Any, system: System | None, tolerance: float) -> bool:
    """Return whether a contact that carries load misses its law by more than `NOTICED` of its own size."""
    if system is None or BY_PARTS.get(problem.node) is not Measure.ENERGY or not problem.nc:
        return False
    with np.errstate(all="ignore"):
        return contact_systems.worst_loaded(problem, system, tolerance) > NOTICED
