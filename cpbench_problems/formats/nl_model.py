"""The model that the segments of an .nl file describe; its variables are named v0, v1, ..."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from cpbench.errors import FormatError
from cpbench_problems.formats.mof_functions import Affine, Function, Nonlinear, Quadratic
from cpbench_problems.formats.mof_model import Model, ModelRow, slack
from cpbench_problems.formats.nl_segments import LinearTerms, Segments
from cpbench_problems.formats.plain_rows import PlainRows


def model_of(path: Path, segments: Segments, quadratic: bool) -> Model:
    """Return the model; `quadratic`: an objective that is quadratic becomes that. Raises FormatError."""
    model = Model(
        source=path,
        name="",
        description="",
        names=[f"v{k}" for k in range(segments.header.variables)],
        lb=np.array([low for low, _ in segments.bounds], float),
        ub=np.array([high for _, high in segments.bounds], float),
        start=segments.start,
        functions=segments.functions,
        complementary=bool(segments.beside),
    )
    beside = {row: column for column, (row, _) in segments.beside.items()}
    for row in range(segments.header.constraints):
        function = _function(segments, segments.rows[row], segments.linear.get(row, []), quadratic=False)
        if row in beside:
            _pair(path, model, segments, beside[row], function)
        else:
            model.constrain(function, *segments.sides[row])
    if segments.objective is not None:
        model.sense, value = segments.objective
        model.objective = _function(segments, value, segments.gradient, quadratic)
    return model


def _function(segments: Segments, value: int, linear: LinearTerms, quadratic: bool) -> Function:
    """Return a row: affine where its expression is a number."""
    build = segments.functions.build
    columns, values = [column for column, _ in linear], [c for _, c in linear]
    number = build.number(value)
    if number is not None and (number or math.copysign(1.0, number) > 0):
        return Affine(columns, values, number)
    plain = PlainRows(build).function(value) if quadratic else None
    if isinstance(plain, Quadratic):
        affine = plain.affine
        return Quadratic(plain.products, Affine(affine.columns + columns, affine.values + values, affine.constant))
    return Nonlinear(segments.sum(value, [term for term in linear if term[1]]))


def _pair(path: Path, model: Model, segments: Segments, column: int, function: Function) -> None:
    """Add a pair whose flags have to say which bounds the variable has."""
    row, flags = segments.beside[column]
    low, high = model.lb[column], model.ub[column]
    bounds = 1 * bool(np.isfinite(low)) + 2 * bool(np.isfinite(high))
    if bounds != flags and low != high:
        raise FormatError(
            path,
            f"r, row {row + 1}",
            f"is complementary to v{column} by {flags}, and {low:g} <= v{column} <= {high:g} is kind {bounds}",
        )
    model.pairs[column] = slack(segments.functions, ModelRow(function, 0.0))
