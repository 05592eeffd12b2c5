"""Linear and quadratic programs in MPS and QPS files: RANGES, objective constants, QUADOBJ, QMATRIX and QSECTION."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.base import Info, Problem
from cpbench.formulations.programs import QP
from cpbench.storage.base import OFFSET, SENSE, UNKNOWNS, Format, build, formats, no_member, read_text, stem
from cpbench_problems.formats import two_sided
from cpbench_problems.formats.mps_sections import Reader
from cpbench_problems.formats.program_text import ProgramText
from cpbench_problems.formats.two_sided import infinite, require_order


class MPS(Format):
    """A maximum is the minimum of the opposite. Names of columns are kept; rows of type N beside the objective have no
    effect and are left out."""

    name = "mps"
    summary = "MPS and QPS: linear and quadratic programs, without integers and sets"
    suffixes = (".mps", ".qps", ".sif")

    def recognises(self, path: Path, head: bytes) -> bool:
        return path.suffix.lower() in self.suffixes

    def load(self, path: Path, member: str) -> Problem:
        no_member(path, member)
        found = Reader(path).read(read_text(path))
        n, m = len(found.columns), len(found.rows)
        at = {name: i for i, name in enumerate(found.rows)}
        A = _sparse([(at[row], found.columns[c], x) for (row, c), x in found.entries.items()], (m, n))
        p = np.array([found.cost.get(name, 0.0) for name in found.columns])
        lower, upper = _sides(found)
        lb = np.array([found.lower.get(name, 0.0) for name in found.columns])
        ub = np.array([found.upper.get(name, np.inf) for name in found.columns])
        about: dict[str, Any] = {"free_rows": found.free} if found.free else {}
        parts = program(path, _hessian(found), p, A, (lower, upper), (lb, ub), maximize=found.maximize)
        properties = noted(found.constant, found.maximize, list(found.columns)) | about
        return build(path, QP, "", name=found.name or stem(path), info=Info(properties=properties), **parts)


def program(
    path: Path, Q: Any, p: Any, A: Any, sides: tuple[Any, Any], bounds: tuple[Any, Any], *, maximize: bool
) -> dict[str, Any]:
    """Return the data of the QP: min ±(½zᵀQz + pᵀz) over rows and unknowns between two sides; raises FormatError."""
    sign = -1.0 if maximize else 1.0
    lower, upper = map(infinite, sides)
    lb, ub = map(infinite, bounds)
    require_order(path, lower, upper, "A")
    return {"Q": sign * Q, "p": sign * p, **two_sided.rows(A, lower, upper), "lb": lb, "ub": ub}


def noted(constant: float, maximize: bool, names: list[str]) -> dict[str, Any]:
    """Return the properties of a program."""
    properties: dict[str, Any] = {OFFSET: -constant if maximize else constant} if constant else {}
    return properties | ({SENSE: "max"} if maximize else {}) | {UNKNOWNS: names}


def _sides(found: ProgramText) -> tuple[Any, Any]:
    """Return the two sides of each row. A range R makes [b, b + |R|] of G, [b − |R|, b] of L, and of E the interval
    between b and b + R."""
    lower, upper = np.full(len(found.rows), -np.inf), np.full(len(found.rows), np.inf)
    for i, (row, kind) in enumerate(found.rows.items()):
        side, width = found.sides.get(row, 0.0), found.ranges.get(row)
        if kind in "GE":
            lower[i] = side
        if kind in "LE":
            upper[i] = side
        if width is not None:
            if kind == "G" or (kind == "E" and width >= 0):
                upper[i] = side + abs(width)
            else:
                lower[i] = side - abs(width)
    return lower, upper


def _hessian(found: ProgramText) -> sp.csr_array:
    """Return Q of ½zᵀQz: a triangle is mirrored, a whole matrix stands as it is."""
    terms = [(found.columns[i], found.columns[j], x) for (i, j), x in found.quadratic.items()]
    if not found.full:
        terms += [(j, i, x) for i, j, x in terms if i != j]
    return _sparse(terms, (len(found.columns), len(found.columns)))


def _sparse(entries: list[tuple[int, int, float]], shape: tuple[int, int]) -> sp.csr_array:
    rows, columns, values = zip(*entries, strict=True) if entries else ((), (), ())
    where: Any = (np.array(values, float), (np.array(rows, int), np.array(columns, int)))
    return sp.csr_array(sp.coo_array(where, shape=shape))


formats.add("mps", MPS())
