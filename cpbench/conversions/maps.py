"""Nonlinear maps made of matrices, and maps that a trace keeps: what edges to and from the nonlinear nodes share."""

from __future__ import annotations

from collections.abc import Iterable

from cpbench.formulations.base import Trace
from cpbench.formulations.expressions import Builder, Map, Operator
from cpbench.formulations.expressions.map import LARGEST
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Vector


def affine(M: Matrix, q: Vector) -> Map:
    """Return z ↦ Mz + q; zeros that M stores are left out."""
    build = Builder(M.shape[1])
    return build.finish(affine_rows(build, M, q))


def affine_rows(build: Builder, M: Matrix, q: Vector) -> Iterable[int]:
    """Return the numbers of (Mz + q)ᵢ, row by row, in a map that is being built; z are its first unknowns."""
    M = matrices.sparse(M)
    columns, values, ends = M.indices.tolist(), M.data.tolist(), M.indptr.tolist()
    for i, constant in enumerate(q.tolist()):
        total = -1
        for j, value in zip(columns[ends[i] : ends[i + 1]], values[ends[i] : ends[i + 1]], strict=True):
            if value:
                term = j if value == 1.0 else build.apply(Operator.MUL, build.constant(value), j)
                total = term if total < 0 else build.apply(Operator.ADD, total, term)
        if total < 0:
            total = build.constant(constant)
        elif constant:
            total = build.apply(Operator.ADD, total, build.constant(constant))
        yield total


def too_large(*parts: Matrix) -> str | None:
    """Return the message that a map of these matrices would have too many operations; else None."""
    operations = sum(3 * matrices.nnz(M) for M in parts)
    if operations <= LARGEST:
        return None
    return (
        f"a map of it has up to {operations} operations and constants, at most {LARGEST}; use its matrices as they are"
    )


def curved(F: Map, name: str) -> str | None:
    """Return the message that F is not affine, with the number of its nonlinear terms; else None."""
    if F.compiled.affine:
        return None
    return f"{name} is not affine: it has {F.compiled.C.shape[1]} nonlinear terms"


def kept(F: Map) -> Trace:
    """Return F as numbers and arrays, for a trace."""
    return {"inputs": F.inputs, **F.arrays()}


def restored(trace: Trace) -> Map:
    """Return the map that `kept` was given."""
    return Map(**trace)
