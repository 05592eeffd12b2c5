"""D A⁻¹C over the small components of A: the Delassus operator HᵀM⁻¹H of bodies that touch at contacts.

Every body has its own dense block M_b, and a contact touches one or two of them, so that HᵀM⁻¹H consists of small
dense blocks Σ_b H_biᵀM_b⁻¹H_bj, one for each pair of contacts that share a body. A kernel computes those alone.
Few entries go through SciPy's sparse products instead: that costs less than loading the kernel.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cpbench.foundation.factorization import Blocks, Factorization
from cpbench.foundation.kernel_cache import load
from cpbench.foundation.matrices import Sparse, index_dtype

KERNELS = "cpbench.conversions.kernels.delassus"
PRODUCTS = "cpbench.conversions.kernels.block_products"
FEW = 15_000
"""Entries of D and C up to which SciPy does it."""
SAMPLE = 20
"""Bodies looked at to find how many columns of C belong to one contact."""
PADDING = 1.25
"""Zeros that columns of a contact may add by touching different bodies, as a factor of the entries."""


def product(left: Sparse, factor: Factorization, right: Sparse) -> Sparse:
    """Return left A⁻¹ right over the components in `factor.blocks`."""
    if left.nnz + right.nnz <= FEW:
        return sp.csr_array(left @ (factor.sparse_inverse @ right))
    kernel = load(KERNELS)
    bodies = _Bodies.of(factor.blocks)
    columns = _touching(kernel, right, bodies)
    _over_blocks(kernel.multiply, [b.values for b in factor.block_inverses], columns)
    return _multiplied(_touching(kernel, sp.csr_array(left.T), bodies), columns)


def congruence(H: Sparse, factor: Factorization) -> Sparse | None:
    """Return HᵀA⁻¹H over the components in `factor.blocks`, symmetric to the last bit; A is symmetric.

    None where one is not positive definite, and where H is so small that the kernel does not pay.
    """
    if H.nnz <= FEW:
        return None
    try:
        roots = [np.linalg.cholesky(b.values) for b in factor.blocks]
    except np.linalg.LinAlgError:
        return None
    kernel = load(KERNELS)
    columns = _touching(kernel, H, _Bodies.of(factor.blocks))
    _over_blocks(kernel.substitute, roots, columns)
    return _multiplied(columns, columns)


@dataclass(frozen=True)
class _Bodies:
    """The unknowns of the components one after the other, as the kernel wants them."""

    member: NDArray[np.int64]
    members: NDArray[np.int64]

    @staticmethod
    def of(blocks: list[Blocks]) -> _Bodies:
        sizes = np.concatenate([np.full(len(b.unknowns), b.unknowns.shape[1]) for b in blocks])
        return _Bodies(_cumulative(sizes), np.concatenate([b.unknowns.ravel() for b in blocks]))


@dataclass(frozen=True)
class _Touching:
    """Groups of d columns that every body touches, and the blocks there; see the kernel."""

    d: int
    groups: int
    touch: NDArray[np.int64]
    start: NDArray[np.int64]
    group: NDArray[np.int32]
    values: NDArray[np.float64]


def _touching(kernel: Any, C: Sparse, bodies: _Bodies) -> _Touching:
    k = C.shape[1]
    pattern = (C.indptr, C.indices)
    d = _columns_of_a_contact(k, *kernel.sample_groups(*pattern, bodies.member, bodies.members, SAMPLE))
    group_of = np.repeat(np.arange(k // d, dtype=np.int32), d)
    touch, start = np.zeros((2, bodies.member.size), dtype=np.int64)
    kernel.count_touched(*pattern, bodies.member, bodies.members, group_of, d, touch, start)
    group, values = np.empty(touch[-1], dtype=np.int32), np.zeros(start[-1])
    kernel.gather(*pattern, C.data, bodies.member, bodies.members, group_of, d, touch, start, group, values)
    return _Touching(d, k // d, touch, start, group, values)


def _columns_of_a_contact(k: int, columns: int, pairs: int, triples: int, fives: int) -> int:
    """Return 3 or 2 (friction in space, in the plane), 5 (rolling friction), 1 where there are no such groups."""
    for d, groups in ((3, triples), (2, pairs), (5, fives)):
        if k % d == 0 and d * groups <= PADDING * columns:
            return d
    return 1


def _over_blocks(operation: Any, blocks: list[NDArray[np.float64]], touching: _Touching) -> None:
    first = 0
    for block in blocks:
        operation(block, touching.start, first, touching.values)
        first += len(block)


def _multiplied(rows: _Touching, columns: _Touching) -> Sparse:
    kernel = load(PRODUCTS)
    shape = (rows.groups * rows.d, columns.groups * columns.d)
    by_group = np.zeros(rows.groups + 1, dtype=np.int64)
    body, slot = np.empty(rows.group.size, dtype=np.int32), np.empty(rows.group.size, dtype=np.int64)
    kernel.transpose_touch(rows.touch, rows.group, by_group, body, slot)
    begin = np.zeros(rows.groups + 1, dtype=np.int64)
    count, most = kernel.count_blocks(by_group, body, columns.touch, columns.group, columns.groups, begin)
    entries = count * rows.d * columns.d
    index = index_dtype(entries, *shape)
    indptr, indices, data = np.empty(shape[0] + 1, index), np.empty(entries, index), np.empty(entries)
    zeros = kernel.multiply_blocks(
        *(by_group, body, slot),
        *(rows.touch, rows.group, rows.start, rows.values, rows.d),
        *(columns.touch, columns.group, columns.start, columns.values, columns.d),
        *(begin, columns.groups, most, indptr, indices, data),
    )
    result = sp.csr_array((data, indices, indptr), shape=shape)
    result.has_canonical_format = True
    if zeros:  # where columns of a contact touch different bodies, and where terms cancel
        result.eliminate_zeros()
    return result


def _cumulative(sizes: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.concatenate([[0], np.cumsum(sizes)])
