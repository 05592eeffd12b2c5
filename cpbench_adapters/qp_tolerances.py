"""The test by which each QP backend ends, and the one table that turns our budget into its settings.

Our tolerance ε asks every judged number of a QP answer (stationarity, primal and dual violation, duality gap, in
the ∞-norm, on the problem as it was asked) for min(absolute, relative) ≤ ε, that is error ≤ ε·max(1, scale).
No tolerance is looser than the backend's own default (`TESTS`: those of the versions that `pyproject.toml` asks for,
∞ where a test is off by default); what a backend lacks (a time limit, a tolerance)
is said in its row.

A criterion error ≤ a + r·scale with a = r = ε/2 implies ours. The factors below are smaller where a backend's
scale differs from ours (a norm of the whole of Aᵀλ + Cᵀμ + ν instead of its terms, a 2-norm, a preconditioned
problem) and extra accuracy is cheap.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

from cpbench.formulations.programs import QP
from cpbench.foundation.matrices import max_abs
from cpbench.solvers.base import Budget
from cpbench.solvers.stopping import Stopping, no_looser

Settings: TypeAlias = dict[str, Any]

INFEASIBILITY = 1e-7
"""Largest tolerance on a proof of infeasibility or unboundedness, whatever ε: OSQP's default 1e-4 calls PRIMALC1
unbounded, which it is not."""


ABSOLUTE = "absolute where data are below 1: it may pass too early, by the factor that they are below it"
REGULARIZED = f"{ABSOLUTE}; 1e-7 on the diagonal of Q (qp_regularization_value) moves an optimum that is large"
OVER_X = f"{ABSOLUTE}; ‖x‖ is in the scale of the dual residual, which passes too early where x is large"
ZEROS = "the sizes below which it takes a number for 0, which it does not tell"
_EIGHT = {"tol_feas": 1e-8, "tol_gap_abs": 1e-8, "tol_gap_rel": 1e-8}
_PROOFS = {"tol_infeas_abs": 1e-8, "tol_infeas_rel": 1e-8}
_CVXOPT = {"feastol": 1e-7, "abstol": 1e-7, "reltol": 1e-6}
_GAP = {"eps_duality_gap_abs": math.inf, "eps_duality_gap_rel": math.inf}
_DAQP = {"primal_tol": 1e-6, "dual_tol": 1e-12}
_CLARABEL = "residuals over max(1, norms of data and iterates), gap"
_MOREAU = "violation of the rows, absolute; of more than 500 unknowns or rows as moreau-ipm"
_ACTIVE_SET = "violation of the rows, absolute; stationarity holds to rounding"


def _of(test: str, differs: str, **defaults: float) -> Stopping:
    return Stopping(test=test, differs=differs, defaults=defaults)


TESTS: Mapping[str, Stopping] = {
    "casadi-qpoases": _of("end of its homotopy, relative", "", terminationTolerance=5e6 * 2.0**-52),
    "clarabel": _of(_CLARABEL, ABSOLUTE, **_EIGHT, **_PROOFS),
    "copt": _of("feasibility, absolute", ABSOLUTE, FeasTol=1e-6, DualTol=1e-6),
    "cvxopt": _of("2-norms of residuals over max(1, norms of data), gap", ABSOLUTE, **_CVXOPT),
    "daqp": _of(_ACTIVE_SET, ABSOLUTE, **_DAQP),
    "gurobi": _of("feasibility, absolute; gap", ABSOLUTE, FeasibilityTol=1e-6, OptimalityTol=1e-6, BarConvTol=1e-8),
    "highs": _of(
        "feasibility, absolute", REGULARIZED, primal_feasibility_tolerance=1e-7, dual_feasibility_tolerance=1e-7
    ),
    "moreau": _of(_MOREAU, ABSOLUTE, **_DAQP, **_EIGHT, **_PROOFS),
    "moreau-ipm": _of(_CLARABEL, ABSOLUTE, **_EIGHT, **_PROOFS),
    "osqp": _of(
        "residuals and gap in the ∞-norm, absolute + relative",
        ABSOLUTE,
        eps_abs=1e-3,
        eps_rel=1e-3,
        eps_prim_inf=1e-4,
        eps_dual_inf=1e-4,
    ),
    "piqp": _of(
        "residuals and gap in the ∞-norm, absolute + relative",
        ABSOLUTE,
        eps_abs=1e-8,
        eps_rel=1e-9,
        eps_duality_gap_abs=1e-8,
        eps_duality_gap_rel=1e-9,
    ),
    "proxqp": _of("residuals in the ∞-norm, absolute; gap", ABSOLUTE, eps_abs=1e-5, eps_rel=0.0, **_GAP),
    "qoco": dataclasses.replace(
        _of("residuals in the ∞-norm and sᵀz, absolute + relative", OVER_X, abstol=1e-7, reltol=1e-7), factor=math.inf
    ),
    "qpalm": _of(
        "residuals in the ∞-norm, absolute + relative; no gap",
        ABSOLUTE,
        eps_abs=1e-4,
        eps_rel=1e-4,
        eps_prim_inf=1e-5,
        eps_dual_inf=1e-5,
    ),
    "qtqp": _of("2-norms of residuals over max(1, norms of data and iterates), gap", ABSOLUTE, **_EIGHT, **_PROOFS),
    "quadprog": dataclasses.replace(_of("exact active set: no tolerance", ZEROS), factor=math.inf),
    "scs": _of(
        "residuals and gap in the ∞-norm, absolute + relative", ABSOLUTE, eps_abs=1e-4, eps_rel=1e-4, eps_infeas=1e-7
    ),
    "sip": _of("residuals and gap, absolute or relative", ABSOLUTE, eps_abs=1e-8, eps_rel=1e-9),
}
"""Test and defaults by the backend's name; `settings` are left out, which depend on the tolerance."""


