"""From a model (variables, objective, rows, pairs) that some format describes to the problem that it is.

A model with pairs of functions and variables is a complementarity problem. Its formulation is the one that is asked
for; without that its functions and bounds decide. Affine functions: all in [0, ∞) lcp; free or in [0, ∞) mlcp, the free
ones first; all finite relay; else avi. Others: all in [0, ∞) ncp, else micp. Any other model is a qp, where its rows
are affine and its objective is affine or quadratic: its variables z, rows in the order of the file, Ax ≥ b and, with
the signs turned, Ax ≤ b; else an nlp, with g(z) ≥ 0 in the same way. A maximum is the minimum of the opposite. A
program with second-order cones is a coneqp: its equations, then its rows and bounds that are ≥ 0, then the cones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.base import Info, Problem
from cpbench.formulations.conic import ConeQP, cone_fields
from cpbench.formulations.linear import AVI, LCP, MLCP, Relay
from cpbench.formulations.nonlinear import NCP, MiCP
from cpbench.formulations.programs import NLP, QP
from cpbench.foundation import matrices
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.foundation.matrices import Sparse, Vector
from cpbench.storage.base import NOTE, OFFSET, SENSE, UNKNOWNS, build
from cpbench_problems.formats.mof_functions import Affine, Nonlinear, Quadratic
from cpbench_problems.formats.mof_model import Model, ModelRow, negative, slack
from cpbench_problems.formats.squares import unmatched

_PROGRAMS = (QP.node, NLP.node, ConeQP.node)


def problem_of(
    model: Model, path: Path, name: str, node: str = "", convex: bool = False, names: Sequence[str] = ()
) -> Problem:
    """Return the problem that a model is: of the formulation `node` where it fits; `convex` is said of an nlp. `names`
    are those of the variables, kept for answers; () where there are none.

    Raises FormatError.
    """
    problem = _made(model, path, name, node, convex)
    properties = dict(problem.info.properties)
    if model.sense == "max":
        properties[SENSE] = "max"
    if names:
        first = _free(model) if problem.node == "mlcp" else np.ones(len(names), bool)
        order = [*np.flatnonzero(first).tolist(), *np.flatnonzero(~first).tolist()]
        properties[UNKNOWNS] = [names[k] for k in order]
    problem = replace(problem, info=replace(problem.info, properties=properties))
    note = unmatched(problem)
    return replace(problem, info=replace(problem.info, properties={**properties, NOTE: note})) if note else problem


def _free(model: Model) -> Any:
    return np.isinf(model.lb) & np.isinf(model.ub)


def _made(model: Model, path: Path, name: str, node: str, convex: bool) -> Problem:
    pairs = model.complementary or (node and node not in _PROGRAMS and not model.names)
    curved = node == "nlp" or not model.affine or isinstance(model.objective, Nonlinear)
    for k in np.flatnonzero(model.lb > model.ub).tolist():
        if pairs or curved:
            cause = f"has the bounds {model.lb[k]:g} and {model.ub[k]:g}: no number is between, there is no solution"
            raise model.refused(model.names[k], cause)
        model.uncross(k)
    if pairs:
        return _complementarity(model, path, name, node)
    if curved:
        return build(path, NLP, "", name=name, convex=convex, **program(model))
    return _coneqp(model, path, name) if model.cones else _qp(model, path, name)


def _complementarity(model: Model, path: Path, name: str, node: str) -> Problem:
    functions, lb, ub = model.beside(), model.lb, model.ub
    free = _free(model)
    half = (lb == 0) & np.isinf(ub)
    if node in ("ncp", "micp") or not model.affine:
        parts = complementarity(model)
        if half.all() and node != "micp":
            return build(path, NCP, "", name=name, F=parts["F"], start=parts["start"])
        return build(path, MiCP, "", name=name, **parts)
    M, _ = _matrix([ModelRow(function, 0.0) for function in functions], len(model.names))
    q = np.array([cast("Affine", function).constant for function in functions], float)
    fits = {
        LCP.node: half.all(),
        MLCP.node: (free | half).all() and (np.diff(free.astype(int)) <= 0).all(),
        Relay.node: np.isfinite(lb).all() and np.isfinite(ub).all(),
        AVI.node: True,
    }
    if not fits.get(node, False):
        node = "mlcp" if (free | half).all() else "avi"
        node = next((kind for kind in ("lcp", "relay") if fits[kind]), node)
    if node == "mlcp":
        first, rest = np.flatnonzero(free), np.flatnonzero(~free)
        blocks = {"A": (first, first), "C": (first, rest), "D": (rest, first), "B": (rest, rest)}
        parts = {part: M[rows][:, columns] for part, (rows, columns) in blocks.items()}
        return build(path, MLCP, "", name=name, a=q[first], b=q[rest], **parts)
    if node == "lcp":
        return build(path, LCP, "", name=name, M=M, q=q)
    return build(path, Relay if node == "relay" else AVI, "", name=name, M=M, q=q, lb=lb, ub=ub)


def _qp(model: Model, path: Path, name: str) -> Problem:
    A, b = _matrix(model.above, len(model.names))
    C, d = _matrix(model.equal, len(model.names))
    parts = {"A": A, "b": b, "C": C, "d": d, "lb": model.lb, "ub": model.ub}
    return build(path, QP, "", name=name, **_objective(model), **parts)


def _coneqp(model: Model, path: Path, name: str) -> Problem:
    n = len(model.names)
    low, high = np.flatnonzero(np.isfinite(model.lb)), np.flatnonzero(np.isfinite(model.ub))
    unit = sp.eye_array(n, format="csr")
    cones = [_matrix([ModelRow(value, 0.0) for value in cone], n) for cone in model.cones]
    blocks = [_matrix(model.equal, n), _matrix(model.above, n)]
    blocks += [(unit[low], model.lb[low]), (-unit[high], -model.ub[high]), *cones]
    signed = len(model.above) + low.size + high.size
    factors = ((Cone.ZERO, 1, len(model.equal)), (Cone.NONNEGATIVE, 1, signed))
    K = ProductCone.of(
        *(factor for factor in factors if factor[2]), *((Cone.SECOND_ORDER, 1, len(cone), 1.0) for cone in model.cones)
    )
    A = sp.csr_array(sp.vstack([rows for rows, _ in blocks]))
    b = -np.concatenate([sides for _, sides in blocks])
    return build(path, ConeQP, "", name=name, **_objective(model), A=A, b=b, **cone_fields(K))


def _objective(model: Model) -> dict[str, Any]:
    """Return Q, p and info of the objective, of which a maximum is turned."""
    n = len(model.names)
    objective = model.objective or Affine([], [], 0.0)
    products = objective.products if isinstance(objective, Quadratic) else []
    affine = objective.affine if isinstance(objective, Quadratic) else cast("Affine", objective)
    sign = -1.0 if model.sense == "max" else 1.0
    p = np.zeros(n)
    _add(p, affine)
    properties = {OFFSET: sign * affine.constant} if affine.constant else {}
    return {"Q": sign * _hessian(products, n), "p": sign * p, "info": Info(properties=properties)}


def _matrix(rows: Sequence[ModelRow], n: int) -> tuple[Sparse, Vector]:
    """Return affine rows as M and b of Mz ≥ b, or = b."""
    turned = [cast("Affine", row.function).negative() if row.below else cast("Affine", row.function) for row in rows]
    lengths = [len(function.columns) for function in turned]
    columns = [column for function in turned for column in function.columns]
    values = [value for function in turned for value in function.values]
    where: Any = (np.array(values, float), (np.repeat(np.arange(len(rows)), lengths), np.array(columns, int)))
    sides = [(-row.side if row.below else row.side) - f.constant for row, f in zip(rows, turned, strict=True)]
    return sp.csr_array(where, shape=(len(rows), n)), np.array(sides, float)


def _hessian(products: Sequence[tuple[int, int, float]], n: int) -> Sparse:
    """Return Q from the coefficients of zᵢzⱼ and zᵢ²/2; a pair given both ways has half each, unless far from
    symmetric.
    """
    terms: dict[tuple[int, int], float] = {}
    for i, j, value in products:
        terms[i, j] = terms.get((i, j), 0.0) + value
    entries = {
        pair: 2.0 * value if pair[0] != pair[1] and pair[::-1] in terms else value for pair, value in terms.items()
    }
    entries |= {pair[::-1]: value for pair, value in terms.items() if pair[::-1] not in terms}
    i, j = [pair[0] for pair in entries], [pair[1] for pair in entries]
    where: Any = (np.array(list(entries.values()), float), (np.array(i, int), np.array(j, int)))
    Q = sp.csr_array(where, shape=(n, n))
    return Q if matrices.is_symmetric(Q, 1e-9) else sp.csr_array(0.5 * Q + 0.5 * Q.T)


def _add(p: Vector, affine: Affine) -> None:
    """Add the terms of a row to a vector; the first one as it is, with the sign of its zero."""
    seen: set[int] = set()
    for column, value in zip(affine.columns, affine.values, strict=True):
        p[column] = p[column] + value if column in seen else value
        seen.add(column)


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
        "f": functions.map([negative(functions, objective) if model.sense == "max" else objective]),
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
