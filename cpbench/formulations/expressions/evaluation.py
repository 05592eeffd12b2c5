"""Values and exact sparse derivatives of a map: F(z) = Mz + q + Cφ(z), where only φ is evaluated by its operations.

What a sum adds with constant weights is affine (M, q: SciPy's products) or one of the distinct nonlinear terms φ; the
Laplacian of an obstacle problem thus costs what a sparse product costs, and one exponential a node.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.expressions import derivatives
from cpbench.formulations.expressions.batches import Batches
from cpbench.formulations.expressions.kernels import interpreter
from cpbench.formulations.expressions.map import Index, Map
from cpbench.formulations.expressions.operators import Operator
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Sparse, Vector, freeze


def evaluator(F: Map) -> Callable[[Vector], Vector]:
    """Return z ↦ F(z), by the faster of the two ways."""
    batches = Batches(F)
    return batches if batches.worthwhile else Interpreted(F)


class Interpreted:
    """z ↦ F(z), one operation after the other in machine code."""

    def __init__(self, F: Map) -> None:
        self._run = interpreter.run
        self._operations = freeze(np.column_stack([F.heads, F.left, F.right]))
        self._constants, self._outputs, self._inputs = F.constants, F.outputs, F.inputs
        self._size = max(1, F.inputs + F.constants.size + F.operations)

    def __call__(self, z: Vector) -> Vector:
        held = np.ascontiguousarray(z, dtype=float)
        if held.shape != (self._inputs,):
            raise ValueError(f"the map has {self._inputs} unknowns, the vector has shape {held.shape}")
        result = np.empty(self._outputs.size)
        # work of its own for every call: two threads may ask the same map
        self._run(self._operations, held, self._constants, self._outputs, np.empty(self._size), result)
        return result


_AGAIN = 4
"""How often, on average, an operation may be walked through: sums that are used many times stay whole."""


class Compiled:
    """One map made ready. Attributes: M (m, n) and q (m,) of its affine part, C (m, p) of its p nonlinear terms."""

    def __init__(self, F: Map) -> None:
        self._map = F
        affine, self.q, weights, self._terms = _split(F)
        self.M, self.C = matrices.adopt(affine), matrices.adopt(weights)
        self._all = sp.csr_array(sp.hstack([affine, weights]))

    @property
    def affine(self) -> bool:
        """True if there is no nonlinear term."""
        return not self._terms

    def value(self, z: Vector) -> Vector:
        terms = z if self.affine else np.concatenate([z, self._values(z)])
        return self._all @ terms + self.q

    def jacobian(self, z: Vector) -> Sparse:
        if self.affine:
            return self.M
        return self._jacobian(z)

    def hessian(self, z: Vector, weights: Vector) -> Sparse:
        if self.affine:
            return sp.csr_array((self._map.inputs, self._map.inputs))
        return self._hessian(z, self.C.T @ weights)

    # ------------------------------------------------------------------------------------ made when asked

    @cached_property
    def _phi(self) -> Map:
        return self._map.only(self._terms)

    @cached_property
    def _values(self) -> Callable[[Vector], Vector]:
        return evaluator(self._phi)

    @cached_property
    def _jacobian(self) -> _Jacobian:
        return _Jacobian(self._phi, self.M, self.C)

    @cached_property
    def _hessian(self) -> _Hessian:
        return _Hessian(self._phi)


def _pattern(indices: Index, indptr: Index, shape: tuple[int, int]) -> Sparse:
    """Return the pattern of a derivative, each entry holding its number plus one."""
    return sp.csr_array((np.arange(1.0, indices.size + 1.0), indices, indptr), shape=shape)


class _Jacobian:
    """z ↦ M + Cφ′(z), as one CSR of one pattern."""

    def __init__(self, phi: Map, M: Sparse, C: Sparse) -> None:
        entries, indices, indptr = derivatives.derivative(phi)
        self._entries = evaluator(entries)
        numbered = _pattern(indices, indptr, phi.shape)
        ones = numbered.copy()
        ones.data[:] = 1.0
        pattern = abs(M) + abs(C) @ ones  # no entry of it cancels
        pattern = sp.csr_array((np.ones(pattern.nnz), pattern.indices, pattern.indptr), shape=pattern.shape)
        pattern.sort_indices()
        self._pattern = pattern
        at = sp.csr_array((np.arange(pattern.nnz), pattern.indices, pattern.indptr), shape=pattern.shape)
        self._constant = _spread(at, M)
        weights = _weights(at, C, numbered)
        self._moving = np.flatnonzero(np.diff(weights.indptr))  # the others are constant
        self._weights = weights[self._moving]

    def __call__(self, z: Vector) -> Sparse:
        data = self._constant.copy()
        data[self._moving] += self._weights @ self._entries(z)
        return _shaped(data, self._pattern)


def _shaped(data: Vector, pattern: Sparse) -> Sparse:
    J = sp.csr_array((data, pattern.indices, pattern.indptr), shape=pattern.shape, copy=False)
    J.has_canonical_format = True
    return J


def _places(at: Sparse, rows: Any, columns: Any) -> Any:
    """Return the positions of entries (row, column) in a pattern whose columns are sorted in every row."""
    n = max(at.shape[1], 1)
    keys = np.repeat(np.arange(at.shape[0]), np.diff(at.indptr)) * n + at.indices
    return np.searchsorted(keys, rows * n + columns)


def _spread(at: Sparse, M: Sparse) -> Vector:
    coo = M.tocoo()
    data = np.zeros(at.nnz)
    data[_places(at, coo.row.astype(np.int64), coo.col.astype(np.int64))] = coo.data
    return data


def _weights(at: Sparse, C: Sparse, numbered: Sparse) -> Sparse:
    """Return the matrix that takes entries of φ′ to their sums in the entries of the pattern."""
    coo = C.tocoo()
    lengths = np.diff(numbered.indptr)[coo.col]
    which = np.repeat(np.arange(coo.nnz), lengths)
    offsets = np.arange(lengths.sum()) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    entries = numbered.indptr[coo.col][which] + offsets
    positions = _places(at, coo.row[which].astype(np.int64), numbered.indices[entries].astype(np.int64))
    numbers = numbered.data[entries].astype(np.int64) - 1
    return sp.csr_array((coo.data[which], (positions, numbers)), shape=(at.nnz, numbered.nnz))


class _Hessian:
    """(z, w) ↦ ∇² wᵀφ(z)."""

    def __init__(self, phi: Map) -> None:
        entries, indices, indptr = derivatives.second_derivative(phi)
        self._entries = evaluator(entries)
        self._pattern = _pattern(indices, indptr, (phi.inputs, phi.inputs))

    def __call__(self, z: Vector, weights: Vector) -> Sparse:
        return _shaped(self._entries(np.concatenate([z, weights])), self._pattern)


def _split(F: Map) -> tuple[Sparse, Vector, Sparse, list[int]]:
    """Return M, q, C and the numbers of the nonlinear terms."""
    first = F.inputs + F.constants.size
    heads, left, right = F.heads.tolist(), F.left.tolist(), F.right.tolist()
    constants = F.constants.tolist()
    q = np.zeros(F.rows)
    M: list[tuple[float, int, int]] = []
    C: list[tuple[float, int, int]] = []
    term: dict[int, int] = {}
    used = np.bincount(np.concatenate([F.left, F.right[F.right >= 0], F.outputs]), minlength=first + F.operations)
    once = (used <= 1).tolist()
    budget = _AGAIN * F.operations
    for row, end in enumerate(F.outputs.tolist()):
        stack = [(end, 1.0)]
        while stack:
            value, weight = stack.pop()
            if value < F.inputs:
                M.append((weight, row, value))
                continue
            if value < first:
                q[row] += weight * constants[value - F.inputs]
                continue
            k = value - first
            inner = _summands(heads[k], left[k], right[k], F.inputs, constants) if once[value] or budget > 0 else None
            if inner is None:
                C.append((weight, row, term.setdefault(value, len(term))))
            else:
                budget -= not once[value]
                stack.extend((a, weight * factor) for a, factor in inner)
    return _assembled(M, (F.rows, F.inputs)), q, _assembled(C, (F.rows, len(term))), list(term)


def _assembled(entries: list[tuple[float, int, int]], shape: tuple[int, int]) -> Sparse:
    """Assemble the matrix of (value, row, column); entries of one place add up, and those that cancel are dropped."""
    table = np.array(entries, dtype=float).reshape(-1, 3)
    where = (table[:, 1].astype(np.int64), table[:, 2].astype(np.int64))
    result = sp.csr_array((table[:, 0], where), shape=shape)
    result.eliminate_zeros()
    return result


def _summands(head: int, a: int, b: int, inputs: int, constants: list[float]) -> list[tuple[int, float]] | None:
    """Return (value, factor) of the terms that an operation adds up, None where a factor is not constant."""
    first = inputs + len(constants)
    if head == Operator.ADD:
        return [(a, 1.0), (b, 1.0)]
    if head == Operator.SUB:
        return [(a, 1.0), (b, -1.0)]
    if head == Operator.NEG:
        return [(a, -1.0)]
    if head == Operator.MUL and inputs <= a < first:
        return [(b, constants[a - inputs])]
    if head in (Operator.MUL, Operator.DIV) and inputs <= b < first:
        factor = constants[b - inputs]
        if head == Operator.MUL:
            return [(a, factor)]
        return [(a, 1.0 / factor)] if factor else None
    return None
