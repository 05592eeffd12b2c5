"""One row of 3×3 blocks times a vector: where most of the time of a sweep is.

A block lies by columns, and `blocks` has a number more than it needs: compiled, a column is read into a register of
four lanes (`_vector_lanes`).
"""

from cpbench.foundation import kernels


def row_product(first, last, column, blocks, r):
    """Return (u0, u1, u2) = Σ_k B_k r[column_k] over first ≤ k < last.

    first, last : uint64. column : uint32 array. r : float64 array, all contiguous. blocks : 9 numbers each, column
    after column, and one more in the end.
    """
    u0 = u1 = u2 = 0.0
    for k in range(int(first), int(last)):
        j, b = 3 * int(column[k]), 9 * k
        u0 += blocks[b] * r[j] + blocks[b + 3] * r[j + 1] + blocks[b + 6] * r[j + 2]
        u1 += blocks[b + 1] * r[j] + blocks[b + 4] * r[j + 1] + blocks[b + 7] * r[j + 2]
        u2 += blocks[b + 2] * r[j] + blocks[b + 5] * r[j + 1] + blocks[b + 8] * r[j + 2]
    return u0, u1, u2


def fetch(array, index):
    """Have the cache line of array[index] brought near, where this is compiled; any index may be asked for."""


if kernels.compiler is not None:
    from cpbench_solvers.kernels import _vector_lanes

    row_product, fetch = _vector_lanes.row_product, _vector_lanes.fetch
