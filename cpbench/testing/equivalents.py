"""Planted cases written otherwise: in another unit, or with unknowns, rows and contacts in another order.

A change of units changes no mathematics, but what an absolute tolerance means.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cpbench.formulations.base import Problem, formulations
from cpbench.formulations.conic import ConicProblem
from cpbench.formulations.contact import ContactProblem
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


CHANGES: NodeTable[tuple[str, str]] = NodeTable("change of unit")
"""Data, and parts of an answer, that are multiplied, by node."""
for _node, _rows in {
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
    CHANGES.enter(_rows, _node)


_NO_ROWS = np.zeros(0, dtype=np.int64)


def renumbered(case: Case, seed: int) -> Case | None:
    """Return the same problem with unknowns, rows and contacts in another order; None for a node that is not one of
    cpbench: the order of its dimensions may have a meaning."""
    if not formulations.get(case.problem.node).__module__.startswith("cpbench.formulations."):
        return None
    symbols = _symbols(case.problem)
    rng = np.random.default_rng(seed)
    order = {symbol: rng.permutation(case.problem.sizes()[symbol]) for symbol in symbols}
    if "nc" in order:  # the rows of a contact stay together, normal first
        d = case.problem.dimension
        order["m"] = (d * order["nc"][:, None] + np.arange(d)).ravel()
    if isinstance(case.problem, ConicProblem):  # so do those of a factor
        rows = np.split(np.arange(case.problem.K.rows), np.cumsum(case.problem.cone_size.astype(int))[:-1])
        factors = order["c" if "c" in order else "k"]
        if factors.size:
            order["m" if case.problem.node == "coneqp" else "n"] = np.concatenate(
                [_NO_ROWS, *(rows[i] for i in factors)]
            )
    if case.problem.node == "qvi":  # g is of (y, z); the bounds that move are as many as the unknowns, or none
        n = order["n"].size
        order |= {"2n": np.concatenate([order["n"], n + order["n"]])}
        order |= {s: order["n"] if case.problem.sizes()[s] else _NO_ROWS for s in ("nl", "nu")}
    data: dict[str, Any] = {}
    for field in dataclasses.fields(case.problem):
        if "shape" in field.metadata:
            rows, *columns = (order.get(symbol, slice(None)) for symbol in field.metadata["shape"])
            value = getattr(case.problem, field.name)[rows]
            data[field.name] = value[:, columns[0]] if columns else value
        elif "map" in field.metadata and getattr(case.problem, field.name).rows:
            rows, columns = (order.get(symbol, _NO_ROWS) for symbol in field.metadata["map"])
            data[field.name] = _reordered(getattr(case.problem, field.name), rows, columns)
    parts = {name: getattr(case.point, name)[order[symbol]] for symbol, names in symbols.items() for name in names}
    return Case(case.name, dataclasses.replace(case.problem, **data), type(case.point)(**parts))


def _symbols(problem: Problem) -> dict[str, list[str]]:
    """Return the dimensions whose order has no meaning, with the parts of a point that they count."""
    symbols: dict[str, list[str]] = {}
    for part in dataclasses.fields(problem.point_type):
        symbols.setdefault(part.metadata["size"], []).append(part.name)
    for counted in ("mu" if isinstance(problem, ContactProblem) else "", "cone_kind"):
        symbols |= {symbol: [] for symbol in problem.shapes().get(counted, ())[:1]}
    return symbols


def _reordered(F: Map, rows: NDArray[np.int64], columns: NDArray[np.int64]) -> Map:
    """Return x[columns] ↦ F(x)[rows]; the map to ℝ¹ has no rows to reorder."""
    record = MapRecorder(F.inputs)
    value = record(F, record.z[np.argsort(columns)])
    return record.map(value[rows] if rows.size else value)
