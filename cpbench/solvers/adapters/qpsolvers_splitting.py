"""Splitting and augmented-Lagrangian QP backends, called through qpsolvers: osqp, proxqp, qpalm, scs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cpbench.solvers.adapters.qp_backend import QPSolversBackend
from cpbench.solvers.adapters.qp_tolerances import Settings
from cpbench.solvers.base import Claim, SolverSpec, Trait, register


@register
class Osqp(QPSolversBackend):
    spec = SolverSpec(
        name="osqp",
        node="qp",
        summary="operator splitting (ADMM), one factorization, sparse",
        method="ADMM",
        citation="Stellato, Banjac, Goulart, Bemporad and Boyd, Math. Prog. Comp. 12 (2020)",
        requires=("qpsolvers", "osqp"),
        install="pip install qpsolvers osqp",
        licence="Apache-2.0",
        traits=frozenset({Trait.SPARSE}),
        quick=True,
    )
    claims = {
        "solved": Claim.SOLVED,
        "solved inaccurate": Claim.INACCURATE,
        "primal infeasible": Claim.INFEASIBLE,
        "primal infeasible inaccurate": Claim.INFEASIBLE,
        "dual infeasible": Claim.UNBOUNDED,
        "dual infeasible inaccurate": Claim.UNBOUNDED,
        "maximum iterations reached": Claim.MAX_ITER,
        "run time limit reached": Claim.MAX_ITER,
    }

    def status(self, solution: Any, settings: Settings) -> str:
        return solution.extras["info"].status

    def counters(self, solution: Any) -> Mapping[str, int]:
        return {"iterations": int(solution.extras["info"].iter)}


@register
class ProxQP(QPSolversBackend):
    spec = SolverSpec(
        name="proxqp",
        node="qp",
        summary="primal-dual augmented Lagrangian with proximal heuristics, dense and sparse",
        method="augmented Lagrangian",
        citation="Bambade, El-Kazdadi, Taylor and Carpentier, ProxQP, RSS 2022",
        requires=("qpsolvers", "proxsuite"),
        install="pip install cpbench[backends]",
        licence="BSD-2-Clause",
        traits=frozenset({Trait.SPARSE}),  # last bits depend on where the arrays lie: 6 of 60 answers to a QP of 10
        known_failures={
            "planted-lp": "calls a solvable degenerate LP primal infeasible",
            "maros-meszaros-HS118": "calls it primal infeasible",
        },
    )
    sparse = None
    claims = {
        "PROXQP_SOLVED": Claim.SOLVED,
        "PROXQP_SOLVED_CLOSEST_PRIMAL_FEASIBLE": Claim.INFEASIBLE,
        "PROXQP_PRIMAL_INFEASIBLE": Claim.INFEASIBLE,
        "PROXQP_DUAL_INFEASIBLE": Claim.UNBOUNDED,
        "PROXQP_MAX_ITER_REACHED": Claim.MAX_ITER,
    }

    def status(self, solution: Any, settings: Settings) -> str:
        return solution.extras["info"].status.name

    def counters(self, solution: Any) -> Mapping[str, int]:
        return {"iterations": int(solution.extras["info"].iter)}


@register
class Qpalm(QPSolversBackend):
    spec = SolverSpec(
        name="qpalm",
        node="qp",
        summary="proximal augmented Lagrangian with semismooth Newton, sparse",
        method="augmented Lagrangian",
        citation="Hermans, Themelis and Patrinos, QPALM, Math. Prog. Comp. 14 (2022)",
        requires=("qpsolvers", "qpalm"),
        install="pip install qpsolvers qpalm",
        licence="LGPL-3.0-or-later",
        traits=frozenset({Trait.SPARSE, Trait.DETERMINISTIC}),
        known_failures={
            "case-many-units": "claims a QP with entries of Q from 1e-8 to 1e8 solved at a relative gap of 4e-3: "
            "its test has no gap",
        },
    )
    claims = {
        "solved": Claim.SOLVED,
        "primal infeasible": Claim.INFEASIBLE,
        "dual infeasible": Claim.UNBOUNDED,
        "maximum iterations reached": Claim.MAX_ITER,
        "time limit exceeded": Claim.MAX_ITER,
    }

    def status(self, solution: Any, settings: Settings) -> str:
        return solution.extras["info"].status

    def counters(self, solution: Any) -> Mapping[str, int]:
        return {"iterations": int(solution.extras["info"].iter)}


@register
class Scs(QPSolversBackend):
    spec = SolverSpec(
        name="scs",
        node="qp",
        summary="splitting conic solver: ADMM on the homogeneous embedding, sparse",
        method="ADMM",
        citation="O'Donoghue, Operator splitting for a homogeneous embedding of the LCP, SIAM J. Optim. 31 (2021)",
        requires=("qpsolvers", "scs"),
        install="pip install qpsolvers scs",
        licence="MIT",
        traits=frozenset({Trait.SPARSE, Trait.DETERMINISTIC}),
    )
    needs_inequality = True  # qpsolvers answers an unconstrained QP with SciPy's LSQR in its name
    words = {
        1: "solved",
        2: "solved_inaccurate",
        -1: "unbounded",
        -2: "infeasible",
        -3: "indeterminate",
        -4: "failed",
        -6: "unbounded_inaccurate",
        -7: "infeasible_inaccurate",
    }
    claims = {
        "solved": Claim.SOLVED,
        "solved_inaccurate": Claim.INACCURATE,
        "infeasible": Claim.INFEASIBLE,
        "infeasible_inaccurate": Claim.INFEASIBLE,
        "unbounded": Claim.UNBOUNDED,
        "unbounded_inaccurate": Claim.UNBOUNDED,
    }

    def status(self, solution: Any, settings: Settings) -> str:
        value = int(solution.extras["status_val"])
        return self.words.get(value, f"status {value}")

    def counters(self, solution: Any) -> Mapping[str, int]:
        return {"iterations": int(solution.extras["iter"])}
