"""Facts of a problem that a condition may name: cheap to tell once it is loaded, measured by the referee."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cpbench import matrices
from cpbench.formulations.base import Problem, formulations

TEXTS = ("node", "family", "name", "sequence")
GLOBAL = ("gfc", "grfc")
"""Nodes whose n is the number of degrees of freedom; the local ones do not know it."""
NUMBERS: Mapping[str, str] = {
    "unknowns": "numbers in an answer",
    "dimension": "rows of a contact",
    "ndof": "degrees of freedom (global contact problems)",
    "nnz": "nonzeros of all matrices",
    "entries": "entries of all matrices, zero or not",
    "density": "nnz / entries",
    "step": "in its sequence",
}


def features(problem: Problem) -> dict[str, float | str]:
    """The facts that `problem` has; its sizes are among them, under their symbols.

    >>> from cpbench.formulations import LCP
    >>> features(LCP(M=[[2.0, 0], [1, 2]], q=[-1.0, 1]))["density"]
    0.75
    """
    found: dict[str, float | str] = {"node": problem.node, "family": problem.info.family, "name": problem.name}
    sizes = problem.sizes()
    found |= {name: float(size) for name, size in sizes.items()}
    found["unknowns"] = float(sum(problem.point_sizes.values()))
    tables: list[Any] = [value for value in problem.data().values() if value.ndim == 2]
    nonzeros = sum(matrices.nnz(table) for table in tables)
    entries = sum(table.shape[0] * table.shape[1] for table in tables)
    found |= {"nnz": float(nonzeros), "entries": float(entries)}
    if entries:
        found["density"] = nonzeros / entries
    if problem.node in GLOBAL:
        found["ndof"] = float(sizes["n"])
    dimension = getattr(problem, "dimension", None)
    if dimension is not None:
        found["dimension"] = float(dimension)
    sequence = getattr(problem, "sequence", None)
    if sequence is not None:
        found |= {"sequence": sequence.name, "step": float(sequence.step)}
    return found


def known() -> dict[str, type]:
    """Every fact that some problem has, with its type: what a condition may name."""
    symbols = {
        symbol
        for formulation in formulations
        for data in formulation._data_fields()
        for symbol in data.metadata["shape"]
        if not symbol.isdigit()
    }
    return dict.fromkeys(TEXTS, str) | dict.fromkeys([*sorted(symbols), *NUMBERS], float)
