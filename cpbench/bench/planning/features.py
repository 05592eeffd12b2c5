"""Facts of a problem for conditions and reports, found by the referee of every problem and kept in the results.

Every problem of every run has them, so that they cost passes over its data at most: names, origin, sizes, entries,
friction.
A condition that names what a problem does not have does not hold.
"""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any

import numpy as np

from cpbench.formulations.base import Problem, formulations
from cpbench.foundation import matrices

ORIGIN = ("source", "licence", "citation")
TEXTS = ("node", "family", "name", "sequence", *ORIGIN)
GLOBAL = ("gfc", "grfc", "nfc")
"""Nodes whose n is the number of degrees of freedom, which local ones do not have."""
NUMBERS = {
    "unknowns": "numbers in an answer",
    "dimension": "rows of a contact",
    "ndof": "degrees of freedom (global contact problems)",
    "nnz": "nonzeros of all matrices",
    "entries": "entries of all matrices, zero or not",
    "density": "nnz / entries",
    "step": "in its sequence",
    "operations": "operations of the nonlinear maps",
    "mu_min": "least coefficient of friction",
    "mu_median": "median coefficient of friction",
    "mu_max": "largest coefficient of friction",
}


def features(problem: Problem) -> dict[str, float | str]:
    """Return the facts of a problem, all finite, with its sizes under their symbols.

    >>> from cpbench.formulations import LCP
    >>> found = features(LCP(M=[[2.0, 0], [1, 2]], q=[-1.0, 1]))
    >>> [found[name] for name in ("n", "unknowns", "nnz", "density")]
    [2.0, 2.0, 3.0, 0.75]
    """
    facts: dict[str, float | str] = {"node": problem.node, "family": problem.info.family, "name": problem.name}
    facts |= {name: text for name in ORIGIN if (text := getattr(problem.info, name))}
    sizes = problem.sizes()
    tables: list[Any] = [value for value in problem.data().values() if value.ndim == 2]
    nonzeros = sum(matrices.nnz(table) for table in tables)
    entries = sum(table.shape[0] * table.shape[1] for table in tables)
    numbers: dict[str, float] = {**sizes, "unknowns": sum(problem.point_sizes.values())}
    numbers |= {"nnz": nonzeros, "entries": entries}
    if entries:
        numbers["density"] = nonzeros / entries
    if problem.maps():
        numbers["operations"] = sum(F.operations for F in problem.maps().values())
    if problem.node in GLOBAL:
        numbers["ndof"] = sizes["n"]
    if (dimension := getattr(problem, "dimension", None)) is not None:
        numbers["dimension"] = dimension
    if (sequence := getattr(problem, "sequence", None)) is not None:
        facts["sequence"], numbers["step"] = sequence.name, sequence.step
    if sizes.get("nc"):
        mu = matrices.dense(getattr(problem, "mu"))  # noqa: B009
        numbers |= {"mu_min": mu.min(), "mu_median": np.median(mu), "mu_max": mu.max()}
    return facts | {name: float(value) for name, value in numbers.items() if math.isfinite(value)}


def known() -> dict[str, type]:
    """Return the names and types of all facts, which a condition may name."""
    symbols = {
        symbol
        for formulation in formulations
        for data in fields(formulation)
        for symbol in data.metadata.get("shape") or data.metadata.get("map", ())
        if not symbol[0].isdigit()
    }
    return dict.fromkeys(TEXTS, str) | dict.fromkeys([*sorted(symbols), *NUMBERS], float)
