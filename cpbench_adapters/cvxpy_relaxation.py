"""The convex relaxation of frictional contact, by CVXPY and Clarabel (Anitescu and Tasora 2010).

Without De Saxcé's term μ‖u_T‖e_N the contact law is the cone complementarity K*_μ ∋ Wr + q ⟂ r ∈ K_μ, and for a
symmetric PSD W that is the optimality condition of  min ½rᵀWr + qᵀr over Π K_μ.  Separated and sticking contacts
obey the exact law in its solution; a sliding contact with μ > 0 lifts off with u_N = μ‖u_T‖.

The model is scaled: with w = mean diag W and s = max|q|, r = (s/w)x turns it into min ½xᵀ(W/w)x + (q/s)ᵀx over the
same cones, so that Clarabel's tolerances mean the same in grams and in tonnes.

Tolerance: Clarabel's residuals get ε/10; its duality gap δ leaves a natural map of order √δ on the boundary of a
cone, so the gap gets ε²/10, but not less than 1e-13. Measured on sliding contacts with rank-deficient W: the
relaxation's own residual reaches 3e-8 at best.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np

from cpbench.formulations.base import Kind
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.local_contact import FrictionContact
from cpbench.foundation import matrices
from cpbench.solvers.base import (
    Budget,
    Claim,
    Record,
    Solver,
    SolverOutput,
    SolverSpec,
    Trait,
    package_version,
    register,
)
from cpbench.solvers.stopping import Stopping, no_looser
from cpbench_adapters.qp_stopping import TESTS

CLAIMS = {
    "optimal": Claim.SOLVED,
    "optimal_inaccurate": Claim.INACCURATE,
    "infeasible": Claim.INFEASIBLE,
    "infeasible_inaccurate": Claim.INFEASIBLE,
    "unbounded": Claim.UNBOUNDED,
    "unbounded_inaccurate": Claim.UNBOUNDED,
    "user_limit": Claim.MAX_ITER,
}
"""CVXPY's words for how a solve ended."""
SYMMETRY_LIMIT = 1e-8
"""Asymmetry up to which a Delassus matrix counts as symmetric (assembled ones are not to rounding)."""
INDEFINITE = 2e-7
"""−λ_min of W scaled to unit diagonal up to which W counts as positive semidefinite: the Delassus matrices of
FrictionContactProblem, written with eight digits, have 1e-7."""


@dataclass(frozen=True)
class _Model:
    """A compiled CVXPY problem, its variable x, and r = scale·x."""

    problem: Any
    x: Any
    data: Any
    chain: Any
    inverse: Any
    scale: float


@register
class CvxpyRelaxation(Solver):
    """min ½rᵀWr + qᵀr over the friction cones; 2D cones are written as two half planes."""

    spec = SolverSpec(
        name="cvxpy-relaxation",
        node="fc",
        summary="convex relaxation (associated flow), a second-order cone program by CVXPY and Clarabel",
        method="interior point",
        citation="Anitescu and Tasora, Comput. Optim. Appl. 47 (2010); Diamond and Boyd, JMLR 17 (2016)",
        requires=("cvxpy", "clarabel"),
        install="pip install cvxpy clarabel",
        licence="Apache-2.0",
        kind=Kind.RELAXATION,
        traits=frozenset({Trait.SPARSE, Trait.DETERMINISTIC}),
    )

    def obstacle(self, problem: FrictionContact) -> str | None:
        if problem.nc == 0:
            return "has no contact (nc = 0): there is nothing to minimise"
        asymmetry = matrices.asymmetry(problem.W)
        if asymmetry > SYMMETRY_LIMIT:
            return (
                f"needs W symmetric, asymmetry = {asymmetry:.1e} > {SYMMETRY_LIMIT:.0e}: "
                "the relaxation is then no minimisation; use a solver of the exact law"
            )
        if not matrices.is_psd(problem.W, INDEFINITE):
            return (
                f"needs W positive semidefinite: scaled to unit diagonal it has an eigenvalue below -{INDEFINITE:.0e}"
            )
        return None

    def setup(self, problem: FrictionContact, budget: Budget, options: Any) -> _Model:
        import cvxpy as cp

        d, mu = problem.dimension, problem.mu
        mean = float(problem.W.diagonal().mean())
        w = mean if mean > 0 else 1.0
        s = matrices.max_abs(problem.q) or 1.0
        W: Any = problem.W / w
        x = cp.Variable(problem.q.size)
        rubs, slides = np.flatnonzero(mu > 0), np.flatnonzero(mu == 0)
        constraints: list[Any] = []
        if rubs.size:
            limit = cp.multiply(mu[rubs], x[d * rubs])
            if d == 2:
                constraints += [x[d * rubs + 1] <= limit, -x[d * rubs + 1] <= limit]
            else:
                constraints.append(cp.SOC(limit, cp.vstack([x[d * rubs + 1], x[d * rubs + 2]]), axis=0))
        if slides.size:
            constraints.append(x[d * slides] >= 0)
            constraints += [x[d * slides + t] == 0 for t in range(1, d)]
        # psd_wrap: the obstacle has decided, CVXPY's own eigenvalue test fails on matrices that are PSD to rounding
        objective = 0.5 * cp.quad_form(x, cp.psd_wrap((W + W.T) * 0.5)) + (problem.q / s) @ x
        model = cp.Problem(cp.Minimize(objective), constraints)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            data, chain, inverse = model.get_problem_data(cp.CLARABEL, solver_opts={})
        return _Model(model, x, data, chain, inverse, s / w)

    def solve(
        self, prepared: _Model, budget: Budget, options: Any, start: Any | None = None, record: Record | None = None
    ) -> SolverOutput:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # CVXPY warns of an inaccurate solution; the claim says it
            raw = prepared.chain.solve_via_data(
                prepared.problem, prepared.data, solver_opts=_settings(budget), warm_start=False, verbose=False
            )
            prepared.problem.unpack_results(raw, prepared.chain, prepared.inverse)
        status = str(prepared.problem.status)
        value = prepared.x.value
        stats = prepared.problem.solver_stats
        return SolverOutput(
            claim=CLAIMS.get(status, Claim.FAILED),
            point=None if value is None else FCPoint(r=prepared.scale * np.asarray(value)),
            counters={"iterations": int(stats.num_iters)} if stats is not None and stats.num_iters else {},
            message=status,
        )

    def stopping(self, tolerance: float, problem: FrictionContact | None = None) -> Stopping:
        return _stopping(tolerance)

    def warmup(self) -> None:
        self.run(FrictionContact(W=np.eye(3), q=np.array([-1.0, 0.0, 0.0]), mu=np.array([0.5])))

    def version(self) -> str:
        return f"{package_version('cvxpy')} (clarabel {package_version('clarabel')})"


def _stopping(tolerance: float) -> Stopping:
    test, gap = TESTS["clarabel"], max(0.1 * tolerance**2, 1e-13)
    defaults = {name: value for name, value in test.defaults.items() if "infeas" not in name}
    settings = no_looser({"tol_feas": 0.1 * tolerance, "tol_gap_abs": gap, "tol_gap_rel": gap}, defaults)
    return Stopping(test=f"{test.test}, of scaled data", settings=settings, defaults=defaults)


def _settings(budget: Budget) -> dict[str, Any]:
    settings: dict[str, Any] = {
        **_stopping(budget.tolerance).settings,
        "max_iter": 200 if budget.iterations is None else budget.iterations,
    }
    if math.isfinite(budget.seconds):
        settings["time_limit"] = budget.seconds
    return settings
