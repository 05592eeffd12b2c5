"""Plugin with judges and solvers that are wrong in one way each, so that rows of a run contradict each other.

    cpbench --plugin contradictory.py run FOLDER          each kind of contradiction, one a problem
    python contradictory.py FOLDER                        writes the problems

The formulations are known to no measure of the verdict, which then goes by their own residuals: those are the judges.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cpbench import storage
from cpbench.formulations import LCP, QP, LCPPoint, Residuals
from cpbench.formulations.base import formulations
from cpbench.formulations.programs import QPPoint
from cpbench.solvers import Claim, Solver, SolverOutput, SolverSpec, register

M = np.array([[4.0, 1.0, 0.0], [1.0, 3.0, -1.0], [0.0, -1.0, 2.0]])
EXACT = np.array([1.0, 2.0, 3.0])
"""Solution of every problem: Mz + q = 0, z > 0."""


@formulations.register("lcp-first")
@dataclass(frozen=True, eq=False, kw_only=True)
class LooksAtTheFirst(LCP):
    """A judge of the first unknown only."""

    node = "lcp-first"

    def measure(self, point, tolerance):
        w = self.M @ point.z + self.q
        return Residuals({"natural": float(np.abs(np.minimum(point.z, w))[:1].sum())})


@formulations.register("lcp-never")
@dataclass(frozen=True, eq=False, kw_only=True)
class NeverSatisfied(LCP):
    """A judge that rejects every answer."""

    node = "lcp-never"

    def measure(self, point, tolerance):
        return Residuals({"natural": 1.0})


@formulations.register("qp-always")
@dataclass(frozen=True, eq=False, kw_only=True)
class AlwaysSatisfied(QP):
    """A judge that accepts every answer."""

    node = "qp-always"

    def measure(self, point, tolerance):
        return Residuals({"natural": 0.0})


def _right(problem):
    if isinstance(problem, QP):
        n = problem.p.size
        return QPPoint(z=np.linalg.solve(problem.Q, -problem.p), lam=[], mu=[], nu=np.zeros(n))
    return LCPPoint(z=np.linalg.solve(problem.M, -problem.q))


def _again(problem):
    """The same to rounding, as another method has it."""
    return LCPPoint(z=_right(problem).z * (1 + 1e-14))


def _half(problem):
    """The solution with zeros but for the first unknown that makes its row 0."""
    if isinstance(problem, QP):
        return QPPoint(z=np.zeros(problem.p.size), lam=[], mu=[], nu=np.zeros(problem.p.size))
    z = np.zeros(problem.q.size)
    z[0] = -problem.q[0] / problem.M[0, 0]
    return LCPPoint(z=z)


def _solver(name, node, method, answer, claim=Claim.SOLVED):
    class Planted(Solver):
        spec = SolverSpec(name=name, node=node, summary="planted", method=method)

        def solve(self, prepared, budget, options, start=None, record=None):
            return SolverOutput(claim=claim, point=answer(prepared) if answer else None)

    register(Planted)


for _node in ("lcp", "lcp-first", "lcp-never", "qp-always"):
    _solver(f"right-{_node}", _node, "elimination", _right)
_solver("again-lcp-never", "lcp-never", "another elimination", _again)
for _node in ("lcp-first", "qp-always"):
    _solver(f"liar-{_node}", _node, "none", _half)
_solver("denier-lcp", "lcp", "none", None, Claim.INFEASIBLE)
for _name in ("denier-a-lcp", "denier-b-lcp"):  # with the points at which they gave up
    _solver(_name, "lcp", "none", _half, Claim.INFEASIBLE)


def main(folder):
    """Write a problem of each formulation."""
    q = -M @ EXACT
    for name, kind in (("denied", LCP), ("first", LooksAtTheFirst), ("never", NeverSatisfied)):
        storage.save(kind(M=M, q=q, name=name), Path(folder) / f"{name}.h5")
    storage.save(AlwaysSatisfied.build(Q=M, p=q, name="always"), Path(folder) / "always.h5")


if __name__ == "__main__":
    main(sys.argv[1])
