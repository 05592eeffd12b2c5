"""HiGHS, called directly: qpsolvers drops its model status, and HiGHS has false ones that must be recorded."""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.programs import QP
from cpbench.solvers.base import Availability, Budget, Claim, SolverSpec, Trait, package_version, register
from cpbench.solvers.stopping import Stopping, no_looser
from cpbench_adapters.qp_backend import BackendAnswer, QPBackend
from cpbench_adapters.qp_standard_form import StandardForm
from cpbench_adapters.qp_tolerances import ABSOLUTE, Settings, excess


@register
class Highs(QPBackend):
    """Null-space active set for QPs; a QP with Q = 0 goes to its simplex method."""

    spec = SolverSpec(
        name="highs",
        node="qp",
        summary="null-space active set (QP), dual simplex (Q = 0), sparse",
        method="active set",
        citation="Huangfu and Hall, Math. Prog. Comp. 10 (2018); Feldmeier, PhD thesis, Edinburgh (2023)",
        requires=("highspy",),
        install="pip install 'cpbench[backends]'",
        licence="MIT",
        traits=frozenset({Trait.SPARSE, Trait.DETERMINISTIC}),
        known_failures={
            "planted-psd-lcp": "calls a convex, solvable QP with singular Q (n = 60, rank 20) unbounded",
            "tolerance-1e-08": "calls a convex QP in a box with singular Q (n = 20, rank 6) unbounded at 1e-8 (1.16.0)",
            "maros-meszaros-HS118": "stationarity 3e-6 at 1e-6: regularization of the Hessian times |z|",
            "maros-meszaros-QAFIRO": "relative gap 4e-5 at 1e-6: regularization of the Hessian times |z|²",
        },
    )
    method: ClassVar[str] = "choose"
    prints = True
    claims = {
        "Optimal": Claim.SOLVED,
        "Infeasible": Claim.INFEASIBLE,
        "Unbounded": Claim.UNBOUNDED,
        "Iteration limit reached": Claim.MAX_ITER,
        "Time limit reached": Claim.MAX_ITER,
    }

    def call(self, form: StandardForm, settings: Settings) -> BackendAnswer:
        import highspy

        n = form.q.size
        model = highspy.HighsModel()
        lp = model.lp_
        lp.num_col_ = n
        lp.col_cost_ = form.q
        lp.col_lower_ = np.full(n, -np.inf) if form.lb is None else form.lb
        lp.col_upper_ = np.full(n, np.inf) if form.ub is None else form.ub
        h = np.zeros(0) if form.h is None else form.h
        b = np.zeros(0) if form.b is None else form.b
        rows = [M for M in (form.G, form.A) if M is not None]
        lp.num_row_ = h.size + b.size
        if rows:
            matrix = sp.csc_matrix(sp.vstack(rows))
            lp.a_matrix_.format_ = highspy.MatrixFormat.kColwise
            lp.a_matrix_.num_col_, lp.a_matrix_.num_row_ = n, lp.num_row_
            lp.a_matrix_.start_, lp.a_matrix_.index_ = matrix.indptr, matrix.indices
            lp.a_matrix_.value_ = matrix.data
            lp.row_lower_ = np.concatenate([np.full(h.size, -np.inf), b])
            lp.row_upper_ = np.concatenate([h, b])
        if form.P.nnz:
            lower = sp.csc_matrix(sp.tril(form.P))
            model.hessian_.dim_ = n
            model.hessian_.format_ = highspy.HessianFormat.kTriangular
            model.hessian_.start_, model.hessian_.index_ = lower.indptr, lower.indices
            model.hessian_.value_ = lower.data
        solver = highspy.Highs()
        _set(solver, {"output_flag": False, "solver": self.method} | settings)
        if solver.passModel(model) == highspy.HighsStatus.kError:
            return BackendAnswer(status="model refused")
        solver.run()
        solution, info = solver.getSolution(), solver.getInfo()
        dual = -np.array(solution.row_dual)
        counts = info.qp_iteration_count, info.simplex_iteration_count, info.ipm_iteration_count
        counted = max(map(int, (*counts, 0)))
        return BackendAnswer(
            status=solver.modelStatusToString(solver.getModelStatus()),
            x=np.array(solution.col_value) if solution.value_valid else None,
            z=dual[: h.size],
            y=dual[h.size :],
            z_box=-np.array(solution.col_dual),
            counters={"iterations": counted},
            remarks=() if solution.dual_valid else ("no valid multipliers",),
        )


@register
class Hipo(Highs):
    """HiGHS's interior point for QPs, in a package of its own, whose version has to be that of highspy."""

    spec = SolverSpec(
        name="hipo",
        node="qp",
        summary="HiGHS's interior point by factorizations, sparse",
        method="interior point",
        citation="Zanetti and Gondzio, A factorisation-based regularised interior point method, arXiv 2508.04370",
        requires=("highspy", "highspy_extras"),
        install="pip install 'cpbench[hipo]'",
        licence="Apache-2.0",
        traits=frozenset({Trait.SPARSE, Trait.DETERMINISTIC}),
    )
    method = "hipo"

    def availability(self) -> Availability:
        """Return whether both packages have one version; with two, HiGHS takes its active set and says nothing."""
        found = super().availability()
        ours, theirs = (package_version(name) for name in self.spec.requires)
        if not found.ok or ours == theirs:
            return found
        advice = f"pip install highspy=={theirs} highspy-extras=={theirs}"
        return Availability("broken", f"highspy {ours} and highspy-extras {theirs} are of two versions: {advice}")

    def settings(self, budget: Budget) -> Settings:
        e = max(0.1 * budget.tolerance, 1e-10)
        own = {"primal_feasibility_tolerance": e, "dual_feasibility_tolerance": e, "ipm_optimality_tolerance": 0.1 * e}
        limits = {"ipm_iteration_limit": budget.iterations or 200}
        seconds = {"time_limit": budget.seconds} if math.isfinite(budget.seconds) else {}
        return no_looser(own, self._defaults) | limits | seconds

    def stopping(self, tolerance: float, problem: QP | None = None) -> Stopping:
        asked, test = self.settings(Budget(tolerance=tolerance)), "feasibility, absolute; gap, relative"
        own, factor = {name: asked[name] for name in self._defaults}, 1.0 if problem is None else excess(problem)
        return Stopping(test=test, differs=ABSOLUTE, defaults=self._defaults, settings=own, factor=factor)

    _defaults: ClassVar[dict[str, float]] = {
        "primal_feasibility_tolerance": 1e-7,
        "dual_feasibility_tolerance": 1e-7,
        "ipm_optimality_tolerance": 1e-8,
    }


def _set(solver: Any, options: Settings) -> None:
    import highspy

    for name, value in options.items():
        if solver.setOptionValue(name, value) == highspy.HighsStatus.kError:
            raise ValueError(f"highs: option {name} = {value!r} was refused")
