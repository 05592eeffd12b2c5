"""Variables with bounds as complementary variables: what the edges from boxes to `lcp` share.

With x = z − lb where lb is finite, x = ub − z elsewhere, so z = c + Sx with S = ±1, and a multiplier y for every
variable bounded on both sides (J its rows of the identity, g = ub − lb):

    0 ≤ x ⟂ SMSx + Jᵀy + S(q + Mc) ≥ 0,   0 ≤ y ⟂ g − Jx ≥ 0.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from cpbench import matrices
from cpbench.formulations.base import Trace
from cpbench.formulations.lcp import LCP, LCPPoint
from cpbench.matrices import Matrix, Vector


def to_lcp(M: Matrix, q: Vector, lb: Vector, ub: Vector) -> tuple[LCP, Trace]:
    """The LCP in (x, y) of variables with a bound each; trace: `c`, `S` (as vectors), `both` (indices), `M`, `q`."""
    from_below = np.isfinite(lb)
    S = np.where(from_below, 1.0, -1.0)
    c = np.where(from_below, lb, ub)
    both = np.flatnonzero(from_below & np.isfinite(ub))
    scaled = _scale_both(M, S)
    ones = (np.ones(both.size), (np.arange(both.size), both))
    J: Matrix = sp.csr_array(ones, shape=(both.size, q.size))
    if not matrices.is_sparse(M):
        J = matrices.dense(J)
    target = LCP(
        M=matrices.block([[scaled, matrices.transpose(J)], [-J, matrices.zeros(both.size, both.size, M)]]),
        q=np.concatenate([S * (q + M @ c), ub[both] - lb[both]]),
    )
    return target, {"c": c, "S": S, "both": both, "M": M, "q": q}


def lift(point: LCPPoint, trace: Trace) -> Vector:
    """z = c + Sx."""
    return trace["c"] + trace["S"] * point.z[: trace["c"].size]


def push(z: Vector, trace: Trace) -> LCPPoint:
    """x = S(z − c), y the force that holds z at its second bound."""
    S, both = trace["S"], trace["both"]
    force = S * (trace["M"] @ z + trace["q"])
    return LCPPoint(z=np.concatenate([S * (z - trace["c"]), np.maximum(-force[both], 0.0)]))


def _scale_both(M: Matrix, S: Vector) -> Matrix:
    if not matrices.is_sparse(M):
        return matrices.dense(M) * np.outer(S, S)
    D = sp.dia_array((S[None, :], [0]), shape=(S.size, S.size))
    return sp.csr_array(D @ M @ D)