def excess(problem: QP) -> float:
    """Return by what an error relative to the data may exceed an absolute tolerance: 1 over the smallest size, below 1,
    of objective, constants and bounds."""
    bounds = [value[abs(value) < math.inf] for value in (problem.lb, problem.ub)]
    sizes = [max_abs(value) for value in (problem.p, problem.b, problem.d, *bounds)]
    return 1.0 / min([1.0, *(size for size in sizes if size > 0)])


def translate(backend: str, budget: Budget) -> Settings:
    """Return settings of `backend` for `budget`; raises KeyError on a backend that is not in the table."""
    settings = TABLE[backend](budget)
    own = {name: settings[name] for name in TESTS[backend].defaults}
    return settings | no_looser(own, TESTS[backend].defaults)


def stopping(backend: str, tolerance: float, problem: QP | None = None) -> Stopping:
    """Return the test of `backend` and what it is asked for; raises KeyError on a backend that is not in the table."""
    test, settings = TESTS[backend], translate(backend, Budget(tolerance=tolerance))
    return dataclasses.replace(
        test,
        settings={name: settings[name] for name in test.defaults},
        factor=excess(problem) if problem is not None and test.differs == ABSOLUTE else test.factor,
    )


def _limits(budget: Budget, iterations: str, default: int, seconds: str = "") -> Settings:
    """Return the iteration limit, and the time limit where the backend has one and the budget's is finite."""
    limits: Settings = {iterations: default if budget.iterations is None else budget.iterations}
    if seconds and math.isfinite(budget.seconds):
        limits[seconds] = budget.seconds
    return limits


def _proofs(primal: str, dual: str, e: float) -> Settings:
    return {primal: min(e, INFEASIBILITY), dual: min(e, INFEASIBILITY)}


def _clarabel(budget: Budget) -> Settings:
    """Return residuals relative to max(1, norms of data and iterates), gap absolute or relative: a tenth of ε, at the
    price of one more iteration of the quadratic end phase. One thread: of more than a few thousand entries it would
    start another."""
    e = 0.1 * budget.tolerance
    return (
        {"tol_feas": e, "tol_gap_abs": e, "tol_gap_rel": e, "max_threads": 1}
        | _proofs("tol_infeas_abs", "tol_infeas_rel", e)
        | _limits(budget, "max_iter", 200, "time_limit")
    )


