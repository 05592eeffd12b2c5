"""scipy.optimize.root: MINPACK's hybrid and Levenberg–Marquardt methods, Newton–Krylov, and DF-SANE.

hybr and lm have no tolerance on F. All of them are therefore stopped at the first F that is evaluated with an error
of at most ours, ‖F‖ over `scale` and every row over its own terms; their own tolerances are set so low that they end
by themselves only where nothing moves any more. An iteration is an evaluation of F at a new point.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.base import scaled
from cpbench.formulations.nonlinear import Equation, EquationPoint
from cpbench.foundation.matrices import Vector, norm
from cpbench.solvers.base import (
    Budget,
    Claim,
    Record,
    Solver,
    SolverOutput,
    SolverSpec,
    Trait,
    package_version,
    register,
)
from cpbench.solvers.shared.row_error import row_error
from cpbench.solvers.stopping import Stopping

STUCK = 1e-15
"""Their tolerances, on steps or on F."""
TEST = "stopped at the first point that meets our tolerance, every row over its own terms"
DEFAULTS = {
    ("hybr", "xtol"): 1.49012e-08,
    ("lm", "xtol"): 1.49012e-08,
    ("lm", "ftol"): 1.49012e-08,
    ("lm", "gtol"): 0.0,
    ("krylov", "fatol"): 6e-6,
    ("df-sane", "fatol"): 1e-300,
    ("df-sane", "ftol"): 1e-8,
}
"""SciPy's own tolerances by method and name."""
DENSE_UNKNOWNS = 3000
"""Most unknowns of the two that factorize a dense Jacobian."""
CLOSE = 100.0
"""An end within this factor of the tolerance is claimed `inaccurate`."""


@dataclass(frozen=True)
class RootOptions:
    """Options of the methods of this module. `max_evaluations` : of F, unless the budget bounds them."""

    max_evaluations: int = 20_000


class _Enough(Exception):
    """The tolerance is met, or the budget is used up."""


class _Watched:
    """F with the best point so far; the first call, at the start, is no iteration, nor are repeated ones."""

    def __init__(self, problem: Equation, budget: Budget, limit: int) -> None:
        self._problem, self._tolerance, self._limit = problem, budget.tolerance, limit
        self._deadline = time.monotonic() + budget.seconds
        self._free = np.full(problem.start.size, -np.inf), np.full(problem.start.size, np.inf)
        self._first: Vector | None = None
        self.best, self.error = problem.start, math.inf
        self.counters = {"iterations": 0, "jacobians": 0}
        self.message = f"{limit} evaluations"

    def __call__(self, z: Any) -> Vector:
        z = np.array(z, dtype=float).ravel()
        if self._first is None:
            self._first = self.best = z
        elif not np.array_equal(z, self._first):
            if self.counters["iterations"] >= self._limit:
                raise _Enough
            self.counters["iterations"] += 1
        with np.errstate(all="ignore"):
            F = self._problem.F(z)
            error = scaled(norm(F), self._problem.scale)
            if error <= self._tolerance:  # F(0), the scale, may be of any size beside a pole
                error = max(error, row_error(z, F, self._problem.F.jacobian(z), self._free[0], self._free[1]))
        if error < self.error:
            self.best, self.error = z, error
        if self.error <= self._tolerance:
            raise _Enough
        if time.monotonic() > self._deadline:
            self.message = f"out of time after {self.counters['iterations']} evaluations"
            raise _Enough
        return F

    def jacobian(self, z: Any) -> Any:
        self.counters["jacobians"] += 1
        with np.errstate(all="ignore"):
            return self._problem.F.jacobian(np.asarray(z, dtype=float)).toarray()


