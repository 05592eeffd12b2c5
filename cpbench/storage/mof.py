"""MathOptFormat (JSON, schema 1.x), which JuMP and MathOptInterface read: linear complementarity problems and QPs.

lcp    variables z[1]...z[n] ≥ 0; the vector (Mz + q, z) in Complements(2n)
mlcp   u[1]... free, v[1]... ≥ 0; (Au + Cv + a, Du + Bv + b, u, v) in Complements: what stands beside a free one is 0
relay  z between its bounds; (Mz + q, z) in Complements; so is an avi whose set is a box
qp     min ½zᵀQz + pᵀz; rows A[1]... ≥ b, rows C[1]... = d; bounds of z

In a quadratic function the coefficient of a pair i ≠ j is that of zᵢzⱼ, that of (i, i) is twice that of zᵢ², so that
both are entries of Q; where rounding has made Qᵢⱼ and Qⱼᵢ different, there are two terms, with half of each. The
description begins with the formulation; a file without that becomes what its bounds say (`mof_read`).
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, ClassVar

import numpy as np
import scipy.sparse as sp

from cpbench import matrices
from cpbench.errors import FormatError
from cpbench.formulations.base import Problem
from cpbench.matrices import Matrix, Sparse, Vector
from cpbench.storage import mof_read
from cpbench.storage.base import Format, formats, no_member

SUFFIX = ".mof.json"
VERSION = '{"major": 1, "minor": 0}'
"""Every version since has what is written here, so that old readers take it too."""
LARGEST = 5_000_000
"""Coefficients beyond which a file would take gigabytes; HDF5 takes them."""


@dataclass(frozen=True)
class _Model:
    """The parts of a file: names of the variables with their bounds, the objective, the other constraints."""

    names: Sequence[str]
    lb: Vector
    ub: Vector
    objective: Iterable[str]
    rows: Iterable[str]
    entries: int


class MOF(Format):
    name = "mof"
    summary = "MathOptFormat 1.x (JSON), as JuMP reads it: linear complementarity and quadratic programs"
    suffixes = (SUFFIX,)
    writes = frozenset({"lcp", "mlcp", "relay", "avi", "qp"})
    why_not: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("fc", "fcm", "gfc", "rfc", "grfc", "afc"), "a cone with friction is none of MathOptFormat's sets"
    )

    def recognises(self, path: Path, head: bytes) -> bool:
        return path.name.lower().endswith(SUFFIX)

    def load(self, path: Path, member: str) -> Problem:
        no_member(path, member)
        return mof_read.read(path)

    def write(self, problem: Problem, file: BinaryIO, *, compress: bool) -> None:
        for part in text(problem):
            file.write(part.encode())


def obstacle(problem: Any) -> str | None:
    """Why a problem of a formulation that can be written cannot be, None where it can."""
    if problem.node == "avi" and not problem.only_box:
        return f"its set has {problem.b.size + problem.d.size} rows beside the box"
    return None


def text(problem: Problem) -> Iterator[str]:
    """The file in pieces; raises FormatError when it would be too large, or the set of an avi is no box."""
    model = _MODELS[problem.node](problem)
    if model.entries > LARGEST:
        raise FormatError(problem.name or problem.node, "", f"has {model.entries} coefficients, too many: use .h5")
    described = f"{mof_read.MARK}{problem.node}: {', '.join(problem.relations)}"
    named = f'"name": {json.dumps(problem.name)},\n' if problem.name else ""
    yield f'{{"version": {VERSION},\n{named}"description": {json.dumps(described)},\n"variables": ['
    yield from _joined(f'{{"name": "{name}"}}' for name in model.names)
    yield '],\n"objective": '
    yield from model.objective
    yield ',\n"constraints": [\n'
    yield from _joined((*_bounds(model), *model.rows), ",\n")
    yield "\n]}\n"


def _lcp(problem: Any) -> _Model:
    n = problem.q.size
    return _complements(problem.M, problem.q, _numbered("z", n), np.zeros(n), np.full(n, np.inf))


def _box(problem: Any) -> _Model:
    why = obstacle(problem)
    if why is not None:
        raise FormatError(problem.name or "avi", "", f"cannot be written as mof: {why}")
    return _complements(problem.M, problem.q, _numbered("z", problem.q.size), problem.lb, problem.ub)


def _mlcp(problem: Any) -> _Model:
    n, m = problem.a.size, problem.b.size
    M = matrices.block([[problem.A, problem.C], [problem.D, problem.B]])
    lb = np.concatenate([np.full(n, -np.inf), np.zeros(m)])
    names = [*_numbered("u", n), *_numbered("v", m)]
    return _complements(M, np.concatenate([problem.a, problem.b]), names, lb, np.full(n + m, np.inf))


def _complements(M: Any, q: Vector, names: Sequence[str], lb: Vector, ub: Vector) -> _Model:
    """One constraint: (Mx + q, x) in Complements."""
    F = _kept(M)

    def rows() -> Iterator[str]:
        if not names:
            return  # a set has a dimension of 2 at least
        terms = (
            f'{{"output_index": {i + 1}, "scalar_term": {term}}}'
            for i in range(len(names))
            for term in _terms(F, i, names)
        )
        themselves = (
            f'{{"output_index": {len(names) + i}, "scalar_term": {{"coefficient": 1.0, "variable": "{name}"}}}}'
            for i, name in enumerate(names, 1)
        )
        constants = ", ".join(map(repr, [*q.tolist(), *[0.0] * len(names)]))
        yield (
            '{"name": "complementarity", "function": {"type": "VectorAffineFunction", "terms": [\n'
            + ",\n".join((*terms, *themselves))
            + f'],\n"constants": [{constants}]}}, "set": {{"type": "Complements", "dimension": {2 * len(names)}}}}}'
        )

    return _Model(names, lb, ub, ['{"sense": "feasibility"}'], rows(), F.nnz)


def _qp(problem: Any) -> _Model:
    names = _numbered("z", problem.p.size)
    A, C = _kept(problem.A), _kept(problem.C)

    def objective() -> Iterator[str]:
        yield '{"sense": "min", "function": {"type": "ScalarQuadraticFunction", "quadratic_terms": [\n'
        yield from _joined(
            (
                f'{{"coefficient": {value!r}, "variable_1": "{names[i]}", "variable_2": "{names[j]}"}}'
                for i, j, value in _quadratic(problem.Q)
            ),
            ",\n",
        )
        yield '],\n"affine_terms": ['
        yield from _joined(
            f'{{"coefficient": {value!r}, "variable": "{name}"}}'
            for name, value in zip(names, problem.p.tolist(), strict=True)
        )
        yield f'], "constant": {mof_read.offset(problem.info)!r}}}}}'

    def rows() -> Iterator[str]:
        for label, M, sides, kind, side in (
            ("A", A, problem.b, "GreaterThan", "lower"),
            ("C", C, problem.d, "EqualTo", "value"),
        ):
            for i, value in enumerate(sides.tolist()):
                function = (
                    f'{{"type": "ScalarAffineFunction", "terms": [{", ".join(_terms(M, i, names))}], "constant": 0.0}}'
                )
                yield f'{{"name": "{label}[{i + 1}]", "function": {function}, "set": {_set(kind, side, value)}}}'

    return _Model(names, problem.lb, problem.ub, objective(), rows(), matrices.nnz(problem.Q) + A.nnz + C.nnz)


_MODELS: Mapping[str, Callable[[Any], _Model]] = {"lcp": _lcp, "mlcp": _mlcp, "relay": _box, "avi": _box, "qp": _qp}


def _bounds(model: _Model) -> Iterator[str]:
    """Two constraints where a variable has two bounds: JuMP finds these, but not an interval. They have no names:
    MathOptInterface allows none."""
    for kind, side, values in (("GreaterThan", "lower", model.lb), ("LessThan", "upper", model.ub)):
        for name, value in zip(model.names, values.tolist(), strict=True):
            if np.isfinite(value):
                yield f'{{"function": {{"type": "Variable", "name": "{name}"}}, "set": {_set(kind, side, value)}}}'


def _set(kind: str, side: str, value: float) -> str:
    return f'{{"type": "{kind}", "{side}": {value!r}}}'


def _terms(M: Sparse, row: int, names: Sequence[str]) -> Iterator[str]:
    inside = slice(M.indptr[row], M.indptr[row + 1])
    for j, value in zip(M.indices[inside].tolist(), M.data[inside].tolist(), strict=True):
        yield f'{{"coefficient": {value!r}, "variable": "{names[j]}"}}'


def _kept(M: Matrix) -> Sparse:
    """The entries that are not 0, by rows."""
    rows = sp.csr_array(M, copy=True)
    rows.sum_duplicates()
    rows.eliminate_zeros()
    return rows


def _quadratic(Q: Matrix) -> Iterator[tuple[int, int, float]]:
    """(i, j, coefficient) of the terms of ½zᵀQz."""
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


def _numbered(name: str, count: int) -> list[str]:
    """As JuMP names the entries of a vector: from 1."""
    return [f"{name}[{i}]" for i in range(1, count + 1)]


def _joined(parts: Iterable[str], between: str = ", ") -> Iterator[str]:
    for k, part in enumerate(parts):
        yield f"{between}{part}" if k else part


formats.add("mof", MOF())
