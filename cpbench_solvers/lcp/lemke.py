"""Lemke's method on an LCP: cover q by z_0, then follow complementary pivots until z_0 leaves or a ray appears."""

from __future__ import annotations

from functools import cache
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.linear import LCP, LCPPoint
from cpbench.solvers.base import Budget, Record, Solver, SolverOutput, SolverSpec, Trait, register, solved
from cpbench_solvers.avi.claims import verdict_error
from cpbench_solvers.kernels import lemke_judged
from cpbench_solvers.lcp.claims import conclude, dense_obstacle, error_of
from cpbench_solvers.lcp.even_units import APART, EvenLCP, in_even_units
from cpbench_solvers.lcp.first_basis import DenseLCP, dense_lcp, swept
from cpbench_solvers.lcp.lemke_run import SMALL, LemkeOptions, LemkeRun, judged

OMEGA = 0.6
"""Relaxation of the sweeps where M is not symmetric and 1 does not do."""


@register
class Lemke(Solver):
    """Complementary pivoting with covering vector e and the lexicographic ratio test, which excludes cycling.

    Ends in a solution for copositive-plus M (so for PSD M) when there is a feasible point, and for P and other
    Q_0 classes; elsewhere it may end in a ray, which by itself proves nothing. A ray is then followed by a linear
    program for a Farkas certificate.

    A start, or sweeps on a large problem, name a complementary basis, and the pivots begin at the principal transform
    of the LCP there, which has the same solutions and covers its own q' by e. Where that basis is singular, or the
    way from it ends in a ray or takes more than n pivots, all begins again at w = q: claims of a ray come from there.

    What ends there without an answer or a proof begins again with larger pivots, then from bases of two unknowns
    (`lemke_run.pairs`).

    Where rows or unknowns are in units far apart, everything happens in even ones (`even_units`), the claim too.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="lemke",
        node="lcp",
        summary="Lemke's complementary pivoting, lexicographic ratio test",
        method="pivoting",
        citation="Lemke 1965; Cottle, Pang and Stone 1992, algorithm 4.4.5, sections 2.3 and 4.9",
        traits=frozenset({Trait.WARM_START, Trait.DETERMINISTIC}),
        quick=True,
        options=LemkeOptions,
    )

    def obstacle(self, problem: LCP) -> str | None:
        return dense_obstacle(problem)

    def setup(self, problem: LCP, budget: Budget, options: LemkeOptions) -> DenseLCP | EvenLCP:
        by_columns = problem.q.size > SMALL
        lcp = dense_lcp(problem, by_columns=by_columns)
        return in_even_units(lcp, by_columns) if APART < _spread()(lcp.M) < np.inf else lcp

    def solve(
        self,
        prepared: DenseLCP | EvenLCP,
        budget: Budget,
        options: LemkeOptions,
        start: Any = None,
        record: Record | None = None,
    ) -> SolverOutput:
        if isinstance(prepared, EvenLCP):
            begin = None if start is None else prepared.entered(start)
            return prepared.left(self.solve(prepared.lcp, budget, options, begin))
        problem = prepared.problem
        q = problem.q
        n = q.size
        if start is None and n <= SMALL:  # written out, for most problems are small, and calls take as long as they do
            limit, (pivot, codes) = budget.iterations or options.max_pivots or 50 * n + 1000, judged()
            z, tied = np.empty(n), options.tie_tolerance
            code, error, exact = pivot(prepared.M, q, z, problem.z_unit, limit, options.pivot_tolerance, tied)
            if error <= budget.tolerance and (exact or verdict_error(problem, z) <= budget.tolerance):
                pivots = code // codes
                return solved(LCPPoint(z), {"iterations": pivots, "pivots": pivots})
            return LemkeRun(prepared, budget, options).from_origin(z, code)
        run = LemkeRun(prepared, budget, options)
        if start is not None:
            z = np.maximum(start.z, 0.0)
            if (error := error_of(prepared.problem, z, budget.tolerance)) <= budget.tolerance:
                return conclude(prepared.problem, z, budget, run.counters, error=error)
            output = run.from_support(z)
        elif n > SMALL and options.crash_sweeps > 0:
            z, sweeps = swept(prepared, min(options.crash_sweeps, run.left), OMEGA)
            run.counters["iterations"] += sweeps
            output = run.from_support(z) if sweeps else None
        else:
            output = None
        return run.from_origin() if output is None else output


@cache
def _spread() -> Any:
    return lemke_judged.spread
