"""An LCP seen from another complementary basis: its principal pivot transform, column by column when it is asked for.

With B basic, w' = (z_B, w_N) and z' = (w_B, z_N) are complementary again, and w' = M'z' + q' with

    M' = [ M_BB⁻¹         -M_BB⁻¹ M_BN               ]     q' = [ -M_BB⁻¹ q_B               ]
         [ M_NB M_BB⁻¹    M_NN - M_NB M_BB⁻¹ M_BN    ]          [ q_N - M_NB M_BB⁻¹ q_B    ]

(Cottle, Pang and Stone 1992, section 2.3): the same solutions, and M' is P, positive semidefinite or copositive-plus
wherever M is P or positive semidefinite.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from cpbench.foundation.matrices import Vector, max_abs
from cpbench_solvers.lcp.basis_factor import BasisFactor
from cpbench_solvers.lcp.first_basis import DenseLCP

CONDITION = 1e-13
"""The least pivot of M_BB, as a share of the largest, that is no rounding error."""
ROUNDING = 1e-13
"""Entries of q' this little below zero, in data of size one, are zero."""


class PrincipalTransform:
    """The LCP (M', q') of the basis B, in data scaled to size one: w by max|q|, z_B by its own largest component.

    Attributes
    ----------
    q : (n,), q' so scaled, with the rounding errors below zero taken away.
    """

    def __init__(self, lcp: DenseLCP, factor: BasisFactor, z: Vector, w: Vector) -> None:
        self._lcp, self._factor = lcp, factor
        self._inside, self._B = factor.inside, factor.B
        self._N = np.flatnonzero(~factor.inside)
        self._w_unit = max_abs(lcp.problem.q) or 1.0
        self._z_unit = max_abs(z) or 1.0
        q = np.where(factor.inside, z / self._z_unit, w / self._w_unit)
        self.q = np.where((q < 0.0) & (q >= -ROUNDING), 0.0, q)
        # M_NB by rows, taken once: every column needs it
        self._M_NB = lcp.M.take(self._N, axis=0).take(self._B, axis=1)

    def negated_columns(self, indices: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        """Return (k, n): -M'e_j for every index j, scaled."""
        mine = self._inside[indices]
        X = self._factor.solve(self._factor.border(indices))
        sign = np.where(mine, -1.0, 1.0)
        rest = sign * (self._M_NB @ X)
        rest[:, ~mine] -= self._lcp.columns.take(indices[~mine], axis=0).take(self._N, axis=1).T
        # z'_j is w_j in units of w, or z_j in units of z
        units = np.where(mine, self._w_unit, self._z_unit)
        result = np.empty((indices.size, self._inside.size))
        result[:, self._B] = (X * (sign * units / self._z_unit)).T
        result[:, self._N] = (rest * (units / self._w_unit)).T
        return result

    def lifted(self, complementary: Vector, transformed: Vector) -> Vector:
        """Return z of the LCP that was asked, from w' and z', both scaled."""
        return np.where(self._inside, complementary, transformed) * self._z_unit


def transformed(lcp: DenseLCP, inside: np.ndarray[Any, Any]) -> PrincipalTransform | None:
    """Return the LCP seen from the basis of `inside`, None where M_BB is singular or nearly so."""
    factor = BasisFactor(lcp.M, lcp.columns, lcp.problem.symmetric, inside)
    pivots = factor.pivots
    if pivots.size and not pivots.min() > CONDITION * pivots.max():
        return None
    solution = factor.solution(lcp.problem.q)
    return None if solution is None else PrincipalTransform(lcp, factor, *solution)
