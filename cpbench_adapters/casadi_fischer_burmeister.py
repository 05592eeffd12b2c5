"""CasADi's root finders on the Fischer–Burmeister equations of an LCP or MLCP."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations import LCP, MLCP
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register
from cpbench.solvers.stopping import Stopping, no_looser
from cpbench_adapters.casadi_guest import CITATION, INSTALL, LICENCE, as_dm, too_large
from cpbench_adapters.scaled_mcp import ScaledMCP, scaled_mcp, share

METHODS = {"newton": 1e-12, "fast_newton": 1e-12, "kinsol": 1e-6}
"""CasADi's root finders, and their own tolerances."""


@dataclass(frozen=True)
class RootfinderOptions:
    """Options of casadi-fischer-burmeister, casadi-fischer-burmeister-mlcp. `method` : newton (with line search),
    fast_newton (plain) or kinsol (of SUNDIALS). `max_iterations` : unless the budget bounds them. `smoothing` : s in
    √(x² + w² + s²), relative to the tolerance; it keeps the Jacobian defined where x = w = 0."""

    method: str = "newton"
    max_iterations: int = 200
    smoothing: float = 1e-3

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise ValueError(f"method {self.method!r}: one of {', '.join(METHODS)}")


@dataclass(frozen=True)
class Equations:
    """The scaled problem and CasADi's root finder for it."""

    mcp: ScaledMCP
    rootfinder: Any


class FischerBurmeister(Solver):
    """Root of (Kx + k on free rows, x + w − √(x² + w² + s²) on the others), w = Kx + k, from x = 0 or the start.

    Tolerance: max|F| of the scaled problem; |min(x, w)| ≤ 1.71 |x + w − √(x² + w²)|, which the factor 0.1 covers.
    """

    def obstacle(self, problem: LCP | MLCP) -> str | None:
        n = sum(problem.point_sizes.values())
        if n == 0:
            return "has no unknown (n = 0): CasADi makes no root finder without equations"
        return too_large(n)

    def stopping(self, tolerance: float, problem: LCP | MLCP | None = None) -> Stopping:
        asked = share(tolerance) if problem is None else scaled_mcp(problem).share(tolerance)
        return _stopping(asked, RootfinderOptions().method)

    def setup(self, problem: LCP | MLCP, budget: Budget, options: RootfinderOptions) -> Equations:
        import casadi as ca

        mcp = scaled_mcp(problem)
        tolerance = mcp.share(budget.tolerance)
        x = ca.MX.sym("x", mcp.k.size)
        w = ca.mtimes(as_dm(mcp.K), x) + ca.DM(mcp.k)
        cuts = [0, mcp.free, mcp.k.size]
        (_, y), (equal, v) = ca.vertsplit(x, cuts), ca.vertsplit(w, cuts)
        phi = y + v - ca.sqrt(y * y + v * v + (options.smoothing * tolerance) ** 2)
        equations = ca.Function("F", [x], [ca.vertcat(equal, phi)])
        limit = options.max_iterations if budget.iterations is None else budget.iterations
        settings: dict[str, Any] = {"error_on_fail": False, "show_eval_warnings": False, "max_iter": limit}
        settings |= _stopping(tolerance, options.method).settings
        if options.method == "kinsol":
            settings |= {"disable_internal_warnings": True, "strategy": "linesearch"}
        return Equations(mcp, ca.rootfinder("rootfinder", options.method, equations, settings))

    def solve(
        self,
        prepared: Equations,
        budget: Budget,
        options: RootfinderOptions,
        start: Any | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        x = np.asarray(prepared.rootfinder(prepared.mcp.start(start)))
        stats = prepared.rootfinder.stats()
        limited = stats["unified_return_status"] == "SOLVER_RET_LIMITED"
        claim = Claim.SOLVED if stats["success"] else Claim.MAX_ITER if limited else Claim.FAILED
        return SolverOutput(
            claim=claim,
            point=prepared.mcp.point(x),
            # kinsol tells no number
            counters={"iterations": int(stats["iter_count"])} if "iter_count" in stats else {},
            message=f"{options.method}: {stats['return_status']}",
        )


def _stopping(tolerance: float, method: str) -> Stopping:
    defaults = {"abstol": METHODS[method]}
    return Stopping(test="max|F|", settings=no_looser({"abstol": tolerance}, defaults), defaults=defaults)


_UNSOLVABLE = "check_infeasibility_is_proved_or_not_claimed_solved"
_NAN = "newton meets a singular Jacobian, goes on with NaN and reports success after 2 or 3 iterations: error inf"

_CANCELLATION = "x + w − √(x² + w²) loses an x of 1e-14 beside w, which is 1.3e-6 where z is measured in units of 1e8"


def _spec(name: str, node: str, **more: Any) -> SolverSpec:
    return SolverSpec(
        name=name,
        node=node,
        summary="CasADi's rootfinder (newton, fast_newton, kinsol) on the Fischer-Burmeister equations",
        method="semismooth Newton",
        citation=f"Fischer, Optimization 24 (1992); {CITATION}",
        requires=("casadi",),
        install=INSTALL,
        licence=LICENCE,
        traits=frozenset({Trait.SPARSE, Trait.DETERMINISTIC, Trait.WARM_START}),
        options=RootfinderOptions,
        **more,
    )


@register
class FischerBurmeisterLCP(FischerBurmeister):
    """The method for the LCP."""

    spec: ClassVar[SolverSpec] = _spec(
        "casadi-fischer-burmeister",
        "lcp",
        known_failures={
            _UNSOLVABLE: _NAN,
            "case-velocity-unit-1e-08": _CANCELLATION,
            "case-impulse-unit-1e+08": _CANCELLATION,
        },
    )

    def warmup(self) -> None:
        self.run(LCP(M=np.eye(2), q=np.array([-1.0, -2.0])))


@register
class FischerBurmeisterMLCP(FischerBurmeister):
    """The method for the MLCP, its equations as they are."""

    spec: ClassVar[SolverSpec] = _spec(
        "casadi-fischer-burmeister-mlcp",
        "mlcp",
        known_failures={
            _UNSOLVABLE: _NAN,
            "case-zero-A-and-B": _NAN,
            "check_warm_starts_are_taken": "sparse-singular-A: CasADi's 1e-12 is below rounding where A is singular",
            "planted-singular": "A of rank 11 of 12, not monotone: the line search stalls at error 1.4, and says so",
        },
    )

    def warmup(self) -> None:
        one = np.eye(1)
        self.run(MLCP(A=one, B=one, C=one, D=-one, a=np.ones(1), b=-np.ones(1)))
