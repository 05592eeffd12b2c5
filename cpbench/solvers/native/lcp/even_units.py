"""An LCP in units in which rows and unknowns are of like size, where its own are far apart.

A pivot tolerance, and a norm of the residual, see nothing of a row that is 1e8 times smaller than the others. With
positive diagonal D₁, D₂ the LCP of D₁MD₂ and D₁q has the solutions z = D₂z'. Powers of two round nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench.formulations.lcp import LCP, LCPPoint
from cpbench.matrices import Dense, Vector
from cpbench.solvers.base import SolverOutput
from cpbench.solvers.native.lcp.first_basis import DenseLCP, dense_lcp

APART = 2.0**20
"""The largest entries of rows, or of columns, differ by more: below, pivoting in double precision has digits enough."""
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
        return SolverOutput(
            claim=output.claim, point=point, counters=output.counters, message=output.message, certificate=certificate
        )


def even_units(M: Dense) -> tuple[Vector, Vector]:
    """Return D₁ and D₂, equal where M is symmetric.

    Ruiz, A scaling algorithm to equilibrate both rows and columns norms in matrices (2001), in the ∞-norm.
    """
    size = np.abs(M)
    rows, unknowns = np.ones(len(M)), np.ones(len(M))
    for _ in range(PASSES):
        by_row, by_column = (np.where(part > 0, part, 1.0) for part in (size.max(axis=1), size.max(axis=0)))
        rows, unknowns = rows / np.sqrt(by_row), unknowns / np.sqrt(by_column)
        size = np.abs(M) * rows[:, None] * unknowns
    return _powers(rows), _powers(unknowns)


def in_even_units(lcp: DenseLCP, by_columns: bool) -> EvenLCP:
    """Return the problem in even units."""
    rows, unknowns = even_units(lcp.M)
    problem = LCP(M=lcp.M * rows[:, None] * unknowns, q=lcp.problem.q * rows, name=lcp.problem.name)
    return EvenLCP(dense_lcp(problem, by_columns=by_columns), rows, unknowns)


def _powers(x: Vector) -> Vector:
    return np.exp2(np.round(np.log2(x)))
