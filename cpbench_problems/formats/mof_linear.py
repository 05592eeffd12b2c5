"""Linear complementarity problems and quadratic programs as models of MathOptFormat."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.errors import FormatError
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Sparse, Vector
from cpbench.storage.base import offset
from cpbench_problems.formats.mof_write import FEASIBILITY, MODELS, Written, joined, numbered, one_sided


def obstacle(problem: Any) -> str | None:
    """Return why a problem of a formulation that can be written cannot be, None where it can."""
    if problem.node == "avi" and not problem.only_box:
        return f"its set has {problem.b.size + problem.d.size} rows beside the box"
    return None


@MODELS.of("lcp")
def lcp(problem: Any) -> Written:
    n = problem.q.size
    return _complements(problem.M, problem.q, numbered("z", n), np.zeros(n), np.full(n, np.inf))


@MODELS.of("relay", "avi")
def box(problem: Any) -> Written:
    why = obstacle(problem)
    if why is not None:
        raise FormatError(problem.name or "avi", "", f"cannot be written as mof: {why}")
    return _complements(problem.M, problem.q, numbered("z", problem.q.size), problem.lb, problem.ub)


@MODELS.of("mlcp")
def mlcp(problem: Any) -> Written:
    n, m = problem.a.size, problem.b.size
    M = matrices.block([[problem.A, problem.C], [problem.D, problem.B]])
    lb = np.concatenate([np.full(n, -np.inf), np.zeros(m)])
    names = [*numbered("u", n), *numbered("v", m)]
    return _complements(M, np.concatenate([problem.a, problem.b]), names, lb, np.full(n + m, np.inf))


def _complements(M: Any, q: Vector, names: Sequence[str], lb: Vector, ub: Vector) -> Written:
    """Write one constraint: (Mx + q, x) in Complements."""
    F = kept(M)

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

    return Written(names, lb, ub, [FEASIBILITY], rows(), F.nnz)


@MODELS.of("qp")
def qp(problem: Any) -> Written:
    names = numbered("z", problem.p.size)
    A, C = kept(problem.A), kept(problem.C)

    def objective() -> Iterator[str]:
        yield '{"sense": "min", "function": {"type": "ScalarQuadraticFunction", "quadratic_terms": [\n'
        yield from joined(
            (
                f'{{"coefficient": {value!r}, "variable_1": "{names[i]}", "variable_2": "{names[j]}"}}'
                for i, j, value in quadratic(problem.Q)
            ),
            ",\n",
        )
        yield '],\n"affine_terms": ['
        yield from joined(
            f'{{"coefficient": {value!r}, "variable": "{name}"}}'
            for name, value in zip(names, problem.p.tolist(), strict=True)
        )
        yield f'], "constant": {offset(problem.info)!r}}}}}'

    def rows() -> Iterator[str]:
        for label, M, sides, kind, side in (
            ("A", A, problem.b, "GreaterThan", "lower"),
            ("C", C, problem.d, "EqualTo", "value"),
        ):
            for i, value in enumerate(sides.tolist()):
                function = (
                    f'{{"type": "ScalarAffineFunction", "terms": [{", ".join(_terms(M, i, names))}], "constant": 0.0}}'
                )
                yield f'{{"name": "{label}[{i + 1}]", "function": {function}, "set": {one_sided(kind, side, value)}}}'

    return Written(names, problem.lb, problem.ub, objective(), rows(), matrices.nnz(problem.Q) + A.nnz + C.nnz)


def _terms(M: Sparse, row: int, names: Sequence[str]) -> Iterator[str]:
    inside = slice(M.indptr[row], M.indptr[row + 1])
    for j, value in zip(M.indices[inside].tolist(), M.data[inside].tolist(), strict=True):
        yield f'{{"coefficient": {value!r}, "variable": "{names[j]}"}}'


def kept(M: Matrix) -> Sparse:
    """Return the entries that are not 0, by rows."""
    rows = sp.csr_array(M, copy=True)
    rows.sum_duplicates()
    rows.eliminate_zeros()
    return rows


def quadratic(Q: Matrix) -> Iterator[tuple[int, int, float]]:
    """Yield (i, j, coefficient) of the terms of ½zᵀQz."""
    coo = kept(Q).tocoo()
    entries = dict(zip(zip(coo.row.tolist(), coo.col.tolist(), strict=True), coo.data.tolist(), strict=True))
    for (i, j), value in entries.items():
        mirrored = entries.get((j, i), 0.0)
        if value != mirrored:
            yield i, j, 0.5 * value
            if not mirrored:
                yield j, i, 0.0
        elif i <= j:
            yield i, j, value
