"""Nonlinear maps made of matrices, maps that a trace keeps, and simple sets S = {z ∈ K : lb ≤ z ≤ ub} that are boxes or
cones: what edges to and from the nonlinear nodes share."""

from __future__ import annotations

import itertools
from collections.abc import Iterable

import numpy as np

from cpbench.formulations.base import Trace
from cpbench.formulations.expressions import Builder, Map, Operator
from cpbench.formulations.expressions.map import LARGEST
from cpbench.formulations.variational import SimpleSetProblem
from cpbench.foundation import matrices
from cpbench.foundation.cones import Cone, ProductCone
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


def no_box(problem: SimpleSetProblem, instead: str) -> str | None:
    """Return the message that a factor of K is not a box, with its kind; else None."""
    if problem.only_box:
        return None
    kind = problem.K.kind
    at = int(np.flatnonzero(~np.isin(kind, (Cone.ZERO, Cone.FREE, Cone.NONNEGATIVE)))[0])
    return f"factor {at} of K is a {_name(kind[at])}, which is no box; use {instead}"


def no_cone(problem: SimpleSetProblem) -> str | None:
    """Return the message that S is not a cone, with the bound or the factor that makes it none; else None."""
    kind = problem.K.kind
    round_ = np.flatnonzero(np.isin(kind, (Cone.CYLINDER, Cone.BALL)))
    if round_.size:
        return f"factor {round_[0]} of K is a {_name(kind[round_[0]])}, which is not a cone"
    lb, ub = problem.lb, problem.ub
    bad = np.flatnonzero((np.isfinite(lb) & (lb != 0.0)) | (np.isfinite(ub) & (ub != 0.0)))
    if bad.size:
        i = int(bad[0])
        return f"{bad.size} components have bounds that are not 0, the first is {i} with [{lb[i]:g}, {ub[i]:g}]"
    above = np.flatnonzero((ub == 0.0) & (lb < 0.0))
    if above.size:
        return f"{above.size} components are bounded from above alone, the first is {above[0]}, which no factor says"
    return None


def as_cone(problem: SimpleSetProblem) -> ProductCone:
    """Return S, which is a cone, as a product: components of free factors that have the bounds 0 become {0} and ℝ₊."""
    K, parts = problem.K, []
    bounded = np.where(problem.ub == 0.0, Cone.ZERO, np.where(problem.lb == 0.0, Cone.NONNEGATIVE, Cone.FREE))
    at = 0
    for kind, size, mu, mu_r in zip(K.kind, K.size.astype(int).tolist(), K.mu, K.mu_r, strict=True):
        if kind == Cone.FREE:
            kinds = bounded[at : at + size]
            ends = [0, *(np.flatnonzero(np.diff(kinds)) + 1).tolist(), size] if size else [0]
            parts += [(Cone(int(kinds[a])), 1, b - a) for a, b in itertools.pairwise(ends)]
        else:
            parts.append((Cone(int(kind)), 1, size, mu, mu_r))
        at += size
    return ProductCone.of(*parts)


def _name(kind: float) -> str:
    return Cone(int(kind)).name.lower().replace("_", "-")
