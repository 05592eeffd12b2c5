"""Models as text in MathOptFormat.

Every row is a function of its own, as simple as it reads back; rows of one kind are one vector where they share so
much that this would be far longer. The constant of a row is in its set, as JuMP wants it.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence

import numpy as np

from cpbench_problems.formats import to_mof
from cpbench_problems.formats.mof_functions import Affine, Function, Nonlinear, Quadratic
from cpbench_problems.formats.mof_model import Model, ModelRow


def variables(model: Model) -> Iterator[str]:
    """Yield the variables with their starts that are not 0, which a reader takes for a start that is not given."""
    for name, start in zip(model.names, model.start.tolist(), strict=True):
        given = f', "primal_start": {start!r}' if start or np.signbit(start) else ""
        yield f'{{"name": "{name}"{given}}}'
    for name in model.functions.parameters:
        yield json.dumps({"name": name})


def objective(model: Model) -> str:
    if model.objective is None:
        return '{"sense": "feasibility"}'
    functions = _scalars(model, [model.objective])
    assert functions is not None  # one row shares with no other
    return f'{{"sense": "{model.sense}", "function": {functions[0]}}}'


def constraints(model: Model, labels: Sequence[str]) -> Iterator[str]:
    """Yield the bounds, then the pairs or the rows, which are named by labels: inequalities, then equations."""
    yield from _bounds(model)
    if model.pairs:
        whole = [*model.pairs.values(), *(Affine([k], [1.0], 0.0) for k in model.pairs)]
        yield _constraint("complementarity", _vector(model, whole), f'"Complements", "dimension": {len(whole)}')
    kinds = (("GreaterThan", "lower", "Nonnegatives"), ("EqualTo", "value", "Zeros"))
    for rows, label, (kind, side, cone) in zip((model.above, model.equal), labels, kinds, strict=True):
        functions = [row.function for row in rows]
        texts = _scalars(model, functions)
        if texts is None:
            yield _constraint(label, _vector(model, functions), f'"{cone}", "dimension": {len(rows)}')
            continue
        for k, (row, text) in enumerate(zip(rows, texts, strict=True), 1):
            yield _constraint(f"{label}[{k}]", text, f'"{kind}", "{side}": {_side(row)!r}')


def _bounds(model: Model) -> Iterator[str]:
    """Yield two constraints where a variable has two bounds, without names: JuMP finds no interval, and
    MathOptInterface allows no names here.
    """
    for kind, side, values in (("GreaterThan", "lower", model.lb), ("LessThan", "upper", model.ub)):
        for name, value in zip(model.names, values.tolist(), strict=True):
            if np.isfinite(value):
                bound = f'{{"type": "{kind}", "{side}": {value!r}}}'
                yield f'{{"function": {{"type": "Variable", "name": "{name}"}}, "set": {bound}}}'
    for name, value in model.functions.parameters.items():
        function, set_ = {"type": "Variable", "name": name}, {"type": "Parameter", "value": value}
        yield json.dumps({"function": function, "set": set_})


def _constraint(name: str, function: str, set_: str) -> str:
    return f'{{"name": "{name}", "function": {function}, "set": {{"type": {set_}}}}}'


def _side(row: ModelRow) -> float:
    constant = _affine_part(row.function).constant
    return row.side - constant if constant else row.side


def _affine_part(function: Function) -> Affine:
    if isinstance(function, Nonlinear):
        return Affine([], [], 0.0)
    return function.affine if isinstance(function, Quadratic) else function


def _scalars(model: Model, functions: Sequence[Function]) -> list[str] | None:
    """Return each function, of a row without its constant; None where nonlinear ones share too much."""
    curved = to_mof.scalars(model.functions.map([f for f in functions if isinstance(f, Nonlinear)]), model.names)
    if curved is None:
        return None
    rest = iter(curved)
    return [
        json.dumps(next(rest), allow_nan=False) if isinstance(f, Nonlinear) else _simple(f, model) for f in functions
    ]


def _simple(function: Affine | Quadratic, model: Model) -> str:
    affine, names = _affine_part(function), model.names
    constant = affine.constant if function is model.objective else 0.0
    terms = f"[{', '.join(_terms(affine, names))}]"
    if isinstance(function, Affine):
        return f'{{"type": "ScalarAffineFunction", "terms": {terms}, "constant": {constant!r}}}'
    products = ",\n".join(
        f'{{"coefficient": {c!r}, "variable_1": "{names[i]}", "variable_2": "{names[j]}"}}'
        for i, j, c in function.products
    )
    return (
        f'{{"type": "ScalarQuadraticFunction", "quadratic_terms": [{products}],\n"affine_terms": {terms}, '
        f'"constant": {constant!r}}}'
    )


def _terms(affine: Affine, names: Sequence[str]) -> Iterator[str]:
    for k, c in zip(affine.columns, affine.values, strict=True):
        yield f'{{"coefficient": {c!r}, "variable": "{names[k]}"}}'


def _vector(model: Model, functions: Sequence[Function]) -> str:
    """Return all functions as one, affine where all are."""
    affine = [f for f in functions if isinstance(f, Affine)]
    if len(affine) < len(functions):
        return json.dumps(to_mof.vector(model.functions.map([*functions]), model.names), allow_nan=False)
    terms = ",\n".join(
        f'{{"output_index": {i}, "scalar_term": {term}}}'
        for i, row in enumerate(affine, 1)
        for term in _terms(row, model.names)
    )
    constants = ", ".join(repr(row.constant) for row in affine)
    return f'{{"type": "VectorAffineFunction", "terms": [\n{terms}],\n"constants": [{constants}]}}'
