"""Models of MathOptFormat as nonlinear problems: parts of an NLP, an NCP, a MiCP."""

from __future__ import annotations

from typing import Any

from cpbench.formulations.expressions.from_mof import Affine, Function, Functions, Nonlinear, Quadratic
from cpbench.formulations.expressions.mof_model import Model, ModelRow, read_model
from cpbench.formulations.expressions.operators import Operator

SOURCE = "MathOptFormat"
"""Name in messages of a text that is not a file."""


def program_of(text: bytes | str) -> dict[str, Any]:
    """Read a text as `program` does; raises FormatError."""
    return program(read_model(text, SOURCE))


def complementarity_of(text: bytes | str) -> dict[str, Any]:
    """Read a text as `complementarity` does; raises FormatError."""
    return complementarity(read_model(text, SOURCE))


def program(model: Model) -> dict[str, Any]:
    """Return f, g, h, lb, ub, start of min f(z), g(z) ≥ 0, h(z) = 0, lb ≤ z ≤ ub, rows in the order of the model.

    A maximum is the minimum of the opposite; a model without an objective has f = 0. Raises FormatError.
    """
    if model.complementary:
        raise model.refused("constraints", "has Complements, expected an optimization problem")
    if model.cones:
        raise model.refused("constraints", "has second-order cones beside functions that are not affine")
    functions = model.functions
    objective = model.objective if model.objective is not None else Affine([], [], 0.0)
    return {
        "f": functions.map([_negative(functions, objective) if model.sense == "max" else objective]),
        "g": functions.map([slack(functions, row) for row in model.above]),
        "h": functions.map([slack(functions, row) for row in model.equal]),
        "lb": model.lb,
        "ub": model.ub,
        "start": model.start,
    }


def complementarity(model: Model) -> dict[str, Any]:
    """Return F, lb, ub, start by name, of (F(z), z) in Complements with lb ≤ z ≤ ub.

    Raises FormatError where the model is not a complementarity problem.
    """
    F = model.functions.map(model.beside())
    return {"F": F, "lb": model.lb, "ub": model.ub, "start": model.start}


def slack(functions: Functions, row: ModelRow) -> Function:
    """Return function − side, or side − function."""
    function, side = row.function, row.side
    if isinstance(function, Nonlinear):
        build = functions.build
        if not side:
            return _negative(functions, function) if row.below else function
        sides = (function.value, build.constant(side))
        return Nonlinear(build.apply(Operator.SUB, *(reversed(sides) if row.below else sides)))
    affine = function.affine if isinstance(function, Quadratic) else function
    moved = Affine(affine.columns, affine.values, affine.constant - side)
    shifted = Quadratic(function.products, moved) if isinstance(function, Quadratic) else moved
    return _negative(functions, shifted) if row.below else shifted


def _negative(functions: Functions, function: Function) -> Function:
    if isinstance(function, Nonlinear):
        return Nonlinear(functions.build.apply(Operator.NEG, function.value))
    if isinstance(function, Quadratic):
        return Quadratic([(i, j, -c) for i, j, c in function.products], function.affine.negative())
    return function.negative()
