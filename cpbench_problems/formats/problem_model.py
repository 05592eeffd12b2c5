"""From a problem to the model (variables, objective, rows, pairs) that text formats write; `model_problem` is the way
back.

A row of a map is an affine or a quadratic function where that reads back as the same operations, else a value of the
map. Variables are named z[1]..., those of an MLCP u[1]... and v[1]...
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.expressions.map import Map
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Sparse, Vector
from cpbench.registry import NodeTable
from cpbench.storage.base import offset
from cpbench_problems.formats.mof_functions import Affine, Function, Functions, Nonlinear, Quadratic
from cpbench_problems.formats.mof_model import Model, ModelRow
from cpbench_problems.formats.plain_rows import PlainRows

CONVEX = " convex"
"""Behind the formulation of an nlp that was said to be convex, in the files of a program."""
MODELS: NodeTable[Callable[[Any, Model], Model]] = NodeTable("model of a text format")
"""Function that fills in the model of a problem, which has its variables z with their start and no bounds."""


def model_of_problem(problem: Any, *, parameters: bool = True) -> Model:
    """Return the model of a problem of a formulation in MODELS. `parameters`: named ones stay parameters of the
    functions; else they are numbers. Raises FormatError where it has a part that no model has.
    """
    n = sum(problem.point_sizes[part] for part in ("z", "u", "v") if part in problem.point_sizes)
    start = getattr(problem, "start", np.zeros(n))
    empty = _over(problem, numbered("z", n), problem.parameters if parameters else {})
    return MODELS[problem.node](problem, replace(empty, start=start))


def formulation_of(problem: Any) -> str:
    """Return what a file says of the formulation of its problem."""
    return f"{problem.node}{CONVEX if problem.node == 'nlp' and problem.convex else ''}"


def numbered(name: str, count: int) -> list[str]:
    """Give the entries of a vector numbers from 1, as JuMP does."""
    return [f"{name}[{i}]" for i in range(1, count + 1)]


def _over(problem: Any, names: Sequence[str], parameters: Mapping[str, float]) -> Model:
    source, n = problem.name or problem.node, len(names)
    functions = Functions(source, {name: k for k, name in enumerate(names)}, parameters)
    lb, ub = np.full(n, -np.inf), np.full(n, np.inf)
    return Model(source, problem.name, "", list(names), lb, ub, np.zeros(n), functions)


@MODELS.of("nlp")
def _nlp(problem: Any, model: Model) -> Model:
    f, g, h = (_rows(model, F) for F in (problem.f, problem.g, problem.h))
    above, equal = ([ModelRow(row, 0.0) for row in rows] for rows in (g, h))
    return replace(model, lb=problem.lb, ub=problem.ub, sense="min", objective=f[0], above=above, equal=equal)


@MODELS.of("ncp", "micp")
def _micp(problem: Any, model: Model) -> Model:
    lb, ub = (problem.lb, problem.ub) if problem.node == "micp" else (np.zeros(len(model.names)), model.ub)
    return _paired(model, _rows(model, problem.F), lb, ub)


@MODELS.of("lcp")
def _lcp(problem: Any, model: Model) -> Model:
    return _paired(model, _affine(problem.M, problem.q), np.zeros(len(model.names)), model.ub)


@MODELS.of("relay", "avi")
def _box(problem: Any, model: Model) -> Model:
    if problem.node == "avi" and not problem.only_box:
        raise model.refused("", f"cannot be written: its set has {problem.b.size + problem.d.size} rows beside the box")
    return _paired(model, _affine(problem.M, problem.q), problem.lb, problem.ub)


@MODELS.of("mlcp")
def _mlcp(problem: Any, model: Model) -> Model:
    n, m = problem.a.size, problem.b.size
    M = matrices.block([[problem.A, problem.C], [problem.D, problem.B]])
    model = _over(problem, [*numbered("u", n), *numbered("v", m)], {})
    lb = np.concatenate([np.full(n, -np.inf), np.zeros(m)])
    return _paired(model, _affine(M, np.concatenate([problem.a, problem.b])), lb, model.ub)


@MODELS.of("qp")
def _qp(problem: Any, model: Model) -> Model:
    columns = list(range(len(model.names)))
    objective = Quadratic(list(_products(problem.Q)), Affine(columns, problem.p.tolist(), offset(problem.info)))
    above, equal = (
        [ModelRow(row, side) for row, side in zip(_affine(M, np.zeros(sides.size)), sides.tolist(), strict=True)]
        for M, sides in ((problem.A, problem.b), (problem.C, problem.d))
    )
    return replace(model, lb=problem.lb, ub=problem.ub, sense="min", objective=objective, above=above, equal=equal)


def _paired(model: Model, rows: Sequence[Function], lb: Vector, ub: Vector) -> Model:
    return replace(model, lb=lb, ub=ub, pairs=dict(enumerate(rows)), complementary=True)


def _rows(model: Model, F: Map) -> list[Function]:
    functions, plain = model.functions, PlainRows(model.functions.build)
    result: list[Function] = []
    for value in functions.take(F):
        simple = plain.function(value)
        result.append(simple if simple is not None and functions.value(simple) == value else Nonlinear(value))
    return result


def _affine(M: Matrix, q: Vector) -> list[Function]:
    """Return the rows of Mz + q, without the entries that are 0."""
    S, rows = _kept(M), list[Function]()
    for i, constant in enumerate(q.tolist()):
        inside = slice(S.indptr[i], S.indptr[i + 1])
        rows.append(Affine(S.indices[inside].tolist(), S.data[inside].tolist(), constant))
    return rows


def _kept(M: Matrix) -> Sparse:
    """Return the entries that are not 0, by rows."""
    rows = sp.csr_array(M, copy=True)
    rows.sum_duplicates()
    rows.eliminate_zeros()
    return rows


def _products(Q: Matrix) -> Iterator[tuple[int, int, float]]:
    """Yield (i, j, coefficient) of the terms of ½zᵀQz."""
    coo = _kept(Q).tocoo()
    entries = dict(zip(zip(coo.row.tolist(), coo.col.tolist(), strict=True), coo.data.tolist(), strict=True))
    for (i, j), value in entries.items():
        mirrored = entries.get((j, i), 0.0)
        if value != mirrored:
            yield i, j, 0.5 * value
            if not mirrored:
                yield j, i, 0.0
        elif i <= j:
            yield i, j, value
