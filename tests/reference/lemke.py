"""reference-lemke: Lemke's method on a dense tableau, of an LCP."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.linear import LCP, LCPPoint
from cpbench.foundation.matrices import dense
from cpbench.solvers import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register


@register
class ReferenceLemke(Solver):
    """Pivots along w = M z + q + d t from t so large that z = 0 is feasible, until t leaves the basis.

    Columns of the tableau: w, z, t and the right side. There is no rule against cycles.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="reference-lemke",
        node="lcp",
        summary="Lemke's method on a dense tableau, short rather than fast",
        method="pivoting",
        citation="Cottle, Pang and Stone 1992, algorithm 4.4.5",
        traits=frozenset({Trait.DETERMINISTIC}),
    )

    def solve(
        self, prepared: LCP, budget: Budget, options: Any, start: Any | None = None, record: Record | None = None
    ) -> SolverOutput:
        n, q = prepared.q.size, prepared.q
        tableau = np.hstack([np.eye(n), -dense(prepared.M), -np.ones((n, 1)), q[:, None]])
        basis, entering, leaving = np.arange(n), 2 * n, int(np.argmin(q)) if n else 0
        pivots, most = 0, budget.iterations or 50 * (n + 1)
        while n and q.min() < 0.0 and 2 * n in (entering, *basis) and pivots < most:
            pivots += 1
            tableau[leaving] /= tableau[leaving, entering]
            others = np.arange(n) != leaving
            tableau[others] -= np.outer(tableau[others, entering], tableau[leaving])
            left, basis[leaving] = basis[leaving], entering
            if left == 2 * n:
                break
            entering = (left + n) % (2 * n)  # the complement of what left
            rows = np.flatnonzero(tableau[:, entering] > 1e-11 * np.abs(tableau[:, entering]).max())
            if rows.size == 0:
                return SolverOutput(claim=Claim.FAILED, counters={"pivots": pivots}, message="a ray")
            leaving = int(rows[np.argmin(tableau[rows, -1] / tableau[rows, entering])])
        z = np.zeros(2 * n + 1)
        z[basis] = np.maximum(tableau[:, -1], 0.0)
        point = LCPPoint(z=z[n : 2 * n])
        good = prepared.residuals(point, budget.tolerance).error <= budget.tolerance
        return SolverOutput(claim=Claim.SOLVED if good else Claim.MAX_ITER, point=point, counters={"pivots": pivots})