def _moreau_ipm(budget: Budget) -> Settings:
    """Return Clarabel's criteria, which its interior point has; it takes one thread by itself."""
    return {name: value for name, value in _clarabel(budget).items() if name != "max_threads"} | {"solver": "ipm"}


def _moreau(budget: Budget) -> Settings:
    """Return those, and DAQP's for its active set, which the package takes by itself up to 500 unknowns and rows (twice
    as many rows as unknowns), and which has no time limit."""
    own = {"primal_tol": 0.1 * budget.tolerance, "dual_tol": 1e-12, "solver": "auto"}
    return _moreau_ipm(budget) | own | _limits(budget, "iter_limit", 10_000)


def _qoco(budget: Budget) -> Settings:
    """Return error ≤ abstol + reltol·scale, gap likewise. No time limit."""
    e = 0.1 * budget.tolerance
    return {"abstol": e, "reltol": e} | _limits(budget, "max_iters", 200)


def _piqp(budget: Budget) -> Settings:
    """Return error ≤ eps_abs + eps_rel·scale, in the ∞-norm, gap likewise. No time limit."""
    e = 0.1 * budget.tolerance
    gap = {"check_duality_gap": True, "eps_duality_gap_abs": e, "eps_duality_gap_rel": e}
    return {"eps_abs": e, "eps_rel": e} | gap | _limits(budget, "max_iter", 250)


def _cvxopt(budget: Budget) -> Settings:
    """Return 2-norm residuals relative to max(1, ‖data‖), gap absolute or relative. No time limit."""
    e = 0.1 * budget.tolerance
    return {"feastol": e, "abstol": e, "reltol": e} | _limits(budget, "maxiters", 200)


def _osqp(budget: Budget) -> Settings:
    """Return error ≤ eps_abs + eps_rel·scale in the ∞-norm; the scale of the dual residual is a norm of the sum
    Aᵀλ + Cᵀμ + ν: a quarter of ε. The gap is only checked when asked for. ADMM may need many cheap iterations."""
    e = 0.25 * budget.tolerance
    gap = {"check_dualgap": True, "raise_error": False}
    return (
        {"eps_abs": e, "eps_rel": e}
        | gap
        | _proofs("eps_prim_inf", "eps_dual_inf", e)
        | _limits(budget, "max_iter", 200_000, "time_limit")
    )


def _scs(budget: Budget) -> Settings:
    """Translate ε as for OSQP, gap included."""
    e = 0.25 * budget.tolerance
    return ({"eps_abs": e, "eps_rel": e, "eps_infeas": min(e, INFEASIBILITY)}) | _limits(
        budget, "max_iters", 200_000, "time_limit_secs"
    )


def _proxqp(budget: Budget) -> Settings:
    """Return absolute residuals only (eps_rel = 0); the gap, checked when asked for, absolute or relative. The signs of
    the multipliers are no part of its test. No time limit."""
    e = 0.1 * budget.tolerance
    gap = {"check_duality_gap": True, "eps_duality_gap_abs": e, "eps_duality_gap_rel": e}
    return {"eps_abs": e, "eps_rel": 0.0} | gap | _limits(budget, "max_iter", 10_000)


def _qpalm(budget: Budget) -> Settings:
    """Return error ≤ eps_abs + eps_rel·scale, no gap: a hundredth of ε (a tenth left gaps of 2e-4 at ε = 1e-6)."""
    e = 0.01 * budget.tolerance
    return (
        {"eps_abs": e, "eps_rel": e}
        | _proofs("eps_prim_inf", "eps_dual_inf", e)
        | _limits(budget, "max_iter", 10_000, "time_limit")
    )


