"""Symmetric scaling of a problem's matrix that is the same in all units.

D is the least-squares solution of log|K_ij| + log D_i + log D_j = 0 over the entries (Curtis and Reid 1972, symmetric).
Other than scalings by the largest entry of each row, it follows a change of units exactly: in units u_i of row and
column i, D_i becomes D_i/u_i. Entries that stay far below 1 once scaled, rounding mostly, lose their weight.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from cpbench.matrices import Vector

ROUNDS = 4
STEPS = 200


def equilibrate(K: Any) -> Vector:
    """D of a symmetric CSR matrix of nonnegative entries; 1 for an empty row."""
    K = K.copy()
    K.eliminate_zeros()
    rows = np.repeat(np.arange(K.shape[0]), np.diff(K.indptr))
    logs = np.log2(K.data)
    d = np.zeros(K.shape[0])
    weight = np.ones(logs.size)
    for _ in range(ROUNDS):
        W = type(K)((weight, K.indices, K.indptr), shape=K.shape)
        d = _conjugate_gradients(W, d, -np.bincount(rows, weight * logs, K.shape[0]))
        weight = np.exp2(np.minimum(logs + d[rows] + d[K.indices], 0.0))
    return np.exp2(d)


def _conjugate_gradients(W: Any, d: Vector, target: Vector) -> Vector:
    """(diag(W1) + W)d = target, scaled by the diagonal; the system is consistent where it is singular."""
    total = np.asarray(W.sum(axis=1)).ravel()
    inverse = np.divide(1.0, total, out=np.zeros_like(total), where=total > 0)
    r = target - total * d - W @ d
    z = inverse * r
    p, old = z.copy(), float(r @ z)
    first = old
    for _ in range(STEPS):
        if old <= 1e-6 * first or old == 0:
            break
        Ap = total * p + W @ p
        curvature = float(p @ Ap)
        if curvature <= 0:  # nothing is left but rounding
            break
        alpha = old / curvature
        d, r = d + alpha * p, r - alpha * Ap
        z = inverse * r
        new = float(r @ z)
        p, old = z + (new / old) * p, new
    return d
