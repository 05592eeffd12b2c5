"""Pieces of MathOptFormat's text, which all kinds of models are written with."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cpbench.foundation.matrices import Vector
from cpbench.registry import NodeTable
from cpbench_problems.formats import to_mof

FEASIBILITY = '{"sense": "feasibility"}'


@dataclass(frozen=True)
class Written:
    """The parts of a file: names of the variables with their bounds and starts, the objective, the other constraints.

    `entries` : about how many coefficients or operations. `minor` : of the version from which on readers take it; every
    later one has what is written here. `remark` : stands behind the formulation in the description. `parameters` :
    values by name.
    """

    names: Sequence[str]
    lb: Vector
    ub: Vector
    objective: Iterable[str]
    rows: Iterable[str]
    entries: int
    start: Vector | None = None
    minor: int = 0
    remark: str = ""
    parameters: Mapping[str, float] = field(default_factory=dict)

    def variables(self) -> Iterator[str]:
        """Yield the variables with their starts that are not 0, which a reader takes for a start that is not given."""
        starts = [0.0] * len(self.names) if self.start is None else self.start.tolist()
        for name, start in zip(self.names, starts, strict=True):
            given = f', "primal_start": {start!r}' if start or np.signbit(start) else ""
            yield f'{{"name": "{name}"{given}}}'
        for name in self.parameters:
            yield json.dumps({"name": name})

    def bounds(self) -> Iterator[str]:
        """Yield two constraints where a variable has two bounds, without names: JuMP finds no interval, and
        MathOptInterface allows no names here.
        """
        for kind, side, values in (("GreaterThan", "lower", self.lb), ("LessThan", "upper", self.ub)):
            for name, value in zip(self.names, values.tolist(), strict=True):
                if np.isfinite(value):
                    bound = one_sided(kind, side, value)
                    yield f'{{"function": {{"type": "Variable", "name": "{name}"}}, "set": {bound}}}'
        for name, value in self.parameters.items():
            yield json.dumps(to_mof.parameter(name, value))


MODELS: NodeTable[Callable[[Any], Written]] = NodeTable("model of MathOptFormat")
"""Function that makes the parts of a file of a problem."""


def one_sided(kind: str, side: str, value: float) -> str:
    return f'{{"type": "{kind}", "{side}": {value!r}}}'


def numbered(name: str, count: int) -> list[str]:
    """Give the entries of a vector numbers from 1, as JuMP does."""
    return [f"{name}[{i}]" for i in range(1, count + 1)]


def joined(parts: Iterable[str], between: str = ", ") -> Iterator[str]:
    for k, part in enumerate(parts):
        yield f"{between}{part}" if k else part
