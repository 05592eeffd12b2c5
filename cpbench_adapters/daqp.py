"""DAQP, called directly: qpsolvers drops its exit flag and its iteration count."""

from __future__ import annotations

import numpy as np

from cpbench.solvers.base import Claim, SolverSpec, Trait, register
from cpbench_adapters.qp_backend import BackendAnswer, QPBackend
from cpbench_adapters.qp_standard_form import StandardForm
from cpbench_adapters.qp_tolerances import Settings

_FLAGS = {
    1: "optimal",
    2: "soft optimal",
    -1: "infeasible",
    -2: "cycling",
    -3: "unbounded",
    -4: "iteration limit",
    -5: "not convex",
    -6: "initial working set overdetermined",
    -7: "time limit",
}
_EQUALITY = 5


@register
class Daqp(QPBackend):
    spec = SolverSpec(
        name="daqp",
        node="qp",
        summary="dual active set with LDLᵀ updates, dense",
        method="dual active set",
        citation="Arnström, Bemporad and Axehill, A dual active-set solver for embedded QP, IEEE TAC 67 (2022)",
        requires=("daqp",),
        install="pip install 'cpbench[backends]'",
        licence="MIT",
        traits=frozenset({Trait.DETERMINISTIC}),
        quick=True,
        known_failures={
            "tolerance-1e-08": "calls a degenerate LP infeasible when primal_tol is 1e-9; solves it at 1e-7",
            "check_claims_hold_in_other_units": "claims units of 1e-8 to 1e8 in one QP solved, error 0.3",
            "case-z-unit-1e+08": "claims a QP with entries of Q of 1e-15 solved, error 0.57, whatever eps_prox",
        },
    )
    sparse = False
    claims = {
        "optimal": Claim.SOLVED,
        "infeasible": Claim.INFEASIBLE,
        "unbounded": Claim.UNBOUNDED,
        "iteration limit": Claim.MAX_ITER,
        "time limit": Claim.MAX_ITER,
    }

    def call(self, form: StandardForm, settings: Settings) -> BackendAnswer:
        import daqp

        n = form.q.size
        rows = [M for M in (form.G, form.A) if M is not None]
        lb, ub, h, b = (np.zeros(0) if v is None else v for v in (form.lb, form.ub, form.h, form.b))
        bounds = lb.size
        upper = np.concatenate([ub, h, b])
        lower = np.concatenate([lb, np.full(h.size, -np.inf), b])
        sense = np.zeros(upper.size, dtype=np.intc)
        sense[bounds + h.size :] = _EQUALITY
        # DAQP counts an absent bound as 1e30
        upper, lower = np.minimum(upper, 1e30), np.maximum(lower, -1e30)
        matrix = np.vstack(rows) if rows else np.zeros((0, n))
        x, _, flag, info = daqp.solve(form.P.copy(), form.q.copy(), matrix, upper, lower, sense, **settings)
        lam = np.asarray(info["lam"])
        return BackendAnswer(
            status=_FLAGS.get(flag, f"exit flag {flag}"),
            x=x,
            z_box=lam[:bounds],
            z=lam[bounds : bounds + h.size],
            y=lam[bounds + h.size :],
            counters={"iterations": int(info["iterations"])},
        )
