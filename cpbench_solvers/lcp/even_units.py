"""An LCP in units in which rows and unknowns are of like size, where its own are far apart.

A pivot tolerance, and a norm of the residual, see nothing of a row that is 1e8 times smaller than the others. With
positive diagonal D₁, D₂ the LCP of D₁MD₂ and D₁q has the solutions z = D₂z'. Powers of two round nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cpbench.formulations.linear import LCP, LCPPoint
from cpbench.foundation.matrices import Vector
from cpbench.solvers.base import SolverOutput
from cpbench_solvers.kernels import lemke_judged
from cpbench_solvers.lcp.first_basis import DenseLCP, dense_lcp

APART = 2.0**20
"""The largest entries of rows, or of columns, differ by more: below, double precision has digits enough."""
PASSES = 8
"""Passes of Ruiz' scaling; each takes the square root of what is left of the differences."""


@dataclass(frozen=True)
class EvenLCP:
    """An LCP in even units, and what they are: of its rows (D₁) and of its unknowns (D₂)."""

    lcp: DenseLCP
    rows: Vector
    unknowns: Vector

    def entered(self, start: LCPPoint) -> LCPPoint:
        """Return a start in these units."""
        return LCPPoint(start.z / self.unknowns)

    def left(self, output: SolverOutput) -> SolverOutput:
        """Return an answer, or a certificate yᵀM ≤ 0, in the units of the problem."""
        point = None if output.point is None else LCPPoint(output.point.z * self.unknowns)
        certificate = None if output.certificate is None else output.certificate * self.rows
        return replace(output, point=point, certificate=certificate)


def in_even_units(lcp: DenseLCP, by_columns: bool) -> EvenLCP:
    """Return the problem in even units, equal ones of rows and unknowns where M is symmetric.

    Ruiz, A scaling algorithm to equilibrate both rows and columns norms in matrices (2001), in the ∞-norm.
    """
    rows, unknowns = np.empty((2, lcp.problem.q.size))
    M = np.empty(lcp.M.shape)
    lemke_judged.even(lcp.M, PASSES, rows, unknowns, M)
    problem = LCP(M=M, q=lcp.problem.q * rows, name=lcp.problem.name)
    return EvenLCP(dense_lcp(problem, by_columns=by_columns), rows, unknowns)
