"""Quadratic programs written in CVXPY, and solved by a backend of choice: what a modelling layer adds to its backends.

CVXPY's multipliers have the signs of qpsolvers' (`qp_standard_form`); its backends take the settings that they take
alone, from the same table.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

from cpbench.formulations.qp import QP
from cpbench.solvers.base import Budget, Record, SolverOutput, SolverSpec, Trait, register
from cpbench.solvers.stopping import Stopping
from cpbench_adapters.cvxpy_claims import CLAIMS
from cpbench_adapters.qp_backend import BackendAnswer, QPBackend
from cpbench_adapters.qp_standard_form import StandardForm
from cpbench_adapters.qp_tolerances import Settings, stopping, translate

_NOT_CVXPYS = ("raise_error",)
"""Arguments of a backend's own function, which are not settings of it."""


@dataclass(frozen=True)
class CvxpyQPOptions:
    """Options of cvxpy-qp. `solver` : clarabel, osqp, piqp or scs."""

    solver: str = "clarabel"


@register
class CvxpyQP(QPBackend):
    """The program is compiled in `solve`, as `Problem.solve` does: that is what CVXPY costs."""

    spec = SolverSpec(
        name="cvxpy-qp",
        node="qp",
        summary="QP modelled in CVXPY, solved by Clarabel, OSQP, PIQP or SCS",
        method="modelling layer",
        citation="Diamond and Boyd, JMLR 17 (2016); Agrawal, Verschueren, Diamond and Boyd, J. Control Decis. 5 (2018)",
        requires=("clarabel", "cvxpy"),
        install="pip install cvxpy clarabel",
        licence="Apache-2.0",
        traits=frozenset({Trait.SPARSE, Trait.DETERMINISTIC}),
        options=CvxpyQPOptions,
        by_default=False,  # its backends are there without it
    )
    bounds_as_rows = True
    needs_inequality = True  # SCS wants a cone
    claims = CLAIMS

    def solve(
        self,
        prepared: StandardForm,
        budget: Budget,
        options: Any,
        start: Any | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        return self.output(
            prepared, self.call(prepared, {"solver": options.solver, **translate(options.solver, budget)})
        )

    def stopping(self, tolerance: float, problem: QP | None = None) -> Stopping | None:
        return stopping(self.spec.options().solver, tolerance, problem)

    def call(self, form: StandardForm, settings: Settings) -> BackendAnswer:
        import cvxpy as cp

        own = {name: value for name, value in settings.items() if name not in ("solver", *_NOT_CVXPYS)}
        if settings["solver"] == "osqp":
            own["polishing"] = False  # which CVXPY turns on, OSQP does not
        x = cp.Variable(form.q.size)
        rows = [] if form.G is None else [form.G @ x <= form.h]
        equalities = [] if form.A is None else [form.A @ x == form.b]
        # psd_wrap: whether Q is positive semidefinite has been decided by `obstacle`
        objective = 0.5 * cp.quad_form(x, cp.psd_wrap(form.P)) + form.q @ x
        model = cp.Problem(cp.Minimize(objective), rows + equalities)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of inaccurate solutions, which the claim says
            model.solve(solver=settings["solver"].upper(), **own)
        iterations = model.solver_stats.num_iters
        return BackendAnswer(
            status=model.status,
            x=x.value,
            z=rows[0].dual_value if rows else None,
            y=equalities[0].dual_value if equalities else None,
            counters={"iterations": int(iterations)} if iterations else {},
        )