class ScipyRoot(Solver):
    """One method of scipy.optimize.root; hybr and lm are given the exact Jacobian, the others take none."""

    guest: ClassVar[str]
    exact: ClassVar[bool] = False
    """Whether it takes the Jacobian, as a dense matrix."""
    settings: ClassVar[dict[str, Any]]

    def obstacle(self, problem: Equation) -> str | None:
        n = problem.start.size
        if n == 0:
            return "has no unknown (n = 0): SciPy refuses an empty system"
        if self.exact and n > DENSE_UNKNOWNS:
            return f"n = {n} unknowns make a dense Jacobian: at most {DENSE_UNKNOWNS}"
        return None

    def stopping(self, tolerance: float, problem: Equation | None = None) -> Stopping:
        names = {name: value for name, value in self.settings.items() if name != "maxiter" and name != "maxfev"}
        return Stopping(test=TEST, settings=names, defaults={name: DEFAULTS[self.guest, name] for name in names})

    def setup(self, problem: Equation, budget: Budget, options: RootOptions) -> Equation:
        watched = _Watched(problem, Budget(tolerance=-1.0), 2)
        watched(problem.start)  # compiles it, and its derivative
        if self.exact:
            watched.jacobian(problem.start)
        return problem

    def version(self) -> str:
        return package_version("scipy")

    def warmup(self) -> None:
        from cpbench.formulations.expressions import Builder, Operator

        build = Builder(1)
        value = build.apply(Operator.SUB, build.apply(Operator.EXP, 0), build.constant(2.0))
        self.run(Equation(F=build.finish([value])))

    def solve(
        self,
        prepared: Equation,
        budget: Budget,
        options: RootOptions,
        start: Any | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        from scipy.optimize import root

        limit = budget.iterations or options.max_evaluations
        first = np.array(prepared.start if start is None else start.z)
        watched = _Watched(prepared, budget, limit)
        message, more = "", self.settings
        if self.guest == "hybr":
            more = {**more, "maxfev": limit + 2}
        try:
            with np.errstate(all="ignore"):
                watched(first)
                jacobian = watched.jacobian if self.exact else None
                reason = root(watched, first, jac=jacobian, method=self.guest, options=more).message
                message = " ".join(str(reason).split())  # one of MINPACK's has two lines
        except _Enough:
            message = watched.message
        except (ValueError, ZeroDivisionError, np.linalg.LinAlgError) as error:  # F or a step is not a number
            message = f"{type(error).__name__}: {error}"
        done = watched.counters["iterations"] >= limit
        claim = Claim.MAX_ITER if done else Claim.FAILED
        if watched.error <= budget.tolerance:
            claim, message = Claim.SOLVED, ""
        elif not done and watched.error <= CLOSE * budget.tolerance:
            claim = Claim.INACCURATE
        return SolverOutput(
            claim=claim, point=EquationPoint(watched.best), counters=dict(watched.counters), message=message
        )


def _spec(guest: str, summary: str, method: str, citation: str, *, quick: bool = False) -> SolverSpec:
    return SolverSpec(
        name=f"scipy-root-{guest}",
        node="equation",
        summary=f"scipy.optimize.root: {summary}",
        method=method,
        citation=citation,
        licence="BSD-3-Clause",
        traits=frozenset({Trait.WARM_START, Trait.DETERMINISTIC}),
        options=RootOptions,
        quick=quick,
    )


@register
class ScipyHybr(ScipyRoot):
    """MINPACK's hybrj: dogleg steps, the Jacobian updated by Broyden between exact ones."""

    guest, exact, settings = "hybr", True, {"xtol": STUCK}
    spec: ClassVar[SolverSpec] = _spec(
        "hybr",
        "Powell's hybrid method, exact Jacobian",
        "trust region",
        "Moré, Garbow and Hillstrom 1980, ANL-80-74",
        quick=True,
    )


@register
class ScipyLM(ScipyRoot):
    """MINPACK's lmder on ½‖F‖²."""

    guest, exact, settings = "lm", True, {"xtol": STUCK, "ftol": STUCK, "gtol": 0.0}
    spec: ClassVar[SolverSpec] = _spec(
        "lm", "Levenberg-Marquardt, exact Jacobian", "Levenberg-Marquardt", "Moré 1978, Lect. Notes Math. 630"
    )


@register
class ScipyKrylov(ScipyRoot):
    """Inexact Newton, products with the Jacobian by differences, LGMRES inside."""

    guest, settings = "krylov", {"fatol": STUCK, "maxiter": 1_000_000}
    spec: ClassVar[SolverSpec] = _spec(
        "krylov", "Newton-Krylov without a matrix", "Newton-Krylov", "Knoll and Keyes 2004, J. Comput. Phys. 193"
    )


@register
class ScipyDFSane(ScipyRoot):
    """Spectral residual steps, no derivative."""

    guest, settings = "df-sane", {"fatol": 0.0, "ftol": 0.0, "maxfev": 1_000_000}
    spec: ClassVar[SolverSpec] = _spec(
        "df-sane", "spectral residual, no derivative", "spectral residual", "La Cruz et al. 2006, Math. Comput. 75"
    )
