"""Source, Target, Lift, Kind: plugins that are wrong in one way each, outside every registry.

tests/conformance/test_broken.py holds that the named check, and not something else, catches each.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from cpbench import matrices
from cpbench.conversions.mlcp_to_lcp_schur import MLCPtoLCPSchur
from cpbench.formulations import LCP, LCPPoint, MLCPPoint, Residuals
from cpbench.solvers.base import Claim, Solver, SolverOutput, SolverSpec, Trait


class SignFlippedLift(MLCPtoLCPSchur):
    """u with the wrong sign."""

    def lift(self, point, trace):
        right = super().lift(point, trace)
        return MLCPPoint(u=-right.u, v=right.v)


class EditsItsInput(MLCPtoLCPSchur):
    """Scales A of the problem it was given."""

    def apply(self, problem):
        object.__setattr__(problem, "A", matrices.matrix(2.0 * problem.A))
        return super().apply(problem)


class IgnoresItsObstacle(MLCPtoLCPSchur):
    """Says that a singular block cannot be eliminated, and eliminates it."""

    def apply(self, problem):
        n = problem.a.size
        return super().apply(dataclasses.replace(problem, A=matrices.dense(problem.A) + np.eye(n)))


class _LCPSolver(Solver):
    spec = SolverSpec(
        name="broken", node="lcp", summary="wrong", method="none", traits=frozenset({Trait.DETERMINISTIC})
    )


class ClaimsZeros(_LCPSolver):
    """Zeros, claimed solved."""

    def solve(self, prepared, budget, options, start=None, record=None):
        return SolverOutput(claim=Claim.SOLVED, point=LCPPoint(z=np.zeros(prepared.q.size)))


class ClaimsNaN(_LCPSolver):
    """NaN, claimed solved."""

    def solve(self, prepared, budget, options, start=None, record=None):
        return SolverOutput(claim=Claim.SOLVED, point=LCPPoint(z=np.full(prepared.q.size, np.nan)))


class WrongShape(_LCPSolver):
    """One number too many, honestly."""

    def solve(self, prepared, budget, options, start=None, record=None):
        return SolverOutput(claim=Claim.FAILED, point=LCPPoint(z=np.zeros(prepared.q.size + 1)))


class SwallowsErrors(_LCPSolver):
    """An exception inside becomes an answer that was never computed."""

    def solve(self, prepared, budget, options, start=None, record=None):
        try:
            z = np.linalg.no_such_function(prepared.M)  # type: ignore[attr-defined]
        except Exception:
            z = np.zeros(prepared.q.size)
        return SolverOutput(claim=Claim.FAILED, point=LCPPoint(z=z))


class RollsDice(_LCPSolver):
    """Another answer every time, with the trait `deterministic`."""

    rng = np.random.default_rng(0)

    def solve(self, prepared, budget, options, start=None, record=None):
        return SolverOutput(claim=Claim.FAILED, point=LCPPoint(z=self.rng.random(prepared.q.size)))


@dataclass(frozen=True, eq=False, kw_only=True)
class IgnoresNaN(LCP):
    """Residuals that skip what is not a number."""

    def residuals(self, point, tolerance=1e-6):
        z = np.nan_to_num(point.z, posinf=0.0)
        return Residuals({"natural": float(np.nansum(np.abs(np.minimum(z, self.M @ z + self.q))))})


@dataclass(frozen=True, eq=False, kw_only=True)
class AlwaysRight(LCP):
    """Residuals that are 0 whatever the answer."""

    def residuals(self, point, tolerance=1e-6):
        return Residuals({"natural": 0.0})
