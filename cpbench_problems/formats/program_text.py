"""Names and numbers of a linear or quadratic program, as the sections of an MPS file have them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

REFUSED: Mapping[str, str] = {
    "SOS": "special ordered sets",
    "SOS1": "special ordered sets",
    "SOS2": "special ordered sets",
    "SETS": "special ordered sets",
    "QCMATRIX": "quadratic constraints",
    "CSECTION": "cones",
    "INDICATORS": "indicator constraints",
    "GENCONS": "general constraints",
    "PWLOBJ": "a piecewise linear objective",
    "LAZYCONS": "lazy constraints",
    "USERCUTS": "user cuts",
    "GROUPS": "groups of SIF, which is more than QPS",
    "VARIABLES": "variables of SIF, which is more than QPS",
}
"""Sections that no quadratic program has."""


@dataclass
class ProgramText:
    """Names and numbers of a file, by section.

    Attributes
    ----------
    rows : name -> G, L or E. free : N rows beside the objective. columns : names, in order. cost : by column.
    entries, quadratic : (row, column) and (column, column) -> number. sides, ranges : by row. lower, upper : by column,
    where given. maximize : the sense of the objective. constant : of the objective. full : whether `quadratic` holds
    both triangles.
    """

    name: str = ""
    objective: str = ""
    rows: dict[str, str] = field(default_factory=dict)
    free: list[str] = field(default_factory=list)
    columns: dict[str, int] = field(default_factory=dict)
    cost: dict[str, float] = field(default_factory=dict)
    entries: dict[tuple[str, str], float] = field(default_factory=dict)
    quadratic: dict[tuple[str, str], float] = field(default_factory=dict)
    sides: dict[str, float] = field(default_factory=dict)
    ranges: dict[str, float] = field(default_factory=dict)
    lower: dict[str, float] = field(default_factory=dict)
    upper: dict[str, float] = field(default_factory=dict)
    maximize: bool = False
    constant: float = 0.0
    full: bool = False
