"""MathOptFormat (JSON, schema 1.x), which JuMP and MathOptInterface read.

lcp    variables z[1]...z[n] ≥ 0; the vector (Mz + q, z) in Complements(2n)
mlcp   u[1]... free, v[1]... ≥ 0; (Au + Cv + a, Du + Bv + b, u, v) in Complements: what stands beside a free one is 0
relay  z between its bounds; (Mz + q, z) in Complements; so is an avi whose set is a box
qp     min ½zᵀQz + pᵀz; rows A[1]... ≥ b, rows C[1]... = d; bounds of z
ncp    (F(z), z) in Complements, z ≥ 0; micp: z between its bounds
nlp    min f(z); rows g[1]... ≥ 0, rows h[1]... = 0; bounds of z

In a quadratic function the coefficient of a pair i ≠ j is that of zᵢzⱼ, that of (i, i) is twice that of zᵢ², so that
both are entries of Q; where rounding has made Qᵢⱼ and Qⱼᵢ different, there are two terms, with half of each. Nonlinear
functions are read back bit for bit (`to_mof`); starts are the variables' `primal_start`; a parameter of a
map is one more variable, in Parameter(value), of the name it has. The description begins with the formulation
(`cpbench lcp: ...`); a file without that becomes what its functions and bounds say (`model_problem`). Second-order
cones, plain and rotated, are read and not written.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np

from cpbench.errors import FormatError
from cpbench.formulations.base import Point, Problem, formulations
from cpbench.formulations.contact import ContactProblem
from cpbench.formulations.nonlinear import Equation
from cpbench.storage.base import Format, formats, no_member, read_bytes, read_head
from cpbench_problems.formats import to_mof
from cpbench_problems.formats.model_problem import problem_of
from cpbench_problems.formats.mof_functions import Affine, Function, Nonlinear, Quadratic
from cpbench_problems.formats.mof_model import Model, ModelRow, read_model
from cpbench_problems.formats.problem_model import CONVEX, MODELS, formulation_of, model_of_problem
from cpbench_problems.formats.to_mof import MINOR

SUFFIX = ".mof.json"
LARGEST = 5_000_000
"""Coefficients or operations beyond which a file would take gigabytes; HDF5 takes matrices of any size."""
MARK = "cpbench "
"""Beginning of the description of a written file, the formulation after it."""
LARGEST_FILE = 1 << 30
"""Bytes of a file that is looked into; one of a third of that is refused for what it would take in memory."""


class MOF(Format):
    name = "mof"
    summary = "MathOptFormat 1.x (JSON), as JuMP reads it: complementarity problems, quadratic and nonlinear programs"
    suffixes = (SUFFIX,)
    writes = frozenset(MODELS)

    def recognises(self, path: Path, head: bytes) -> bool:
        return path.name.lower().endswith(SUFFIX)

    def why_not(self, node: str) -> str:
        kind = formulations.get(node)
        if issubclass(kind, ContactProblem):
            return "a cone with friction is none of MathOptFormat's sets"
        if issubclass(kind, Equation):
            return "MathOptFormat has optimization and complementarity; an equation is a micp without bounds"
        if not kind.has_maps():
            return ""
        return (
            "MathOptFormat has complementarity between bounds alone (Complements): convert it to micp, where it can be"
        )

    def load(self, path: Path, member: str) -> Problem:
        no_member(path, member)
        model = read_model(_content(path), path)
        description = model.description
        formulation = description.removeprefix(MARK).partition(":")[0] if description.startswith(MARK) else ""
        node = formulation.removesuffix(CONVEX)
        name = model.name or path.name.removesuffix(".json").removesuffix(".mof")
        # names in a file of cpbench are those of the parts of its own formulations
        names = () if description.startswith(MARK) else model.names
        return problem_of(model, path, name, node, convex=formulation == f"nlp{CONVEX}", names=names)

    def write(self, problem: Problem, file: BinaryIO, *, compress: bool, guesses: Sequence[Point] = ()) -> None:
        for part in text(problem):
            file.write(part.encode())


def _content(path: Path) -> bytes:
    read_head(path)
    size = path.stat().st_size
    if size > LARGEST_FILE:
        raise FormatError(path, "", f"has {size / 1e9:.1f} GB, at most {LARGEST_FILE / 1e9:.1f} are read")
    return read_bytes(path)


def text(problem: Problem) -> Iterator[str]:
    """Yield the file in pieces; raises FormatError when it would be too large, or the set of an avi is not a box."""
    model = model_of_problem(problem)
    functions = [*model.pairs.values(), *(row.function for row in (*model.above, *model.equal))]
    entries = sum(len(function.columns) for function in functions if isinstance(function, Affine))
    entries += len(model.objective.products) if isinstance(model.objective, Quadratic) else 0
    entries += sum(F.operations for F in problem.maps().values())
    if entries > LARGEST:
        raise FormatError(model.source, "", f"has {entries} coefficients or operations, too many: use .h5")
    described = f"{MARK}{formulation_of(problem)}: {', '.join(problem.relations)}"
    named = f'"name": {json.dumps(problem.name)},\n' if problem.name else ""
    version = f'{{"major": 1, "minor": {MINOR if problem.has_maps() else 0}}}'
    yield f'{{"version": {version},\n{named}"description": {json.dumps(described)},\n"variables": ['
    yield ", ".join(variables(model))
    yield f'],\n"objective": {objective(model)},\n"constraints": [\n'
    yield ",\n".join(constraints(model, ("g", "h") if problem.has_maps() else ("A", "C")))
    yield "\n]}\n"


formats.add("mof", MOF())


# -------------------------------------------------------------------------------------------------------------- writing
# Models as text in MathOptFormat.
#
# Every row is a function of its own, as simple as it reads back; rows of one kind are one vector where they share so
# much that this would be far longer. The constant of a row is in its set, as JuMP wants it.


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
