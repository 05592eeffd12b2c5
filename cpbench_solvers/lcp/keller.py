"""Keller's method on a symmetric LCP: down ½zᵀMz + qᵀz over z ≥ 0 to a stationary point, which solves the LCP."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.lcp import LCP
from cpbench.foundation.matrices import SYMMETRY_TOLERANCE, asymmetry
from cpbench.solvers.base import SolverSpec, register
from cpbench_solvers.lcp.claims import ScaledLCP, dense_obstacle
from cpbench_solvers.lcp.principal_pivoting import PrincipalPivoting, Tableau, pivoting_spec


@register
class Keller(PrincipalPivoting):
    """z stays nonnegative and M_FF positive definite, so the objective falls with every major cycle: no cycling.

    M may be indefinite. Ends in a stationary point unless the objective falls for ever along a ray, which for
    semidefinite M proves that there is no solution, and for others proves nothing.
    """

    spec: ClassVar[SolverSpec] = pivoting_spec(
        name="keller",
        summary="Keller's principal pivoting for symmetric matrices, indefinite ones too",
        citation="Keller 1973, Math. Prog. 5:311; Cottle, Pang and Stone 2009, section 4.3",
        by_default=False,
    )
    loop = "keller"
    promise = "semidefinite"

    def obstacle(self, problem: LCP) -> str | None:
        why = dense_obstacle(problem)
        if why is None and (measured := asymmetry(problem.M)) > SYMMETRY_TOLERANCE:
            why = f"needs a symmetric matrix, asymmetry = {measured:.1e}: use cottle-dantzig or lemke"
        return why

    def begin(self, prepared: ScaledLCP, F: np.ndarray[Any, Any], zero: float) -> Tableau | None:
        """Begin only where z_F ≥ 0 and M_FF is positive definite, as its inverse then is."""
        tableau = super().begin(prepared, F, zero)
        if tableau is None or F.size == 0:
            return tableau
        try:
            np.linalg.cholesky(tableau.T[np.ix_(F, F)])
        except np.linalg.LinAlgError:
            return None
        if tableau.y[F].min() < -1e3 * zero:
            return None
        tableau.y[F] = np.maximum(tableau.y[F], 0.0)
        return tableau
