"""The parts of a problem that may be left out, and the problem without them.

A part is a contact with its rows, a body with its degrees of freedom, a factor of a cone, an unknown or a row of
constraints. What is left out is held at a value: of Mz + q, z = (x, y) with y held at v, there remains
M_xx x + (q_x + M_xy v). At the values of a solution what is left has the rest of that solution, and at 0 the data that
remain are those of the problem.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cpbench.errors import NotApplicable
from cpbench.formulations.base import Info, Problem
from cpbench.formulations.expressions import Map
from cpbench.formulations.expressions.recording import MapRecorder
from cpbench.foundation import matrices
from cpbench.foundation.cones import Cone
from cpbench.foundation.matrices import Matrix, Vector

P = TypeVar("P", bound=Problem)
Index = NDArray[np.int64]
ALONE = (Cone.ZERO, Cone.FREE, Cone.NONNEGATIVE)
"""Cones whose rows may be left out one by one."""


@dataclass(frozen=True, eq=False)
class RemovablePart:
    """Indices that leave a problem together. places : dimension symbol -> indices of it."""

    name: str
    places: Mapping[str, Index]


def _symbol(dimension: str) -> str:
    """Return the symbol of a dimension such as n, 2n or 1."""
    return dimension.lstrip("0123456789")


def _cone_symbol(problem: Any) -> str:
    """Return the dimension whose rows the cones of a conic node are over; empty where it has none."""
    name = getattr(type(problem), "cone_rows", "")
    return problem.shapes()[name][0] if name else ""


def kinds(problem: Problem) -> dict[str, list[RemovablePart]]:
    """Return what may be left out, by kind, in the order in which it is tried."""
    law: Any = problem
    found: dict[str, list[RemovablePart]] = {}
    sizes, taken = problem.sizes(), set[str]()
    if hasattr(law, "rows_of"):
        d, rows = law.dimension, problem.shapes()[law.rows_of][0]
        found["contact"] = [_part("contact", {"nc": [c], rows: range(d * c, d * c + d)}) for c in range(law.nc)]
        taken |= {"nc", rows}
        if "n" in sizes and not problem.has_maps():
            found["body"] = [_part("body", {"n": group}) for group in _bodies(law.M)]
            if len(found["body"]) < sizes["n"]:
                found["degree of freedom"] = [_part("degree of freedom", {"n": [i]}) for i in range(sizes["n"])]
            taken.add("n")
    cone = _cone_symbol(problem)
    if cone:
        found["factor"] = list(_factors(law, cone))
        taken |= {cone, *problem.shapes()["cone_kind"]}
    names = {"n": "unknown", "m": "unknown" if problem.node == "mlcp" else "row"}
    for symbol, size in sizes.items():
        if symbol not in taken and size:
            found[f"{names.get(symbol, 'row')} of {symbol}"] = [_part(symbol, {symbol: [i]}) for i in range(size)]
    return {kind: parts for kind, parts in found.items() if parts}


def _part(name: str, places: Mapping[str, Any]) -> RemovablePart:
    return RemovablePart(name, {symbol: np.asarray(list(where), np.int64) for symbol, where in places.items()})


def _bodies(M: Matrix) -> Iterator[list[int]]:
    """Yield the degrees of freedom that the mass matrix connects; a diagonal one has bodies of one each."""
    count, label = sp.csgraph.connected_components(matrices.sparse(M), directed=False)
    for body in range(count):
        yield np.flatnonzero(label == body).tolist()


def _factors(problem: Any, symbol: str) -> Iterator[RemovablePart]:
    start = 0
    for kind, size in zip(problem.cone_kind, problem.cone_size.astype(int), strict=True):
        rows = range(start, start + size)
        yield from (_part("row", {symbol: [i]}) for i in rows) if kind in ALONE else [_part("factor", {symbol: rows})]
        start += size


# ------------------------------------------------------------------------------------------- the rest


def without(problem: P, parts: Sequence[RemovablePart], values: Any = None) -> P:
    """Return the problem without some parts, which are held at their values in a point, or at 0; raises ProblemError.

    What was known of the problem is left out: its origin, the way it was made and what its contacts are.
    """
    sizes = problem.sizes()
    gone = {symbol: np.zeros(size, dtype=bool) for symbol, size in sizes.items()}
    for part in parts:
        for symbol, where in part.places.items():
            gone[symbol][where] = True
    changed: dict[str, Any] = {}
    cone = _cone_symbol(problem)
    if cone:
        runs = _runs(problem, ~gone[cone])
        gone[problem.shapes()["cone_kind"][0]][:] = False
    keep = {symbol: np.flatnonzero(~dropped) for symbol, dropped in gone.items()}
    own, data = problem.shapes(), problem.data()
    for name, shape in own.items():
        if name not in data:
            changed[name] = _map(problem.maps()[name], shape, keep, gone, _held(problem, values))
        elif len(shape) == 2:
            changed[name] = _block(data[name], *(keep.get(symbol) for symbol in shape))
        else:
            changed[name] = np.asarray(data[name])[keep[shape[0]]] if shape[0] in keep else data[name]
    if values is not None:
        for vector, term in _loads(problem, keep, gone, values):
            changed[vector] = changed[vector] + term
    if cone:
        changed |= runs  # pyright: ignore[reportPossiblyUnboundVariable]
    return bare(problem, changed)


def square(problem: Problem) -> tuple[str, str] | None:
    """Return the matrix and the vector of w = Mz + q, None where the rows of the formulation are not that alone."""
    terms = [(name, vector) for vector, sign, name, _ in problem.terms if sign == 1]
    return terms[0] if len(terms) == len(problem.terms) == 1 else None


def condensed(problem: P, parts: Sequence[RemovablePart]) -> P:
    """Return the problem without parts whose rows are eliminated as equations: M_xx − M_xy M_yy⁻¹ M_yx in place of
    M_xx. The rest of a solution stays one where w is 0 in the parts, as in contacts that stick.

    Raises CpbenchError where the formulation has no such form or the rows do not determine the parts.
    """
    names = square(problem)
    if names is None:
        raise NotApplicable("condensed", f"{problem.node} is not w = Mz + q alone")
    M, q = matrices.dense(problem.data()[names[0]]), np.asarray(problem.data()[names[1]])
    gone = np.zeros(q.size, dtype=bool)
    for part in parts:
        gone[part.places[problem.shapes()[names[1]][0]]] = True
    try:
        solved = np.linalg.solve(M[np.ix_(gone, gone)], np.column_stack([M[np.ix_(gone, ~gone)], q[gone]]))
    except np.linalg.LinAlgError:
        raise NotApplicable("condensed", "the rows that are left out do not determine their unknowns") from None
    rest = without(problem, parts)
    coupling = M[np.ix_(~gone, gone)]
    S = M[np.ix_(~gone, ~gone)] - coupling @ solved[:, :-1]
    if np.array_equal(M, M.T):
        S = (S + S.T) / 2
    return bare(rest, {names[0]: S, names[1]: q[~gone] - coupling @ solved[:, -1]})


def bare(problem: P, changed: Mapping[str, Any]) -> P:
    """Return the problem with other data and nothing that was known of it."""
    forgotten = {name: None for name in ("contacts", "sequence") if hasattr(problem, name)}
    plain = {"name": "reduced", "info": Info(), "provenance": ()}
    return dataclasses.replace(problem, **{**plain, **forgotten, **changed})


def _block(M: Matrix, rows: Index | None, columns: Index | None) -> Matrix:
    taken: Any = M if rows is None else M[rows]
    return taken if columns is None else taken[:, columns]


def _loads(
    problem: Problem, keep: Mapping[str, Index], gone: Mapping[str, Any], values: Any
) -> Iterator[tuple[str, Vector]]:
    """Yield what is held at values adds to the vectors of the data."""
    own = problem.shapes()
    for vector, sign, name, part in problem.terms:
        M: Any = getattr(problem, name[0])
        rows, columns = own[name[0]]
        if name.endswith("ᵀ"):
            M, rows, columns = M.T, columns, rows
        held = np.flatnonzero(gone[columns])
        if held.size:
            yield vector, sign * (_block(sp.csr_array(M), keep[rows], held) @ getattr(values, part)[held])


def _held(problem: Problem, values: Any) -> Vector:
    """Return the values of the unknowns of the maps: the first part of a point."""
    first, size = next(iter(problem.point_sizes.items()))
    return np.zeros(size) if values is None else getattr(values, first)


def _map(F: Map, shape: tuple[str, ...], keep: Mapping[str, Index], gone: Mapping[str, Any], values: Vector) -> Map:
    """Return the map of the unknowns that are kept to the rows that are kept."""
    (rows, columns), n = shape, F.inputs
    left = keep.get(_symbol(columns), np.arange(n))
    count = n // max(gone[_symbol(columns)].size, 1) if _symbol(columns) in gone else 1

    record = MapRecorder(count * left.size)
    whole = np.empty(n, dtype=object)
    whole[:] = np.tile(values, count)[:n]
    for copy in range(count):
        whole[copy * (n // count) + left] = record.z[copy * left.size : (copy + 1) * left.size]
    return record.map(record(F, whole)[keep[rows] if rows in keep else slice(None)])


def _runs(problem: Any, kept: NDArray[np.bool_]) -> dict[str, Vector]:
    """Return the fields of the cones over the rows that are kept."""
    sizes = problem.cone_size.astype(int)
    ends = np.cumsum(sizes)
    left = np.array([kept[end - size : end].sum() for size, end in zip(sizes, ends, strict=True)], dtype=float)
    names = ("cone_kind", "cone_mu", "cone_mu_r")
    there = left > 0
    return {"cone_size": left[there], **{name: np.asarray(getattr(problem, name))[there] for name in names}}
