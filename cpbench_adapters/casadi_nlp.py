"""Nonlinear programs by CasADi's nlpsol: Ipopt, and CasADi's own SQP method with its active-set QP solver."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.programs import NLP
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register
from cpbench.solvers.stopping import Stopping, no_looser
from cpbench_adapters.casadi_ipopt import CITATION, INSTALL, IPOPT, LEAST, LICENCE, too_large
from cpbench_adapters.casadi_ipopt import CLAIMS as IPOPT_CLAIMS
from cpbench_adapters.nlp_answers import ABSOLUTE, answer, concluded, small_program

SQP_CLAIMS = {
    "Solve_Succeeded": Claim.SOLVED,
    "Maximum_Iterations_Exceeded": Claim.MAX_ITER,
    "Infeasible_Problem_Detected": Claim.INFEASIBLE,
}


@dataclass(frozen=True)
class NLPOptions:
    """Options of casadi-ipopt-nlp, casadi-sqpmethod. `max_iterations` : of the guest, unless the budget bounds them."""

    max_iterations: int = 3000


@dataclass(frozen=True)
class CasadiProgram:
    """The problem and CasADi's solver for it."""

    problem: NLP
    solver: Any


class CasadiNLP(Solver):
    """x, f and (g, h) as one expression of CasADi, its multipliers with the other sign: L = f + lam_gᵀ(g, h)."""

    plugin: ClassVar[str]
    claims: ClassVar[Mapping[str, Claim]]

    share: ClassVar[float]
    """Part of our tolerance that it is asked for."""
    defaults: ClassVar[Mapping[str, float]]
    """Its tolerances, and their own values."""

    def stopping(self, tolerance: float, problem: NLP | None = None) -> Stopping:
        settings = dict.fromkeys(self.defaults, max(self.share * tolerance, LEAST))
        test = "its optimality conditions; solved is claimed where the node's error meets our tolerance"
        settings = no_looser(settings, self.defaults)
        return Stopping(test=test, settings=settings, defaults=self.defaults, differs=ABSOLUTE, factor=math.inf)

    @abstractmethod
    def settings(self, limit: int, budget: Budget) -> Mapping[str, Any]:
        """Return the options of CasADi's solver."""

    def obstacle(self, problem: NLP) -> str | None:
        n = problem.start.size
        if n == 0:
            return "has no unknown (n = 0): CasADi's solvers refuse an empty program"
        return too_large(n)

    def setup(self, problem: NLP, budget: Budget, options: NLPOptions) -> CasadiProgram:
        import casadi as ca

        z = ca.SX.sym("z", problem.start.size)
        program = {"x": z, "f": problem.f.sx(z), "g": ca.vertcat(problem.g.sx(z), problem.h.sx(z))}
        limit = budget.iterations or options.max_iterations
        quiet = {"print_time": False, "error_on_fail": False, "show_eval_warnings": False}
        return CasadiProgram(
            problem, ca.nlpsol("program", self.plugin, program, quiet | dict(self.settings(limit, budget)))
        )

    def warmup(self) -> None:
        self.run(small_program())

    def solve(
        self,
        prepared: CasadiProgram,
        budget: Budget,
        options: NLPOptions,
        start: Any | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        problem, m = prepared.problem, prepared.problem.g.rows
        first = problem.at_start if start is None else np.clip(start.z, problem.lb, problem.ub)
        upper = np.where(np.arange(m + problem.h.rows) < m, np.inf, 0.0)
        result = prepared.solver(x0=first, lbx=problem.lb, ubx=problem.ub, lbg=np.zeros(upper.size), ubg=upper)
        stats = prepared.solver.stats()
        z, own = (np.asarray(result[name], dtype=float).ravel() for name in ("x", "lam_g"))
        point = answer(problem, z, -own[:m], -own[m:]) if np.isfinite(np.concatenate([z, own])).all() else None
        ended = self.claims.get(stats["return_status"], Claim.FAILED)
        counters = {"iterations": max(int(stats["iter_count"]), 0)}
        return concluded(problem, point, budget, ended, stats["return_status"], counters)


def _spec(name: str, summary: str, method: str, citation: str, licence: str, *, quick: bool = False) -> SolverSpec:
    return SolverSpec(
        name=name,
        node="nlp",
        summary=summary,
        method=method,
        citation=f"{citation}; {CITATION}",
        requires=("casadi",),
        install=INSTALL,
        licence=licence,
        traits=frozenset({Trait.SPARSE, Trait.DETERMINISTIC}),
        options=NLPOptions,
        quick=quick,
    )


@register
class IpoptNLP(CasadiNLP):
    """Ipopt with exact Hessians. Tolerance: `tol`, on its scaled conditions, a hundredth of ours; it relaxes the
    bounds by a hundredth of ours (there may be no interior) and honours them in the end."""

    plugin, claims = "ipopt", IPOPT_CLAIMS
    share = 0.01
    defaults: ClassVar = {**IPOPT, "dual_inf_tol": 1.0, "constr_viol_tol": 1e-4, "compl_inf_tol": 1e-4}
    spec: ClassVar[SolverSpec] = _spec(
        "casadi-ipopt-nlp",
        "Ipopt through CasADi, exact Hessians",
        "interior point",
        "Wächter and Biegler, Math. Prog. 106 (2006)",
        "EPL-2.0 (Ipopt), LGPL-3.0-or-later (CasADi)",
        quick=True,
    )

    def settings(self, limit: int, budget: Budget) -> Mapping[str, Any]:
        own: dict[str, Any] = {
            "print_level": 0,
            "sb": "yes",
            **self.stopping(budget.tolerance).settings,
            "honor_original_bounds": "yes",
            "max_iter": limit,
        }
        if math.isfinite(budget.seconds):
            own["max_wall_time"] = budget.seconds
        return {"ipopt": own}


@register
class SQPMethodNLP(CasadiNLP):
    """CasADi's sqpmethod with exact Hessians, made convex by clipping eigenvalues, and its sparse active-set QP solver.
    Tolerance: `tol_pr` and `tol_du`, in the ∞-norm, a tenth of ours. It has no limit of time."""

    plugin, claims = "sqpmethod", SQP_CLAIMS
    share = 0.1
    defaults: ClassVar = {"tol_pr": 1e-6, "tol_du": 1e-6}
    spec: ClassVar[SolverSpec] = _spec(
        "casadi-sqpmethod",
        "CasADi's SQP with its active-set QP solver, exact Hessians",
        "sequential quadratic programming",
        "Andersson and Rawlings 2018, IFAC-PapersOnLine 51",
        LICENCE,
    )

    def settings(self, limit: int, budget: Budget) -> Mapping[str, Any]:
        silent = {"print_header": False, "print_iter": False, "print_info": False, "error_on_fail": False}
        return {
            "qpsol": "qrqp",
            "qpsol_options": silent,
            "print_header": False,
            "print_iteration": False,
            "print_status": False,
            **self.stopping(budget.tolerance).settings,
            "max_iter": limit,
            "convexify_strategy": "eigen-clip",
        }
