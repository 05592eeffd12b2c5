"""The test by which each QP backend ends, and its own tolerances: what `qp_tolerances` translates into.

Defaults are those of the versions that the table of the backends was made with (`pyproject.toml`); ∞ where a test is
off by default.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping

from cpbench.formulations.programs import QP
from cpbench.foundation.matrices import max_abs
from cpbench.solvers.stopping import Stopping

ABSOLUTE = "absolute where data are below 1: it may pass too early, by the factor that they are below it"
NORMS = "one norm over all rows, where cpbench measures each connected part by its own size"
ZEROS = "the sizes below which it takes a number for 0, which it does not tell"
_EIGHT = {"tol_feas": 1e-8, "tol_gap_abs": 1e-8, "tol_gap_rel": 1e-8}
_PROOFS = {"tol_infeas_abs": 1e-8, "tol_infeas_rel": 1e-8}
_CVXOPT = {"feastol": 1e-7, "abstol": 1e-7, "reltol": 1e-6}
_GAP = {"eps_duality_gap_abs": math.inf, "eps_duality_gap_rel": math.inf}
_ACTIVE_SET = "violation of the rows, absolute; stationarity holds to rounding"


def _of(test: str, differs: str, **defaults: float) -> Stopping:
    return Stopping(test=test, differs=differs, defaults=defaults)


TESTS: Mapping[str, Stopping] = {
    "casadi-qpoases": _of("end of its homotopy, relative", "", terminationTolerance=5e6 * 2.0**-52),
    "clarabel": _of("residuals over max(1, norms of data and iterates), gap", ABSOLUTE, **_EIGHT, **_PROOFS),
    "copt": _of("feasibility, absolute", ABSOLUTE, FeasTol=1e-6, DualTol=1e-6),
    "cvxopt": _of("2-norms of residuals over max(1, norms of data), gap", ABSOLUTE, **_CVXOPT),
    "daqp": _of(_ACTIVE_SET, ABSOLUTE, primal_tol=1e-6, dual_tol=1e-12),
    "gurobi": _of("feasibility, absolute; gap", ABSOLUTE, FeasibilityTol=1e-6, OptimalityTol=1e-6, BarConvTol=1e-8),
    "highs": _of("feasibility, absolute", ABSOLUTE, primal_feasibility_tolerance=1e-7, dual_feasibility_tolerance=1e-7),
    "mosek": _of(
        "residuals over the data, gap",
        NORMS,
        intpnt_qo_tol_pfeas=1e-8,
        intpnt_qo_tol_dfeas=1e-8,
        intpnt_qo_tol_rel_gap=1e-8,
        intpnt_qo_tol_infeas=1e-12,
    ),
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
    "pyqpmad": _of(_ACTIVE_SET, ABSOLUTE, tolerance=1e-12),
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
