"""Variables with bounds as complementary variables: what the edges from boxes to `lcp` share.

With x = z − lb where lb is the bound nearer to 0, x = ub − z elsewhere, so z = c + Sx with S = ±1, and a multiplier y
for every variable bounded on both sides (J its rows of the identity, g = ub − lb):

    0 ≤ x ⟂ SMSx + Jᵀy + S(q + Mc) ≥ 0,   0 ≤ y ⟂ g − Jx ≥ 0.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.conversions.base import Conversion
from cpbench.formulations.base import Trace, formulations
from cpbench.formulations.linear import AVI, LCP, AVIPoint, LCPPoint, Relay
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Vector

FAR = 1e8
"""Largest ratio of Mc to q: half of the digits of q are left."""
MOST = 1e4
"""The most that is asked for beyond the tolerance: methods of first order do not reach every factor."""


class FromBounds(Conversion):
    """Base of the edges to this LCP, of variables with a bound each.

    Trace: `c`, `S` (as vectors), `both` (indices), `M`, `q`, `shift`.
    """

    def obstacle(self, problem: AVI | Relay) -> str | None:
        """Return why q + Mc would lose the digits of q, c being far away; else None."""
        c, _ = origin(problem.lb, problem.ub)
        shift, size = matrices.max_abs(problem.M @ c), matrices.max_abs(problem.q)
        if size == 0.0 or shift <= FAR * size:
            return None
        return (
            f"the bounds are so far away that q would be lost beside M times them: max|q| = {size:.1e}, "
            f"max|Mc| = {shift:.1e}; use avi-mlcp"
        )

    def apply(self, problem: AVI | Relay) -> tuple[LCP, Trace]:
        self.require(problem)
        M, q, lb, ub = problem.M, problem.q, problem.lb, problem.ub
        c, S = origin(lb, ub)
        both = np.flatnonzero(np.isfinite(lb) & np.isfinite(ub))
        ones = (np.ones(both.size), (np.arange(both.size), both))
        J: Matrix = sp.csr_array(ones, shape=(both.size, q.size))
        if not matrices.is_sparse(M):
            J = matrices.dense(J)
        corner = matrices.zeros(both.size, both.size, M)
        target = LCP(
            M=matrices.block([[matrices.scaled_both(M, S), matrices.transpose(J)], [-J, corner]]),
            q=np.concatenate([S * (q + M @ c), ub[both] - lb[both]]),
        )
        return target, {"c": c, "S": S, "both": both, "M": M, "q": q, "shift": amplification(M @ c, q)}

    def lift(self, point: LCPPoint, trace: Trace) -> Any:
        z = trace["c"] + trace["S"] * point.z[: trace["c"].size]
        return formulations.get(self.source).point_type(z=z)

    def push(self, point: AVIPoint | LCPPoint, trace: Trace) -> LCPPoint:
        S, both = trace["S"], trace["both"]
        force = S * (trace["M"] @ point.z + trace["q"])
        return LCPPoint(z=np.concatenate([S * (point.z - trace["c"]), np.maximum(-force[both], 0.0)]))


def origin(lb: Vector, ub: Vector) -> tuple[Vector, Vector]:
    """Return c, the bound nearer to 0 of every variable, and S, its side: 1 for lb, −1 for ub."""
    from_below = np.abs(lb) <= np.abs(ub)
    return np.where(from_below, lb, ub), np.where(from_below, 1.0, -1.0)


def amplification(moved: Vector, constants: Vector) -> float:
    """Return 1 + 2|Mc|/|q| in the row where it is least, MOST at most; 1 where no row has a constant.

    With z = x + c, c a far bound or a solve with the constants, source rows are Mz + q, target rows Mx + (q + Mc). An
    error of ε in a target row is one of its terms, |M||x| + |q + Mc|, and at most |M||z| + |q| + 2|Mc|. The source has
    |M||z| + |q| to measure it by: where |q| is far below |Mc|, the terms cancel, and an answer that is right to ε there
    may be off by ε (1 + 2|Mc|/|q|) here. The row with the largest constant sets the size of the solution, and with it
    the terms of all others.

    >>> amplification(np.array([50.0, 0.0, 9.0]), np.array([1.0, 0.0, 9.0]))
    3.0
    """
    nonzero = constants != 0.0
    ratios = np.abs(moved[nonzero]) / np.abs(constants[nonzero])
    return min(1.0 + 2.0 * float(ratios.min(initial=np.inf)), MOST) if nonzero.any() else 1.0
