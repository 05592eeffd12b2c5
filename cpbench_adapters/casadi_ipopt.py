"""Ipopt (through CasADi) on an LCP or MLCP as a nonconvex program: minimise vᵀw subject to w = Kx + k, v, w ≥ 0."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp

from cpbench.formulations import LCP, MLCP
from cpbench.foundation.matrices import Matrix, norm
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register
from cpbench.solvers.stopping import Stopping, no_looser
from cpbench_adapters.scaled_mcp import ScaledMCP, scaled_mcp, small_problem

CITATION = "Andersson et al., CasADi, Math. Prog. Comp. 11 (2019)"
LICENCE = "LGPL-3.0-or-later"
INSTALL = "pip install 'cpbench[casadi]'"
UNKNOWNS = 4000
"""Most unknowns: the Jacobian is built as an expression and factorized by a sparse QR, which fills in."""
CLAIMS = {
    "Solve_Succeeded": Claim.SOLVED,
    "Solved_To_Acceptable_Level": Claim.INACCURATE,
    "Infeasible_Problem_Detected": Claim.INFEASIBLE,
    "Diverging_Iterates": Claim.FAILED,
    "Maximum_Iterations_Exceeded": Claim.MAX_ITER,
    "Maximum_WallTime_Exceeded": Claim.MAX_ITER,
}
"""Its constraints are linear, so that a point where it cannot reduce their violation says that there is none."""
LEAST = 1e-14
"""Least tolerance that Ipopt is asked for: below, it only ends at its acceptable level."""
IPOPT = {"tol": 1e-8, "bound_relax_factor": 1e-8}
"""Ipopt's own tolerances."""
CLOSE = 100.0
"""A minimum whose error is within this factor of the tolerance is claimed `inaccurate`, beyond it `failed`."""


def too_large(n: int) -> str | None:
    """Return why a problem of n unknowns is too large, else None."""
    if n <= UNKNOWNS:
        return None
    return f"n = {n} unknowns: CasADi's expressions and sparse factors are given at most {UNKNOWNS}"


def as_dm(M: Matrix) -> Any:
    """Return a CasADi matrix, sparse where M is."""
    import casadi as ca

    return ca.DM(sp.csc_matrix(M)) if sp.issparse(M) else ca.DM(np.asarray(M))


@dataclass(frozen=True)
class IpoptOptions:
    """Options of casadi-ipopt, casadi-ipopt-mlcp. `max_iterations` : unless the budget bounds them. `first` : every
    component of the first (v, w)."""

    max_iterations: int = 3000
    first: float = 1.0


@dataclass(frozen=True)
class IpoptProgram:
    """The scaled problem, Ipopt for it, and the error that is asked for."""

    mcp: ScaledMCP
    solver: Any
    error: float


