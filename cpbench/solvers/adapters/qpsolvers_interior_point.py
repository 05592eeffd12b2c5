"""Interior-point QP backends, called through qpsolvers: clarabel, cvxopt and its fork kvxopt, piqp, qtqp, sip."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import scipy.sparse as sp

from cpbench.formulations.qp import QP
from cpbench.solvers.adapters.qp_backend import QPSolversBackend
from cpbench.solvers.adapters.qp_standard_form import StandardForm
from cpbench.solvers.adapters.qp_tolerances import Settings
from cpbench.solvers.base import Budget, Claim, SolverSpec, Trait, register


@register
class Clarabel(QPSolversBackend):
    spec = SolverSpec(
        name="clarabel",
        node="qp",
        summary="interior point on the homogeneous embedding, sparse, in Rust",
        method="interior point",
        citation="Goulart and Chen, Clarabel: an interior-point solver for conic programs, arXiv 2405.12762",
        requires=("qpsolvers", "clarabel"),
        install="pip install qpsolvers clarabel",
        licence="Apache-2.0",
        traits=frozenset({Trait.SPARSE, Trait.DETERMINISTIC}),
        quick=True,
    )
    bounds_as_rows = True
    needs_inequality = True  # qpsolvers answers an unconstrained QP with SciPy's LSQR in its name
    claims = {
        "Solved": Claim.SOLVED,
        "AlmostSolved": Claim.INACCURATE,
        "PrimalInfeasible": Claim.INFEASIBLE,
        "AlmostPrimalInfeasible": Claim.INFEASIBLE,
        "DualInfeasible": Claim.UNBOUNDED,
        "AlmostDualInfeasible": Claim.UNBOUNDED,
        "MaxIterations": Claim.MAX_ITER,
        "MaxTime": Claim.MAX_ITER,
    }

    def status(self, solution: Any, settings: Settings) -> str:
        return str(solution.extras["status"])


@register
class Cvxopt(QPSolversBackend):
    spec = SolverSpec(
        name="cvxopt",
        node="qp",
        summary="primal-dual path following with Nesterov-Todd scaling, dense and sparse",
        method="interior point",
        citation="Vandenberghe, The CVXOPT linear and quadratic cone program solvers, 2010",
        requires=("qpsolvers", "cvxopt"),
        install="pip install cpbench[gpl]",
        licence="GPL-3.0-or-later",
        traits=frozenset({Trait.SPARSE, Trait.DETERMINISTIC}),
        known_failures={
            "planted-unconstrained-psd": "refuses rank([Q; C; A]) < n by an exception",
        },
    )
    sparse = None
    bounds_as_rows = True
    needs_inequality = True  # without one it solves a single KKT system, wrongly where Q is singular (HS52: error 0.5)
    claims = {"optimal": Claim.SOLVED, "iteration limit": Claim.MAX_ITER}

    def status(self, solution: Any, settings: Settings) -> str:
        # "unknown" is all it says of a singular KKT matrix and of the iteration limit alike
        stopped = solution.extras.get("iterations", 0) >= settings["maxiters"]
        return "iteration limit" if stopped and not solution.found else solution.extras["status"]

    def counters(self, solution: Any) -> Mapping[str, int]:
        return {"iterations": int(solution.extras["iterations"])} if "iterations" in solution.extras else {}


@register
class Kvxopt(Cvxopt):
    spec = dataclasses.replace(
        Cvxopt.spec,
        name="kvxopt",
        summary="fork of CVXOPT with more of SuiteSparse: path following with Nesterov-Todd scaling",
        citation="Vandenberghe, The CVXOPT linear and quadratic cone program solvers, 2010; kvxopt",
        requires=("qpsolvers", "kvxopt"),
        by_default=False,  # the algorithm of cvxopt
    )


@register
class Piqp(QPSolversBackend):
    spec = SolverSpec(
        name="piqp",
        node="qp",
        summary="interior point with the proximal method of multipliers, dense and sparse",
        method="interior point",
        citation="Schwan, Jiang, Kuhn and Jones, PIQP: a proximal interior-point QP solver, CDC 2023",
        requires=("qpsolvers", "piqp"),
        install="pip install cpbench[backends]",
        licence="BSD-2-Clause",
        traits=frozenset({Trait.SPARSE, Trait.DETERMINISTIC}),
        quick=True,
    )
    sparse = None
    claims = {
        "PIQP_SOLVED": Claim.SOLVED,
        "PIQP_PRIMAL_INFEASIBLE": Claim.INFEASIBLE,
        "PIQP_DUAL_INFEASIBLE": Claim.UNBOUNDED,
        "PIQP_MAX_ITER_REACHED": Claim.MAX_ITER,
    }

    def status(self, solution: Any, settings: Settings) -> str:
        return solution.extras["info"].status.name

    def counters(self, solution: Any) -> Mapping[str, int]:
        return {"iterations": int(solution.extras["info"].iter)}


@register
class Qtqp(QPSolversBackend):
    spec = SolverSpec(
        name="qtqp",
        node="qp",
        summary="predictor-corrector interior point on the homogeneous embedding, sparse, in Python",
        method="interior point",
        citation="O'Donoghue, QTQP: an interior-point solver for QPs, github.com/google-deepmind/qtqp",
        requires=("qpsolvers", "qtqp"),
        install="pip install cpbench[qp]",
        licence="Apache-2.0",
        traits=frozenset({Trait.SPARSE, Trait.DETERMINISTIC}),
    )
    bounds_as_rows = True
    needs_inequality = True  # qpsolvers does not call it without one
    claims = {
        "solved": Claim.SOLVED,
        "almost_solved": Claim.INACCURATE,
        "infeasible": Claim.INFEASIBLE,
        "unbounded": Claim.UNBOUNDED,
        "hit_max_iter": Claim.MAX_ITER,
    }

    def status(self, solution: Any, settings: Settings) -> str:
        return str(solution.extras["status"].value)

    def counters(self, solution: Any) -> Mapping[str, int]:
        stats = solution.extras["stats"]  # one entry an iteration, the start first
        return {"iterations": int(stats[-1]["iter"])} if stats else {}


@register
class Sip(QPSolversBackend):
    """SIP, whose factorization is ordered by CVXOPT's AMD where that is installed, else by reverse Cuthill-McKee."""

    spec = SolverSpec(
        name="sip",
        node="qp",
        summary="barrier augmented Lagrangian: interior point with penalised equalities, sparse",
        method="interior point",
        citation="Sousa-Pinto, SIP, github.com/joaospinto/sip_qp",
        requires=("qpsolvers", "sip_qp_python"),
        install="pip install cpbench[qp]",
        licence="MIT",
        traits=frozenset({Trait.SPARSE, Trait.DETERMINISTIC}),
    )
    claims = {
        "SOLVED": Claim.SOLVED,
        "SUBOPTIMAL": Claim.INACCURATE,
        "LOCALLY_INFEASIBLE": Claim.INFEASIBLE,
        "ITERATION_LIMIT": Claim.MAX_ITER,
        "TIMEOUT": Claim.MAX_ITER,
    }

    def setup(self, problem: QP, budget: Budget, options: Any) -> StandardForm:
        form = super().setup(problem, budget, options)
        # it refuses a Q that is symmetric to rounding only
        return (
            form if (form.P != form.P.T).nnz == 0 else dataclasses.replace(form, P=sp.csc_matrix(form.P + form.P.T) / 2)
        )

    def status(self, solution: Any, settings: Settings) -> str:
        return solution.extras["sip_output"].exit_status.name

    def counters(self, solution: Any) -> Mapping[str, int]:
        return {"iterations": int(solution.extras["sip_output"].num_iterations)}
