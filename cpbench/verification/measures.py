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


@np.errstate(all="ignore")
def measure(problem: Any, point: Any) -> BackwardError:
    """Return the error of an answer that the problem has accepted."""
    return measured_rows(problem, point)[0]


def measured_rows(problem: Any, point: Any) -> tuple[BackwardError, System | None]:
    """Return the error of an answer that the problem has accepted, and its rows, if the judge has any."""
    if problem.node not in SYSTEMS:  # a formulation of a plugin is measured by its own residuals
        return BackwardError(problem.residuals(point).error, False, 0.0), None
    system = SYSTEMS[problem.node](problem, point)
    if problem.node not in BY_PARTS:
        return mixed_error(system), system
    measure = BY_PARTS[problem.node]
    if problem.node not in AT_START:
        return part_error(system, parts_of(system.frame, measure)), system
    there = dataclasses.replace(point, **AT_START[problem.node](problem))
    parts = parts_between(system.frame, SYSTEMS[problem.node](problem, there).frame, measure)
    return part_error(system, parts), system


def misses_the_law(problem: Any, system: System | None, tolerance: float) -> bool:
    """Return whether a contact that carries load misses its law by more than `NOTICED` of its own size."""
    if system is None or BY_PARTS.get(problem.node) is not Measure.ENERGY or not problem.nc:
        return False
    return contact_systems.worst_loaded(problem, system, tolerance) > NOTICED
