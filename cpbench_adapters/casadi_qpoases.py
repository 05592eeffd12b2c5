"""qpOASES through CasADi: a parametric active set that walks from a QP it has solved to the one that is asked."""

from __future__ import annotations

import numpy as np

from cpbench.solvers.base import Claim, SolverSpec, Trait, register
from cpbench_adapters.casadi_ipopt import CITATION, INSTALL
from cpbench_adapters.qp_backend import BackendAnswer, QPBackend
from cpbench_adapters.qp_standard_form import StandardForm
from cpbench_adapters.qp_tolerances import Settings


@register
class CasadiQPOASES(QPBackend):
    """qpOASES through `casadi.conic` with the plugin qpoases, dense; the object is made with the tolerances, in
    `solve`."""

    spec = SolverSpec(
        name="casadi-qpoases",
        node="qp",
        summary="qpOASES through CasADi: online active set strategy, dense",
        method="active set",
        citation=f"Ferreau et al., Math. Prog. Comp. 6 (2014); {CITATION}",
        requires=("casadi",),
        install=INSTALL,
        licence="LGPL-2.1-or-later",
        traits=frozenset({Trait.DETERMINISTIC}),
        known_failures={
            "case-z-unit-1e-08": "Successful return at error 1.3e-4: its zero tolerances are absolute, z is 1e-8 here",
            "check_claims_hold_in_other_units": "Successful return at error 1.0 where Q and p are "
            "in 1e-6 of their unit: absolute zero tolerances, by four cases",
            "planted-unconstrained-psd": "calls a convex, solvable QP with singular Q and no constraints unbounded",
            "planted-box-psd": "initialisation fails on a singular Q with bounds only, error 0.87",
        },
    )
    sparse = False
    prints = True
    claims = {
        "Successful return.": Claim.SOLVED,
        "Initial QP could not be solved due to infeasibility!": Claim.INFEASIBLE,
        "Initial QP could not be solved due to unboundedness!": Claim.UNBOUNDED,
        "Maximum number of working set recalculations performed.": Claim.MAX_ITER,
    }

    def call(self, form: StandardForm, settings: Settings) -> BackendAnswer:
        import casadi as ca

        n = form.q.size
        rows = [M for M in (form.G, form.A) if M is not None]
        a = np.vstack(rows) if rows else np.zeros((0, n))
        h = np.zeros(0) if form.h is None else form.h
        b = np.zeros(0) if form.b is None else form.b
        structure = {"h": ca.Sparsity.dense(n, n), "a": ca.Sparsity.dense(*a.shape)}
        solver = ca.conic("qpoases", "qpoases", structure, {"printLevel": "none", "error_on_fail": False} | settings)
        result = solver(
            h=form.P,
            g=form.q,
            a=a,
            lba=np.concatenate([np.full(h.size, -np.inf), b]),
            uba=np.concatenate([h, b]),
            lbx=-np.inf if form.lb is None else form.lb,
            ubx=np.inf if form.ub is None else form.ub,
        )
        stats = solver.stats()
        multipliers = np.asarray(result["lam_a"]).ravel()
        return BackendAnswer(
            status=stats["return_status"],
            x=np.asarray(result["x"]).ravel(),
            z=multipliers[: h.size],
            y=multipliers[h.size :],
            z_box=np.asarray(result["lam_x"]).ravel(),
            counters={"iterations": int(stats["iter_count"])},
        )
