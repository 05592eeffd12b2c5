"""A model in MathOptFormat (JSON, schema 1.x), whatever problem it may be: variables, an objective, rows, and pairs of
functions and variables that stand beside each other in Complements.

Bounds are constraints of a bare variable. Read are the sets GreaterThan, LessThan, EqualTo, Interval, Parameter,
Nonnegatives, Nonpositives, Zeros, HyperRectangle, Complements, SecondOrderCone and RotatedSecondOrderCone; a model with
any other is refused. A variable in Parameter is a parameter of the maps where there are any; in a linear or quadratic
program it is a fixed variable. A vector (t, u, x) is in the rotated cone, 2tu ≥ ‖x‖² with t, u ≥ 0, where
(t + u/2, t − u/2, x) is in the other; this rounds nothing but sums.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cpbench.errors import FormatError
from cpbench.formulations.expressions.operators import Operator
from cpbench.foundation.matrices import Vector
from cpbench.foundation.text import some_of
from cpbench_problems.formats.mof_functions import Affine, Function, Functions, Nonlinear, Quadratic
from cpbench_problems.formats.mof_json import Fields, parse, shown

_SIDES: dict[str, tuple[str | float, str | float]] = {
    "GreaterThan": ("lower", math.inf),
    "LessThan": (-math.inf, "upper"),
    "EqualTo": ("value", "value"),
    "Parameter": ("value", "value"),
    "Interval": ("lower", "upper"),
    "Nonnegatives": (0.0, math.inf),
    "Nonpositives": (-math.inf, 0.0),
    "Zeros": (0.0, 0.0),
    "HyperRectangle": ("lower", "upper"),
}
"""Lower and upper side of a set: a field of it, or a number."""
MPCC = (
    "a program with complementarity constraints (MPCC), of which cpbench has no formulation; without its objective it "
    "is a complementarity problem"
)
_CONES = {"SecondOrderCone": 1, "RotatedSecondOrderCone": 2}
"""Sets of vectors, with the least number of values."""
SETS = f"{', '.join((*_SIDES, *_CONES))} and Complements"


@dataclass(frozen=True)
class ModelRow:
    """function ≥ side, or ≤ side where it is `below`; in an equation `below` says nothing."""

    function: Function
    side: float
    below: bool = False


@dataclass
class Model:
    """Contents of a text, in the order of its variables.

    Attributes
    ----------
    lb, ub, start : (n,) bounds, infinite where there are none, and starting values, 0 where none is given.
    sense : min, max or feasibility, which has no `objective`.
    above, equal : rows. pairs : variable -> the function beside it in Complements.
    complementary : whether there is a constraint in Complements. cones : vectors (t, x) with t ≥ ‖x‖.
    functions : what all functions are values of.
    """

    source: str | Path
    name: str
    description: str
    names: list[str]
    lb: Vector
    ub: Vector
    start: Vector
    functions: Functions
    sense: str = "feasibility"
    objective: Function | None = None
    above: list[ModelRow] = field(default_factory=list)
    equal: list[ModelRow] = field(default_factory=list)
    pairs: dict[int, Function] = field(default_factory=dict)
    complementary: bool = False
    cones: list[list[Affine]] = field(default_factory=list)

    @property
    def affine(self) -> bool:
        """True if everything but the objective is affine. False where there are parameters, which no matrix keeps."""
        if self.functions.parameters:
            return False
        rows = (row.function for row in (*self.above, *self.equal))
        return all(isinstance(function, Affine) for function in (*rows, *self.pairs.values()))

    def constrain(self, function: Function, low: float, high: float) -> None:
        """Add the rows of low ≤ function ≤ high."""
        if low == high:
            self.equal.append(ModelRow(function, low))
            return
        self.above += [ModelRow(function, low)] if low > -math.inf else []
        self.above += [ModelRow(function, high, below=True)] if high < math.inf else []

    def uncross(self, k: int) -> None:
        """Make a row of an upper bound that is below the lower one: nothing satisfies both, and that is proved."""
        self.constrain(Affine([k], [1.0], 0.0), -math.inf, float(self.ub[k]))
        self.ub[k] = math.inf

    def refused(self, where: str, cause: str) -> FormatError:
        return FormatError(self.source, where, cause)

    def beside(self) -> list[Function]:
        """Return the functions of a complementarity problem, each beside its variable; raises FormatError for another
        model.
        """
        if self.sense != "feasibility":
            raise self.refused("objective", f"is {self.sense} beside Complements: {MPCC}")
        rows = len(self.above) + len(self.equal) + len(self.cones)
        if rows:
            raise self.refused("constraints", f"has {rows} rows beside Complements")
        alone = [shown(name) for k, name in enumerate(self.names) if k not in self.pairs]
        if alone:
            raise self.refused("constraints", f"has no function beside {some_of(alone, 3)}")
        return [self.pairs[k] for k in range(len(self.names))]


def read_model(text: bytes | str, source: str | Path) -> Model:
    """Read the model in a text; `source` is what messages name. Raises FormatError."""
    raw = text.encode("utf-8", "replace") if isinstance(text, str) else text
    return _Reader(source, parse(raw, source)).model


class _Reader:
    def __init__(self, source: str | Path, model: dict[str, Any]) -> None:
        fields = self._fields = Fields(source)
        version = fields.get(model, "version", dict, "")
        if version.get("major") != 1:
            raise fields.refused("version", f"is {shown(version.get('major'))}, cpbench reads MathOptFormat 1")
        values = parameters(fields, model) if _has_maps(model) else {}
        names = [name for name in fields.names(model) if name not in values]
        starts = [
            fields.number(variable, "primal_start", f"variables/{k}") if "primal_start" in variable else 0.0
            for k, variable in enumerate(model["variables"])
            if variable["name"] not in values
        ]
        n = len(names)
        self._functions = Functions(source, {name: k for k, name in enumerate(names)}, values)
        self.model = Model(
            source=source,
            name=_text(model, "name"),
            description=_text(model, "description"),
            names=names,
            lb=np.full(n, -np.inf),
            ub=np.full(n, np.inf),
            start=np.array(starts),
            functions=self._functions,
        )
        self._objective(fields.get(model, "objective", dict, ""))
        for k, constraint in fields.items(model, "constraints"):
            if parameter_of(constraint) not in values:
                self._constrain(constraint, f"constraints/{k}")

    def _objective(self, objective: dict[str, Any]) -> None:
        fields, model = self._fields, self.model
        model.sense = fields.get(objective, "sense", str, "objective")
        if model.sense not in ("min", "max", "feasibility"):
            raise fields.refused("objective/sense", f"is '{shown(model.sense)}', expected min, max or feasibility")
        if model.sense != "feasibility":
            function = fields.get(objective, "function", dict, "objective")
            model.objective = self._functions.scalar(function, "objective/function")

    def _constrain(self, constraint: Any, where: str) -> None:
        fields = self._fields
        function, set_ = (fields.get(constraint, key, dict, where) for key in ("function", "set"))
        kind = fields.get(set_, "type", str, f"{where}/set")
        if kind not in _SIDES and kind not in _CONES and kind != "Complements":
            raise fields.refused(f"{where}/set", f"is {shown(kind)}, cpbench reads {SETS}")
        rows = self._functions.rows(function, f"{where}/function")
        size = set_.get("dimension", len(rows))
        if size != len(rows):
            raise fields.refused(f"{where}/set", f"has dimension {shown(size)}, its function {len(rows)} values")
        if kind == "Complements":
            self._complement(rows, where)
            return
        if kind in _CONES:
            self._cone(kind, rows, where)
            return
        low, high = (self._side(set_, side, len(rows), f"{where}/set") for side in _SIDES[kind])
        bare = function["type"] in ("Variable", "VectorOfVariables")
        for row, least, most in zip(rows, low, high, strict=True):
            if bare and isinstance(row, Affine):
                if row.columns[0] >= len(self.model.names):
                    raise fields.refused(where, "bounds a parameter")
                self._bound(row.columns[0], least, most)
            else:
                self.model.constrain(row, least, most)

    def _cone(self, kind: str, rows: list[Function], where: str) -> None:
        """Add a vector in a second-order cone, or in a rotated one."""
        affine = [row.affine if isinstance(row, Quadratic) and not row.products else row for row in rows]
        values = [row for row in affine if isinstance(row, Affine)]
        if len(values) < len(rows):
            raise self._fields.refused(f"{where}/function", f"is not affine, expected affine values in {kind}")
        if len(values) < _CONES[kind]:
            raise self._fields.refused(where, f"has {len(values)} values in {kind}, expected {_CONES[kind]} at least")
        if kind == "RotatedSecondOrderCone":
            t, u = values[:2]
            half = Affine(u.columns, [0.5 * value for value in u.values], 0.5 * u.constant)
            values[:2] = [t.plus(half), t.plus(half.negative())]
        self.model.cones.append(values)

    def _side(self, set_: Any, side: str | float, rows: int, where: str) -> Sequence[float]:
        """Return a side of a set, for each of its rows."""
        fields = self._fields
        if not isinstance(side, str):
            return [side] * rows
        if isinstance(set_.get(side), list):
            values = [fields.finite(value, f"{where}/{side}/{k}") for k, value in enumerate(set_[side])]
            if len(values) != rows:
                raise fields.refused(f"{where}/{side}", f"has {len(values)} numbers, expected {rows}")
            return values
        return [fields.number(set_, side, where)] * rows

    def _bound(self, column: int, low: float, high: float) -> None:
        lb, ub = self.model.lb, self.model.ub
        if low > lb[column]:
            lb[column] = low
        if high < ub[column]:
            ub[column] = high

    def _complement(self, rows: list[Function], where: str) -> None:
        """Add functions, followed by as many variables."""
        model, fields = self.model, self._fields
        model.complementary = True
        if len(rows) % 2:
            raise fields.refused(where, f"has {len(rows)} values in Complements, expected an even number")
        half = len(rows) // 2
        for row, itself in zip(rows[:half], rows[half:], strict=True):
            column = self._functions.bare(itself)
            if column is None:
                raise fields.refused(where, "has no bare variable in the second half of Complements")
            if column in model.pairs:
                raise fields.refused(where, f"has {shown(model.names[column])} beside two functions")
            model.pairs[column] = row


def _has_maps(model: dict[str, Any]) -> bool:
    """Return whether a model becomes a problem with maps if it has parameters: it has Complements or a nonlinear
    function.
    """
    objective, constraints = model.get("objective"), model.get("constraints")
    parts = [objective, *(constraints if isinstance(constraints, list) else [])]
    kinds = [
        part[key].get("type")
        for part in parts
        for key in ("function", "set")
        if isinstance(part, dict) and isinstance(part.get(key), dict)
    ]
    return any(kind in ("Complements", "ScalarNonlinearFunction", "VectorNonlinearFunction") for kind in kinds)


def _text(model: dict[str, Any], key: str) -> str:
    """Return a text of the model, "" where there is none; characters that no file could be written with are
    replaced.
    """
    value = model.get(key, "")
    return value.encode("utf-8", "replace").decode() if isinstance(value, str) else ""


def slack(functions: Functions, row: ModelRow) -> Function:
    """Return function − side, or side − function."""
    function, side = row.function, row.side
    if isinstance(function, Nonlinear):
        build = functions.build
        if not side:
            return negative(functions, function) if row.below else function
        sides = (function.value, build.constant(side))
        return Nonlinear(build.apply(Operator.SUB, *(reversed(sides) if row.below else sides)))
    affine = function.affine if isinstance(function, Quadratic) else function
    moved = Affine(affine.columns, affine.values, affine.constant - side)
    shifted = Quadratic(function.products, moved) if isinstance(function, Quadratic) else moved
    return negative(functions, shifted) if row.below else shifted


def negative(functions: Functions, function: Function) -> Function:
    if isinstance(function, Nonlinear):
        return Nonlinear(functions.build.apply(Operator.NEG, function.value))
    if isinstance(function, Quadratic):
        return Quadratic([(i, j, -c) for i, j, c in function.products], function.affine.negative())
    return function.negative()


def parameter_of(constraint: Any) -> str | None:
    """Return the variable that a constraint declares to be a parameter, None where it is another constraint."""
    function, set_ = (constraint.get(key) if isinstance(constraint, dict) else None for key in ("function", "set"))
    if not (isinstance(function, dict) and isinstance(set_, dict)):
        return None
    fits = set_.get("type") == "Parameter" and function.get("type") == "Variable"
    return function["name"] if fits and isinstance(function.get("name"), str) else None


def parameters(fields: Fields, model: Any) -> dict[str, float]:
    """Return the parameters of a model, with their values; raises FormatError."""
    result: dict[str, float] = {}
    for k, constraint in fields.items(model, "constraints"):
        name = parameter_of(constraint)
        if name is None:
            continue
        if name in result:
            raise fields.refused(f"constraints/{k}", f"has a second value for the parameter '{shown(name)}'")
        result[name] = fields.number(constraint["set"], "value", f"constraints/{k}/set")
    return result
