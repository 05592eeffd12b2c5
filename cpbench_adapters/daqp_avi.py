"""DAQP on affine variational inequalities: its dual active set takes an M that is not symmetric (`is_avi`)."""

from __future__ import annotations

from typing import Any

import numpy as np

from cpbench.formulations.linear import AVI, AVIPoint
from cpbench.foundation.matrices import dense, max_abs
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register
from cpbench.solvers.stopping import Stopping, no_looser

MOST = 2_000
"""Unknowns and rows of the dense matrices that it is given."""
_CLAIMS = {1: Claim.SOLVED, -1: Claim.INFEASIBLE, -4: Claim.MAX_ITER, -7: Claim.MAX_ITER}
_WORDS = {1: "solved", -1: "infeasible", -2: "cycling", -4: "iteration limit", -5: "not monotone", -7: "time limit"}
_EQUALITY, _NO_BOUND = 5, 1e30
DEFAULTS = {"primal_tol": 1e-6, "dual_tol": 1e-12}


@register
class DaqpAVI(Solver):
    """Multipliers in DAQP's signs: Mz + q + [I, Aᵀ, Cᵀ] λ = 0, positive at an upper side."""

    spec = SolverSpec(
        name="daqp-avi",
        node="avi",
        summary="DAQP's dual active set for an M that is monotone and not symmetric, dense",
        method="dual active set",
        citation="Arnström and Axehill, A dual active-set method for affine variational inequalities, 2024",
        requires=("daqp",),
        install="pip install 'cpbench[backends]'",
        licence="MIT",
        traits=frozenset({Trait.DETERMINISTIC}),
    )

    def obstacle(self, problem: AVI) -> str | None:
        size = problem.q.size + problem.b.size + problem.d.size
        if not problem.q.size > 0 or size > MOST:
            return f"has {size} unknowns and rows, takes 1 to {MOST} in dense matrices: use newton-avi or auto-avi"
        if max_abs(problem.M) == 0.0:
            return "M is 0, a linear program, which proximal steps approach alone: use lemke-avi"
        return None if problem.monotone else "M is not monotone: use lemke-avi"

    def setup(self, problem: AVI, budget: Budget, options: Any) -> tuple[Any, ...]:
        # its thresholds are absolute: z in the unit that the data ask for, forces in what M makes of that
        unit = problem.z_unit or 1.0
        force = unit * max_abs(problem.M) or 1.0
        rows = np.vstack([dense(problem.A), dense(problem.C)])
        lower = np.concatenate([problem.lb, problem.b, problem.d]) / unit
        upper = np.concatenate([problem.ub, np.full(problem.b.size, np.inf), problem.d]) / unit
        sense = np.zeros(upper.size, dtype=np.intc)
        sense[upper == lower] = _EQUALITY
        law = np.array(dense(problem.M)) * (unit / force), problem.q / force
        return problem, unit, force, *law, rows, np.minimum(upper, _NO_BOUND), np.maximum(lower, -_NO_BOUND), sense

    def solve(
        self, prepared: Any, budget: Budget, options: Any, start: Any = None, record: Record | None = None
    ) -> SolverOutput:
        import daqp

        problem, unit, force, *data = prepared
        most = {} if budget.iterations is None else {"iter_limit": budget.iterations}
        limit = {"time_limit": budget.seconds} if np.isfinite(budget.seconds) else {}
        settings = {**self.stopping(budget.tolerance).settings, **most, **limit}
        z, _, flag, info = daqp.solve(*map(np.copy, data), is_avi=True, **settings)
        n, m, lam = problem.q.size, problem.b.size, -force * np.asarray(info["lam"])
        point = AVIPoint(unit * np.asarray(z), np.maximum(lam[n : n + m], 0.0), lam[n + m :])
        claim = _CLAIMS.get(flag, Claim.FAILED)
        message = _WORDS.get(flag, f"exit flag {flag}")
        kept = None if claim is Claim.INFEASIBLE else point
        counters = {"iterations": int(info["iterations"])}
        return SolverOutput(claim=claim, point=kept, counters=counters, message=message)

    def stopping(self, tolerance: float, problem: AVI | None = None) -> Stopping:
        own = {"primal_tol": 0.1 * tolerance, "dual_tol": 1e-12}
        test, differs = "violation of the rows, over the size of z", "multipliers: those of its basis, but for rounding"
        return Stopping(test=test, differs=differs, defaults=DEFAULTS, settings=no_looser(own, DEFAULTS))