class IpoptComplementarity(Solver):
    """A local minimum of vᵀw over the feasible set; it solves the problem when vᵀw is 0 there.

    What Ipopt calls solved is claimed solved where ‖min(v, w)‖ of its own variables meets our tolerance; else it is a
    local minimum only. Since ‖min(v, w)‖² ≤ vᵀw, its `tol` aims at the square of our tolerance: pairs with v = w = 0
    are found no better. It relaxes the bounds by a hundredth of ours while it works, for there may be no interior
    (w = 0 on the whole feasible set), and honours them in the end.
    """

    def obstacle(self, problem: LCP | MLCP) -> str | None:
        n = sum(problem.point_sizes.values())
        if n == 0:
            return "has no unknown (n = 0): Ipopt refuses an empty program"
        return too_large(n)

    def stopping(self, tolerance: float, problem: LCP | MLCP | None = None) -> Stopping:
        mcp = None if problem is None else scaled_mcp(problem)
        return _stopping(tolerance, 1) if mcp is None else _stopping(tolerance * mcp.strictness, mcp.k.size)

    def setup(self, problem: LCP | MLCP, budget: Budget, options: IpoptOptions) -> IpoptProgram:
        import casadi as ca

        mcp = scaled_mcp(problem)
        n, free = mcp.k.size, mcp.free
        error = budget.tolerance * mcp.strictness
        x, w = ca.MX.sym("x", n), ca.MX.sym("w", n - free)
        rows = ca.mtimes(as_dm(mcp.K), x) + ca.DM(mcp.k)
        equal, unequal = ca.vertsplit(rows, [0, free, n])
        v = ca.vertsplit(x, [0, free, n])[1]
        program = {"x": ca.vertcat(x, w), "f": ca.dot(v, w), "g": ca.vertcat(equal, unequal - w)}
        ipopt = {
            "print_level": 0,
            "sb": "yes",
            **_stopping(error, n).settings,
            "honor_original_bounds": "yes",
            "max_iter": options.max_iterations if budget.iterations is None else budget.iterations,
        }
        if math.isfinite(budget.seconds):
            ipopt["max_wall_time"] = budget.seconds
        quiet = {"print_time": False, "error_on_fail": False, "show_eval_warnings": False, "ipopt": ipopt}
        return IpoptProgram(mcp, ca.nlpsol("complementarity", "ipopt", program, quiet), error)

    def warmup(self) -> None:
        self.run(small_problem(self.spec.node))

    def solve(
        self,
        prepared: IpoptProgram,
        budget: Budget,
        options: IpoptOptions,
        start: Any | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        n, free = prepared.mcp.k.size, prepared.mcp.free
        first = np.full(2 * n - free, options.first)
        first[:free] = 0.0
        lower = np.where(np.arange(first.size) < free, -np.inf, 0.0)
        result = prepared.solver(x0=first, lbx=lower, ubx=np.inf, lbg=0.0, ubg=0.0)
        stats = prepared.solver.stats()
        claim = CLAIMS.get(stats["return_status"], Claim.FAILED)
        message, x = stats["return_status"], np.asarray(result["x"]).ravel()
        apart = norm(np.minimum(x[free:n], x[n:]))  # its objective has the relaxed bounds: it may be negative
        if claim is Claim.SOLVED and apart > prepared.error:
            claim = Claim.INACCURATE if apart <= CLOSE * prepared.error else Claim.FAILED
            message += f" at ‖min(v, w)‖ = {apart:.1e}"
        return SolverOutput(
            claim=claim,
            point=prepared.mcp.point(x[:n]),
            counters={"iterations": max(int(stats["iter_count"]), 0)},
            message=message,
        )


def _stopping(error: float, n: int) -> Stopping:
    settings = {"tol": max(0.1 * error * error / max(n, 1), LEAST), "bound_relax_factor": 0.01 * error}
    return Stopping(
        test="its scaled optimality conditions of min vᵀw; solved is claimed where ‖min(v, w)‖ meets our tolerance",
        settings=no_looser(settings, IPOPT),
        defaults=IPOPT,
    )


def _spec(name: str, node: str, **more: Any) -> SolverSpec:
    return SolverSpec(
        name=name,
        node=node,
        summary="Ipopt on min vᵀw over the feasible set: a local minimum, which may be no solution",
        method="interior point",
        citation=f"Wächter and Biegler, Math. Prog. 106 (2006); {CITATION}",
        requires=("casadi",),
        install=INSTALL,
        licence="EPL-2.0 (Ipopt), LGPL-3.0-or-later (CasADi)",
        traits=frozenset({Trait.SPARSE, Trait.DETERMINISTIC}),
        options=IpoptOptions,
        **more,
    )


@register
class IpoptLCP(IpoptComplementarity):
    """The method for the LCP."""

    spec: ClassVar[SolverSpec] = _spec(
        "casadi-ipopt",
        "lcp",
        known_failures={"check_claims_hold_in_other_units": "Solve_Succeeded for units of 1e-8 to 1e8 at error 2.1e-2"},
    )


@register
class IpoptMLCP(IpoptComplementarity):
    """The method for the MLCP, its equations as constraints."""

    spec: ClassVar[SolverSpec] = _spec("casadi-ipopt-mlcp", "mlcp")
