"""Variables with bounds as complementary variables: what the edges from boxes to `lcp` share.

With x = z − lb where lb is the bound nearer to 0, x = ub − z elsewhere, so z = c + Sx with S = ±1, and a multiplier y
for every variable bounded on both sides (J its rows of the identity, g = ub − lb):

    0 ≤ x ⟂ SMSx + Jᵀy + S(q + Mc) ≥ 0,   0 ≤ y ⟂ g − Jx ≥ 0.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from cpbench.conversions.shift import amplification
from cpbench.formulations.base import Trace
from cpbench.formulations.lcp import LCP, LCPPoint
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Vector

FAR = 1e8
"""Largest ratio of Mc to q: half of the digits of q are left."""


def to_lcp(M: Matrix, q: Vector, lb: Vector, ub: Vector) -> tuple[LCP, Trace]:
    """Return the LCP in (x, y) of variables with a bound each; trace: `c`, `S` (as vectors), `both` (indices), `M`,
    `q`, `shift`.
    """
    c, S = origin(lb, ub)
    both = np.flatnonzero(np.isfinite(lb) & np.isfinite(ub))
    scaled = matrices.scaled_both(M, S)
    ones = (np.ones(both.size), (np.arange(both.size), both))
    J: Matrix = sp.csr_array(ones, shape=(both.size, q.size))
    if not matrices.is_sparse(M):
        J = matrices.dense(J)
    target = LCP(
        M=matrices.block([[scaled, matrices.transpose(J)], [-J, matrices.zeros(both.size, both.size, M)]]),
        q=np.concatenate([S * (q + M @ c), ub[both] - lb[both]]),
    )
    return target, {"c": c, "S": S, "both": both, "M": M, "q": q, "shift": amplification(M @ c, q)}


def origin(lb: Vector, ub: Vector) -> tuple[Vector, Vector]:
    """Return c, the bound nearer to 0 of every variable, and S, its side: 1 for lb, −1 for ub."""
    from_below = np.abs(lb) <= np.abs(ub)
    return np.where(from_below, lb, ub), np.where(from_below, 1.0, -1.0)


def obstacle(M: Matrix, q: Vector, lb: Vector, ub: Vector) -> str | None:
    """Return why q + Mc would lose the digits of q, c being far away; else None."""
    shift, size = matrices.max_abs(M @ origin(lb, ub)[0]), matrices.max_abs(q)
    if size == 0.0 or shift <= FAR * size:
        return None
    return (
        f"the bounds are so far away that q would be lost beside M times them: max|q| = {size:.1e}, "
        f"max|Mc| = {shift:.1e}; use avi-mlcp"
    )


def lift(point: LCPPoint, trace: Trace) -> Vector:
    """Return z = c + Sx."""
    return trace["c"] + trace["S"] * point.z[: trace["c"].size]


def push(z: Vector, trace: Trace) -> LCPPoint:
    """Return x = S(z − c), y the force that holds z at its second bound."""
    S, both = trace["S"], trace["both"]
    force = S * (trace["M"] @ z + trace["q"])
    return LCPPoint(z=np.concatenate([S * (z - trace["c"]), np.maximum(-force[both], 0.0)]))
