"""scipy.optimize.minimize on nonlinear programs: SLSQP and trust-constr, with exact derivatives."""

from __future__ import annotations

import math
import time
import warnings
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.programs import NLP, NLPPoint
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
from cpbench.solvers.stopping import Stopping, no_looser
from cpbench_adapters.nlp_answers import (
    ABSOLUTE,
    DENSE_UNKNOWNS,
    answer,
    compile_program,
    concluded,
    judged,
    small_program,
)


@dataclass(frozen=True)
class MinimizeOptions:
    """Options of scipy-slsqp, scipy-trust-constr. `max_iterations` : of the guest, unless the budget bounds them."""

    max_iterations: int = 2000


STUCK = {"gtol": 0.0, "xtol": 1e-15, "barrier_tol": 1e-15}
"""Tolerances of trust-constr, where nothing moves any more."""


FLAT = 4.0 * float(np.finfo(float).eps)
"""A change of f, if f is of size one, below which SLSQP only goes to and fro."""


CLAIMED = "solved is claimed where the node's error meets our tolerance"


class _OutOfTime(Exception):
    pass


class ScipyMinimize(Solver):
    """Base of the two minimizers. Tolerance: the guest's own is set far below ours; the node's conditions decide."""

    def obstacle(self, problem: NLP) -> str | None:
        if problem.start.size == 0:
            return "has no unknown (n = 0): SciPy refuses an empty program"
        return None

    def setup(self, problem: NLP, budget: Budget, options: MinimizeOptions) -> NLP:
        compile_program(problem)
        return problem

    def version(self) -> str:
        return package_version("scipy")

    def warmup(self) -> None:
        self.run(small_program())

    def solve(
        self,
        prepared: NLP,
        budget: Budget,
        options: MinimizeOptions,
        start: Any | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        first = prepared.at_start if start is None else np.clip(start.z, prepared.lb, prepared.ub)
        deadline = time.monotonic() + budget.seconds

        def look(*_: Any) -> None:
            if time.monotonic() > deadline:
                raise _OutOfTime

        limit = budget.iterations or options.max_iterations
        try:
            with np.errstate(all="ignore"), warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of steps that gain nothing: at our tolerances, the usual end
                result, point = self.minimize(prepared, np.array(first), limit, budget.tolerance, look)
        except _OutOfTime:
            return SolverOutput(claim=Claim.MAX_ITER, message="out of time")
        except (ValueError, np.linalg.LinAlgError) as error:  # a value or a derivative is not a number
            return SolverOutput(claim=Claim.FAILED, message=f"{type(error).__name__}: {error}")
        done = int(result.get("nit", 0))  # none of a program whose unknowns are all fixed
        counters = {"iterations": done, "evaluations": int(result.get("nfev", 0))}
        ended = Claim.MAX_ITER if done >= limit else (Claim.SOLVED if result.success else Claim.FAILED)
        return concluded(prepared, point, budget, ended, str(result.message), counters)

    @abstractmethod
    def minimize(
        self, problem: NLP, first: Any, limit: int, tolerance: float, look: Callable[..., None]
    ) -> tuple[Any, NLPPoint]:
        """Return SciPy's result and the answer that it is; `look` is called at every iterate."""


def _spec(
    name: str, summary: str, method: str, citation: str, traits: set[Trait], *, quick: bool = False
) -> SolverSpec:
    return SolverSpec(
        name=name,
        node="nlp",
        summary=summary,
        method=method,
        citation=citation,
        licence="BSD-3-Clause",
        traits=frozenset(traits | {Trait.DETERMINISTIC}),
        options=MinimizeOptions,
        quick=quick,
    )


@register
class ScipySLSQP(ScipyMinimize):
    """Sequential least squares: BFGS of the Lagrangian, dense. It ends on a change of f below `ftol`, which is the
    square of ours: near a minimum f is flat."""

    spec: ClassVar[SolverSpec] = _spec(
        "scipy-slsqp",
        "SLSQP through SciPy, BFGS",
        "sequential quadratic programming",
        "Kraft 1988, DFVLR-FB 88-28",
        set(),
        quick=True,
    )

    def obstacle(self, problem: NLP) -> str | None:
        n = problem.start.size
        if n > DENSE_UNKNOWNS:
            return f"n = {n} unknowns: SLSQP's dense matrices are given at most {DENSE_UNKNOWNS}"
        return super().obstacle(problem)

    def stopping(self, tolerance: float, problem: NLP | None = None) -> Stopping:
        defaults = {"ftol": 1e-6}
        settings = no_looser({"ftol": max(tolerance**2, FLAT)}, defaults)
        test = f"change of f; {CLAIMED}"
        return Stopping(test=test, settings=settings, defaults=defaults, differs=ABSOLUTE, factor=math.inf)

    def minimize(
        self, problem: NLP, first: Any, limit: int, tolerance: float, look: Callable[..., None]
    ) -> tuple[Any, NLPPoint]:
        from scipy.optimize import Bounds, minimize

        constraints = [
            {"type": kind, "fun": F, "jac": lambda z, F=F: F.jacobian(z).toarray()}
            for kind, F in (("eq", problem.h), ("ineq", problem.g))
            if F.rows
        ]
        minimum = minimize(
            problem.objective,
            first,
            jac=lambda z: problem.f.jacobian(z).toarray().ravel(),
            bounds=Bounds(problem.lb, problem.ub),
            constraints=constraints,
            method="SLSQP",
            callback=look,
            options={"maxiter": limit, **self.stopping(tolerance).settings},
        )
        k, own = problem.h.rows, np.ravel(minimum.get("multipliers", []))
        own = own if own.size == k + problem.g.rows else np.zeros(k + problem.g.rows)
        return minimum, answer(problem, minimum.x, own[k:], own[:k])


@register
class ScipyTrustConstr(ScipyMinimize):
    """Byrd and Omojokun's trust region, barrier for inequalities; sparse Jacobians and exact Hessians. Its test of
    optimality leaves the barrier out; it is stopped at the first iterate that meets what the node judges."""

    spec: ClassVar[SolverSpec] = _spec(
        "scipy-trust-constr",
        "trust-constr through SciPy, exact Hessians",
        "trust region interior point",
        "Byrd, Hribar and Nocedal 1999, SIAM J. Optim. 9",
        {Trait.SPARSE},
    )

    def stopping(self, tolerance: float, problem: NLP | None = None) -> Stopping:
        test = "stopped at the first iterate whose node's error meets our tolerance"
        defaults = dict.fromkeys(STUCK, 1e-8)
        return Stopping(test=test, settings=STUCK, defaults=defaults, differs=ABSOLUTE, factor=math.inf)

    def minimize(
        self, problem: NLP, first: Any, limit: int, tolerance: float, look: Callable[..., None]
    ) -> tuple[Any, NLPPoint]:
        from scipy.optimize import Bounds, NonlinearConstraint, minimize

        constraints = [
            NonlinearConstraint(F, 0.0, top, jac=F.jacobian, hess=F.hessian)
            for F, top in ((problem.h, 0.0), (problem.g, np.inf))
            if F.rows
        ]

        def point(z: Any, multipliers: Any) -> NLPPoint:
            parts = [-np.ravel(v) for v in multipliers]  # its L = f + vᵀc
            mu = parts.pop(0) if problem.h.rows else np.zeros(0)
            lam = parts.pop(0) if problem.g.rows else np.zeros(0)
            return answer(problem, z, lam, mu)

        def watch(z: Any, state: Any) -> None:
            look()
            if judged(problem, point(z, state.v)) <= tolerance:
                raise StopIteration

        minimum = minimize(
            problem.objective,
            first,
            jac=lambda z: problem.f.jacobian(z).toarray().ravel(),
            hess=lambda z: problem.f.hessian(z, np.ones(1)),
            bounds=Bounds(problem.lb, problem.ub),
            constraints=constraints,
            method="trust-constr",
            callback=watch,
            options={"maxiter": limit, **STUCK},
        )
        return minimum, point(minimum.x, minimum.v)
