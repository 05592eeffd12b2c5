"""`mof`: MathOptFormat (JSON), which JuMP reads by `read_from_file("problem.mof.json")`.

The variables are z[1], z[2], ... or, of an mlcp, u[1], ..., v[1], ...; the rows of a qp are A[1], ... and C[1], ...,
those of an nlp g[1], ... and h[1], ... (or one vector g, one h); `formats.mof` says how each node is written.
The answer is a JSON file, in one of two forms:

{"z": [0.0, 1.5]}                        one list for every part of the node's point (qp, nlp: z, lam, mu, nu)
{"primal": {"z[1]": 0.0, "z[2]": 1.5},   by the names of the variables; for a qp or nlp also
 "dual": {"A[1]": 1.0, "C[1]": -2.0},    by those of the rows, with MathOptInterface's signs, which are ours: λ ≥ 0
 "reduced_cost": {"z[1]": 0.5}}          of the variables: what the bounds push with, at least 0 at the lower one

By name, what is left out of `dual` and `reduced_cost` is 0; a variable without a value is an error. null is NaN.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np

from cpbench.errors import FormatError
from cpbench.formulations.base import Point, Problem
from cpbench.formulations.exchange import Exchange, exchanges
from cpbench.formulations.expressions.mof_json import as_float
from cpbench.foundation.matrices import Vector
from cpbench.storage.base import write_atomic
from cpbench_problems.formats import mof
from cpbench_problems.formats.mof_read import load_json, read

_NAMED = {
    "nlp": {"lam": ("dual", "g"), "mu": ("dual", "h"), "nu": ("reduced_cost", "z")},
    "qp": {"lam": ("dual", "A"), "mu": ("dual", "C"), "nu": ("reduced_cost", "z")},
    "avi": {"lam": ("dual", "A"), "mu": ("dual", "C")},
}
"""Parts of a point that are not variables: where their numbers stand, and what is numbered there."""


class MathOptFormat(Exchange):
    """The problem as one JSON file, the answer as another."""

    name = "mof"
    summary = "one MathOptFormat file (.mof.json), as JuMP reads it; answers in JSON"
    suffix = mof.SUFFIX
    nodes = mof.MOF.writes
    maps = True

    def obstacle(self, problem: Problem) -> str | None:
        why = mof.obstacle(problem)
        return f"the exchange {self.name} cannot carry it: {why}" if why else super().obstacle(problem)

    def write_problem(self, problem: Problem, path: Path, dense: bool = False) -> None:
        """Write the problem; the format has no dense matrices, whatever `dense` asks for."""
        if problem.node not in mof.MOF.writes:
            able = ", ".join(sorted(mof.MOF.writes))
            raise FormatError(path, "", f"mof takes {able}, not a problem of type {problem.node}")
        text = "".join(mof.text(problem))
        write_atomic(path, text.encode(), force=True)

    def read_problem(self, path: Path) -> Problem:
        return read(path)

    def write_answer(self, point: Point, path: Path) -> None:
        lists = {
            name: [x if math.isfinite(x) else None for x in value.tolist()] for name, value in point.arrays().items()
        }
        write_atomic(path, json.dumps(lists).encode(), force=True)

    def read_answer(self, path: Path, problem: Problem) -> Any:
        document = load_json(path)
        named = "primal" in document
        parts: dict[str, Vector] = {}
        for name, size in problem.point_sizes.items():
            if named:
                group, label = _NAMED.get(problem.node, {}).get(name, ("primal", name))
                parts[name] = _by_name(path, document, group, label, size)
            else:
                parts[name] = _listed(path, document, name, size)
        return problem.point_type(**parts)


def _listed(path: Path, found: Mapping[str, Any], name: str, size: int) -> Vector:
    """Return the numbers of a list as a vector."""
    values = found.get(name, [] if not size else None)
    if not isinstance(values, list):
        held = ", ".join(list(found)[:5]) or "nothing"
        raise FormatError(path, name, f"is not a list, expected {size} numbers; the file holds {held}")
    values = cast("list[Any]", values)
    if len(values) != size:
        raise FormatError(path, name, f"has {len(values)} numbers, expected {size}")
    return np.array([_number(path, f"{name}/{k}", value) for k, value in enumerate(values)], float)


def _by_name(path: Path, found: Mapping[str, Any], group: str, label: str, size: int) -> Vector:
    """Return the numbers under label[1], label[2], ... as a vector."""
    entries = found.get(group, {})
    if not isinstance(entries, dict):
        raise FormatError(path, group, f"is a {type(entries).__name__}, expected numbers by name")
    entries = cast("dict[str, Any]", entries)
    if isinstance(entries.get(label), list):
        return _listed(path, entries, label, size)
    values = np.full(size, np.nan if group == "primal" else 0.0)
    seen = 0
    for name, value in entries.items():
        index = re.fullmatch(rf"{label}\[(\d{{1,18}})\]", name)
        if index is None:
            continue
        if not 1 <= int(index[1]) <= size:
            raise FormatError(path, f"{group}/{name}", f"is none of {label}[1] to {label}[{size}]")
        values[int(index[1]) - 1] = _number(path, f"{group}/{name}", value)
        seen += 1
    if group == "primal" and seen < size:
        raise FormatError(path, group, f"has {seen} of the {size} variables {label}[...]")
    return values


def _number(path: Path, where: str, value: Any) -> float:
    if value is None:
        return math.nan
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise FormatError(path, where, f"is a {type(value).__name__}, expected a number")
    return as_float(value)


exchanges.add("mof", MathOptFormat())
