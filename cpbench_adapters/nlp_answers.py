"""Base of the adapters of nonlinear programs: signs of multipliers, those of bounds, and the last word on a claim.

Ours: L = f − λᵀg − μᵀh − νᵀz with λ ≥ 0 of g ≥ 0. Guests add multipliers in L, and say little of those of bounds at a
fixed unknown; ν is therefore what is left of ∇f − ∇g λ − ∇h μ where its bound is met: nearer than ν is long, the
bound's own natural residual. Where it is not, that rest stays in the stationarity that is judged.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cpbench.formulations.programs import NLP, NLPPoint
from cpbench.foundation.matrices import Vector
from cpbench.solvers.base import Budget, Claim, SolverOutput

CLOSE = 100.0
"""An end within this factor of the tolerance is claimed `inaccurate`."""
ABSOLUTE = "the node's error is absolute where the numbers of a problem are small"
"""What the test of the node's own error does not see: in small units an answer may pass that is none."""
DENSE_UNKNOWNS = 2000
"""Most unknowns of a guest with dense matrices."""


def answer(problem: NLP, z: Any, lam: Any, mu: Any) -> NLPPoint:
    """Return the point of z within its bounds, multipliers of g and h in our sign (λ < 0 is rounding, cut to 0)."""
    z = np.clip(np.array(z, dtype=float).ravel(), problem.lb, problem.ub)
    lam, mu = np.maximum(np.ravel(lam), 0.0), np.array(mu, dtype=float).ravel()
    with np.errstate(all="ignore"):
        rest = problem.f.jacobian(z).toarray().ravel() - problem.g.jacobian(z).T @ lam - problem.h.jacobian(z).T @ mu
        room = np.where(rest > 0, z - problem.lb, problem.ub - z)
        nu: Vector = np.where(room <= np.abs(rest), rest, 0.0)
    return NLPPoint(z=z, lam=lam, mu=mu, nu=nu)


def judged(problem: NLP, point: NLPPoint) -> float:
    """Return the largest of what the node judges."""
    return max(problem.residuals(point).measured.values())


def concluded(
    problem: NLP, point: NLPPoint | None, budget: Budget, ended: Claim, message: str, counters: Mapping[str, int]
) -> SolverOutput:
    """Claim solved exactly when what the node judges is at most our tolerance, whatever the guest says; else
    `ended`, where a guest's own `solved` becomes inaccurate or failed."""
    if point is None or not point.finite:
        return SolverOutput(claim=Claim.FAILED if ended is Claim.SOLVED else ended, message=message, counters=counters)
    error = judged(problem, point)
    if error <= budget.tolerance:
        return SolverOutput(claim=Claim.SOLVED, point=point, message="", counters=counters)
    if ended is Claim.SOLVED:
        ended = Claim.INACCURATE if error <= CLOSE * budget.tolerance else Claim.FAILED
    return SolverOutput(claim=ended, point=point, message=f"{message}; at error {error:.1e}", counters=counters)


def compile_program(problem: NLP) -> None:
    """Compile the maps and their derivatives, so that this is timed as setup."""
    with np.errstate(all="ignore"):
        z = problem.at_start
        for F in problem.maps().values():
            F(z)
            F.jacobian(z)
            F.hessian(z, np.ones(F.rows))


def small_program() -> NLP:
    """Return min exp(z) − 2z, for a warm-up."""
    from cpbench.formulations.expressions import Builder, Operator

    build = Builder(1)
    value = build.apply(Operator.MUL, build.constant(2.0), 0)
    return NLP(f=build.finish([build.apply(Operator.SUB, build.apply(Operator.EXP, 0), value)]))
