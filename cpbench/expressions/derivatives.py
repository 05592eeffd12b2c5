"""The Jacobian of a map as data: for who evaluates maps without CasADi."""

from __future__ import annotations

import numpy as np

from cpbench.expressions.map import Index, Map


def derivative(F: Map) -> tuple[Map, Index, Index]:
    """The map to the entries of F′ as a CSR, row by row, and its `indices` and `indptr`."""
    import casadi as ca

    z = ca.SX.sym("z", F.inputs)
    by_rows = ca.jacobian(F.sx(z), z).T
    entries = by_rows.nz[:] if by_rows.nnz() else ca.SX(0, 1)
    indices, indptr = (np.array(part, dtype=np.int64) for part in (by_rows.row(), by_rows.sparsity().colind()))
    return Map.from_casadi(z, entries), indices, indptr
