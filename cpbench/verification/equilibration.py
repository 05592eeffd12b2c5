"""Scaling of a problem's matrix that is the same in all units.

D and C are the least-squares solution of log A_ij + log D_i + log C_j = 0 over the entries (Curtis and Reid 1972).
Other than scalings by the largest entry of each row, it follows a change of units: in units u_i of row i, D_i becomes
D_i/u_i. Entries that stay far below 1 once scaled, rounding mostly, lose their weight.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.matrices import Vector

ROUNDS = 4
STEPS = 200
LOG_2 = float(np.log(2.0))
BITS = 0.01
"""Conjugate gradients end where rows are off by less in the root mean square: sizes are compared, no digits."""


def equilibrate(K: Any) -> Vector:
    """D of a symmetric CSR matrix of nonnegative entries, so that D_i K_ij D_j are about 1; 1 for an empty row."""
    D, C = equilibrate_apart(K)
    return np.sqrt(D) * np.sqrt(C)


def equilibrate_apart(A: Any) -> tuple[Vector, Vector]:
    """D and C of the rows and the columns of a CSR matrix of nonnegative entries, so that D_i A_ij C_j are about 1."""
    A = A if A.data.all() else _without_zeros(A)
    rows = np.repeat(np.arange(A.shape[0]), np.diff(A.indptr))
    logs = np.log2(A.data)
    W = sp.csr_array((np.ones(logs.size), A.indices, A.indptr), shape=A.shape)
    d, e = np.zeros(A.shape[0]), np.zeros(A.shape[1])
    for i in range(ROUNDS):
        if i:
            residuals = logs + d[rows]
            residuals += e[A.indices]
            residuals *= LOG_2
            W.data = np.exp(np.minimum(residuals, 0.0, out=residuals), out=residuals)
        d, e, steps = _least_squares(W, sp.csr_array((W.data * logs, A.indices, A.indptr), shape=A.shape), d)
        if not steps:
            break
    return np.exp2(d), np.exp2(e)


def _without_zeros(A: Any) -> Any:
    A = A.copy()
    A.eliminate_zeros()
    return A


def _least_squares(W: Any, weighted: Any, d: Vector) -> tuple[Vector, Vector, int]:
    """The d and e with the least Σ W_ij (l_ij + d_i + e_j)², `weighted` being W_ij l_ij, and the steps that it took.

    e is eliminated; conjugate gradients find d from a first guess, scaled by the diagonal.
    """
    transposed = W.T
    every_row, every_column = np.ones(W.shape[0]), np.ones(W.shape[1])  # products take a tenth of the time of `sum`
    beside_rows, beside_columns = W @ every_column, transposed @ every_row
    per_row, per_column = (np.divide(1.0, s, out=np.zeros_like(s), where=s > 0) for s in (beside_rows, beside_columns))
    of_columns = weighted.T @ every_row

    def opposite(d: Vector, constant: Vector | float = 0.0) -> Vector:
        return -per_column * (transposed @ d + constant)

    e = opposite(d, of_columns)
    r = -(weighted @ every_column + beside_rows * d + W @ e)
    enough, p, old, step = BITS**2 * beside_rows.sum(), np.zeros(d.size), 1.0, 0
    for step in range(STEPS):
        z = per_row * r
        new = float(r @ z)
        if new <= enough:
            break
        p = z if not step else z + (new / old) * p
        q = opposite(p)
        Ap = beside_rows * p + W @ q
        curvature = float(p @ Ap)
        if curvature <= 0:  # nothing is left but rounding
            break
        alpha = new / curvature
        d, e, r, old = d + alpha * p, e + alpha * q, r - alpha * Ap, new
    return d, e, step