def _daqp(budget: Budget) -> Settings:
    """Translate ε for an active set method: the primal violation that ends it gets a tenth of ε; its multipliers
    keep their sign to 1e-12. A singular Q is regularised by proximal steps of 1e-6, only where needed (that is what
    the minus says): a size that follows ε was measured to be no better."""
    return {"primal_tol": 0.1 * budget.tolerance, "dual_tol": 1e-12, "eps_prox": -1e-6} | _limits(
        budget, "iter_limit", 10_000, "time_limit"
    )


def _highs(budget: Budget) -> Settings:
    """Return absolute feasibilities, 1e-10 at least (HiGHS refuses less). The regularization of the Hessian is the real
    limit: it leaves a stationarity of its size times |z|, and a singular Q fails when it is made too small."""
    e = max(0.1 * budget.tolerance, 1e-10)
    return {
        "primal_feasibility_tolerance": e,
        "dual_feasibility_tolerance": e,
        "qp_regularization_value": min(0.1 * budget.tolerance, 1e-7),
    } | _limits(budget, "qp_iteration_limit", 100_000, "time_limit")


def _qtqp(budget: Budget) -> Settings:
    """Return Clarabel's criteria, 2-norms and ‖x‖ + ‖s‖ in the scale: a tenth of ε. No time limit. The record of its
    iterations is asked for, because it tells their number."""
    e = 0.1 * budget.tolerance
    return (
        {"tol_feas": e, "tol_gap_abs": e, "tol_gap_rel": e, "collect_stats": True}
        | _proofs("tol_infeas_abs", "tol_infeas_rel", e)
        | _limits(budget, "max_iter", 200)
    )


def _sip(budget: Budget) -> Settings:
    """Return residuals and gap, absolute and relative."""
    e = 0.1 * budget.tolerance
    return {"eps_abs": e, "eps_rel": e} | _limits(budget, "max_iterations", 1000, "time_limit")


COMMERCIAL_LEAST = 1e-9
"""Gurobi and COPT refuse feasibilities below this."""


def _gurobi(budget: Budget) -> Settings:
    """Return absolute feasibilities; the gap, relative, ends its barrier. One thread; DualReductions = 0 makes it
    say whether infeasible or unbounded."""
    e = 0.1 * budget.tolerance
    feasibility = max(e, COMMERCIAL_LEAST)
    return (
        {"FeasibilityTol": feasibility, "OptimalityTol": feasibility, "BarConvTol": 0.1 * e}
        | {"Method": 2, "DualReductions": 0, "Threads": 1}
        | _limits(budget, "BarIterLimit", 1000, "TimeLimit")
    )


def _copt(budget: Budget) -> Settings:
    """Return absolute feasibilities; it has no tolerance on the gap of its barrier. One thread."""
    e = max(0.1 * budget.tolerance, COMMERCIAL_LEAST)
    return {"FeasTol": e, "DualTol": e, "Threads": 1} | _limits(budget, "BarIterLimit", 1000, "TimeLimit")


def _qpoases(budget: Budget) -> Settings:
    """Return exact active set: the end of its homotopy, by default at 5e6·eps = 1.1e-9 (relative), follows ε only
    below. `CPUtime` bounds CPU, not wall, seconds."""
    return {"terminationTolerance": min(0.1 * budget.tolerance, 1.1e-9)} | _limits(budget, "nWSR", 10_000, "CPUtime")


def _quadprog(budget: Budget) -> Settings:
    """Return exact active set in machine precision: it has no tolerance, no iteration limit and no time limit."""
    return {}


TABLE: Mapping[str, Callable[[Budget], Settings]] = {
    "casadi-qpoases": _qpoases,
    "clarabel": _clarabel,
    "copt": _copt,
    "cvxopt": _cvxopt,
    "daqp": _daqp,
    "gurobi": _gurobi,
    "highs": _highs,
    "moreau": _moreau,
    "moreau-ipm": _moreau_ipm,
    "osqp": _osqp,
    "piqp": _piqp,
    "proxqp": _proxqp,
    "qoco": _qoco,
    "qpalm": _qpalm,
    "qtqp": _qtqp,
    "quadprog": _quadprog,
    "scs": _scs,
    "sip": _sip,
}
