"""Planted cases written in another unit: rows (velocities, values of a map, an objective) times a number.

A change of units changes no mathematics, but what an absolute tolerance means.
"""

from __future__ import annotations

import dataclasses
from typing import Any

from cpbench.formulations.expressions import Map
from cpbench.formulations.expressions.recording import MapRecorder
from cpbench.registry import NodeTable
from cpbench.testing.cases import Case


def in_unit(case: Case, unit: float) -> Case | None:
    """Return a case whose rows are `unit` times as large, with its solution; None of a node that is not listed here."""
    change = CHANGES.get(case.problem.node)
    if change is None:
        return None
    data, answer = change
    name = f"{case.name}-in-{unit:g}"
    problem = dataclasses.replace(case.problem, name=name, **_times(case.problem, data, unit))
    return Case(name, problem, dataclasses.replace(case.point, **_times(case.point, answer, unit)))


def _times(whole: Any, names: str, unit: float) -> dict[str, Any]:
    values = {name: getattr(whole, name) for name in names.split()}
    return {name: _scaled(value, unit) if isinstance(value, Map) else value * unit for name, value in values.items()}


def _scaled(F: Map, unit: float) -> Map:
    record = MapRecorder(F.inputs)
    return record.map(record(F, record.z) * unit)


CHANGES: NodeTable[tuple[str, str]] = NodeTable("change of unit", "no check in other units")
"""By node: the data, and the parts of an answer, that are multiplied."""
for _node, _names in {
    "lcp": ("M q", ""),
    "mlcp": ("A B C D a b", ""),
    "relay": ("M q", ""),
    "soclcp": ("M q", ""),
    "avi": ("M q", "lam mu"),
    "qp": ("Q p", "lam mu nu"),
    "coneqp": ("Q p", "y"),
    "fc": ("W q", ""),
    "rfc": ("W q", ""),
    "gfc": ("M f", "r lam"),
    "grfc": ("M f", "r lam"),
    "ncp": ("F", ""),
    "micp": ("F", ""),
    "equation": ("F", ""),
    "vi": ("F", "lam mu nu"),
    "nlp": ("f", "lam mu nu"),
}.items():
    CHANGES.enter(_names, _node)
