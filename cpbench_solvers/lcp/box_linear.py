"""A linear complementarity problem between bounds, brought to a registered solver of `lcp`, `mlcp` or `avi`.

−(Mz + q) ∈ N_[lb,ub](z). With z = base + S y, base a finite bound (S = −1 from an upper one) or the present point for a
free z, and a multiplier η for the second of two bounds:

    y_f free,  M′_ff y_f + M′_fv y_v + q′_f = 0                          M′ = S M S, q′ = S (M base + q)
    0 ≤ y_v ⟂ M′_vf y_f + M′_vv y_v + q′_v + η ≥ 0,  0 ≤ η ⟂ ub − lb − y_v ≥ 0

An LCP takes the Schur complement in M′_ff. Unknowns with lb = ub are constants.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.errors import CpbenchError
from cpbench.formulations.avi import AVI, AVIPoint
from cpbench.formulations.lcp import LCP, LCPPoint
from cpbench.formulations.mlcp import MLCP, MLCPPoint
from cpbench.foundation import matrices
from cpbench.foundation.factorization import Factorization
from cpbench.foundation.matrices import Matrix, Vector
from cpbench.solvers.base import Budget, Solver

NODES = ("lcp", "mlcp", "avi")
"""The nodes whose solvers can be inner ones."""


@dataclass(frozen=True, eq=False)
class BoxLinear:
    """The problem; `present` is where it was linearized, the base of free unknowns and the start of inner solvers."""

    M: Matrix
    q: Vector
    lb: Vector
    ub: Vector
    present: Vector

    def solve(self, solver: Solver, budget: Budget) -> Vector | None:
        """Return the z that the solver finds, whatever it claims of it; None without an answer or where it refuses."""
        try:
            if solver.spec.node == "avi":
                problem = AVI(M=self.M, q=self.q, lb=self.lb, ub=self.ub)
                point = _answer(solver, problem, AVIPoint(self.present), budget)
                return None if point is None else point.z
            return self._as_complementarity(solver, budget)
        except (CpbenchError, np.linalg.LinAlgError):
            return None

    def _as_complementarity(self, solver: Solver, budget: Budget) -> Vector | None:
        moving = self.lb < self.ub
        lower = np.isfinite(self.lb)
        upper = np.isfinite(self.ub)
        free = np.flatnonzero(moving & ~lower & ~upper)
        signed = np.flatnonzero(moving & (lower | upper))
        both = np.flatnonzero(upper[signed] & lower[signed])
        base = np.where(lower, self.lb, np.where(upper, self.ub, self.present))
        sign = np.where(~lower & upper, -1.0, 1.0)
        q = sign * (self.M @ base + self.q)
        parts = [[_block(self.M, sign, rows, columns) for columns in (free, signed)] for rows in (free, signed)]
        (A, C), (D, B) = parts
        a, b = q[free], q[signed]
        y = (sign * (self.present - base))[signed]
        if both.size:
            E = sp.csr_array((np.ones(both.size), (both, np.arange(both.size))), shape=(signed.size, both.size))
            if not sp.issparse(self.M):
                E = E.toarray()
            B = matrices.block([[B, E], [-E.T, matrices.zeros(both.size, both.size, self.M)]])
            C = matrices.block([[C, matrices.zeros(free.size, both.size, self.M)]])
            D = matrices.block([[D], [matrices.zeros(both.size, free.size, self.M)]])
            b = np.concatenate([b, (self.ub - self.lb)[signed[both]]])
            slack = (self.M @ self.present + self.q)[signed[both]]
            y = np.concatenate([y, np.maximum(-slack, 0.0) * (y[both] >= (self.ub - self.lb)[signed[both]])])
        found = _mixed(A, B, C, D, a, b, y, solver, budget)
        if found is None:
            return None
        z = np.array(base)
        z[free] += found[0]
        z[signed] += sign[signed] * found[1][: signed.size]
        return z


def _block(M: Matrix, sign: Vector, rows: Any, columns: Any) -> Matrix:
    """Return S M S of some rows and columns."""
    if sp.issparse(M):
        part = M[rows][:, columns]
        return sp.csr_array(sp.diags_array(sign[rows]) @ part @ sp.diags_array(sign[columns]))
    return sign[rows, None] * M[np.ix_(rows, columns)] * sign[columns]


def _mixed(
    A: Matrix, B: Matrix, C: Matrix, D: Matrix, a: Vector, b: Vector, v: Vector, solver: Solver, budget: Budget
) -> tuple[Vector, Vector] | None:
    """Return u and v of the MLCP, by the solver or, where it is one for LCPs, by the Schur complement."""
    if solver.spec.node == "mlcp":
        point = _answer(solver, MLCP(A=A, B=B, C=C, D=D, a=a, b=b), MLCPPoint(np.zeros(a.size), v), budget)
        return None if point is None else (point.u, point.v)
    if a.size == 0:
        point = _answer(solver, LCP(M=B, q=b), LCPPoint(v), budget)
        return None if point is None else (a, point.z)
    factors = Factorization(A)
    if factors.singular:
        return None
    solved_C = factors.solve(C)
    shift = factors.solve(a)
    schur = matrices.dense(B) - D @ solved_C
    point = _answer(solver, LCP(M=schur, q=b - D @ shift), LCPPoint(v), budget)
    return None if point is None else (-(shift + solved_C @ point.z), point.z)


def _answer(solver: Solver, problem: Any, start: Any, budget: Budget) -> Any | None:
    if solver.obstacle(problem) is not None:
        return None
    point = solver.run(problem, budget, start=start).point
    return point if point is not None and point.finite else None
