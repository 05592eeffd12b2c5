"""LCP and MLCP as one problem for guests with absolute tolerances: Kx + k, part of x free, data of size one.

x = (u, v) and K = [[A, C], [D, B]], k = (a, b); an LCP has no u. Unknowns are measured in units that the data give
(v in ‖b‖∞/max|B|, as the node's residuals have it), rows divided by the size of their constant, so that a tolerance
means the same for a problem in newtons and in units of 1e-8 N.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.formulations import LCP, MLCP, LCPPoint, MLCPPoint
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Vector, max_abs, norm

SAFETY = 0.1
"""Share of our tolerance that a guest is asked for: its norm of the residual is not ours."""
FLOOR = 1e-15
"""Least tolerance that a guest is asked for: below, rounding decides."""


@dataclass(frozen=True)
class ScaledMCP:
    """Rows K[:free] x + k[:free] = 0, x[:free] free; the others 0 ≤ x ⟂ Kx + k ≥ 0.

    Attributes
    ----------
    problem : the LCP or MLCP that was asked. K : (n, n). k, unit : (n,), `unit` times x is the answer.
    strictness : how much smaller than our tolerance the error of x must be for the judged error to be below ours.
    """

    problem: LCP | MLCP
    K: Matrix
    k: Vector
    free: int
    unit: Vector
    strictness: float

    def share(self, tolerance: float) -> float:
        """Return the tolerance on the residual of x, in any usual norm, for ours on the judged error."""
        return share(tolerance, self.strictness)

    def point(self, x: Any) -> LCPPoint | MLCPPoint:
        """Return the answer to the problem that was asked."""
        z = self.unit * np.asarray(x, dtype=float).ravel()
        if isinstance(self.problem, LCP):
            return LCPPoint(z)
        return MLCPPoint(u=z[: self.free], v=z[self.free :])

    def start(self, point: LCPPoint | MLCPPoint | None) -> Vector:
        """Return x of a starting point; 0 without one."""
        if point is None:
            return np.zeros(self.k.size)
        return point.vector / self.unit


def small_problem(node: str) -> LCP | MLCP:
    """Return an LCP or MLCP of two unknowns, for a warm-up."""
    one = np.eye(1)
    if node == "lcp":
        return LCP(M=np.eye(2), q=np.array([-1.0, -2.0]))
    return MLCP(A=one, B=one, C=one, D=-one, a=np.ones(1), b=-np.ones(1))


def share(tolerance: float, strictness: float = 1.0) -> float:
    """Return the part of our tolerance that a guest is asked for, at most a tenth of it."""
    return max(SAFETY * tolerance * strictness, FLOOR)


def scaled_mcp(problem: LCP | MLCP) -> ScaledMCP:
    """Return an LCP or MLCP in its own units; a dense problem stays dense, a sparse one sparse."""
    if isinstance(problem, LCP):
        unit, size = problem.z_unit or 1.0, max_abs(problem.q) or 1.0
        strictness = min(1.0, size / unit)
        units = np.full(problem.q.size, unit)
        return ScaledMCP(problem, problem.M * (unit / size), problem.q / size, 0, units, strictness)
    A, B, C, D, a, b = problem.A, problem.B, problem.C, problem.D, problem.a, problem.b
    v = problem.v_unit or 1.0
    equal = max_abs(a) or max_abs(C) * v or 1.0
    unequal = max_abs(b) or max_abs(B) * v or 1.0
    u = equal / max_abs(A) if max_abs(A) else unequal / (max_abs(D) or unequal)
    rows = [[A * (u / equal), C * (v / equal)], [D * (u / unequal), B * (v / unequal)]]
    sparse = any(matrices.is_sparse(M) for M in (A, B, C, D))
    data = norm(np.concatenate([a, b])) or 1.0
    return ScaledMCP(
        problem,
        K=sp.csr_array(sp.block_array(rows))
        if sparse
        else np.block([[matrices.dense(M) for M in row] for row in rows]),
        k=np.concatenate([a / equal, b / unequal]),
        free=a.size,
        unit=np.concatenate([np.full(a.size, u), np.full(b.size, v)]),
        strictness=min(1.0, data / max(equal, unequal, v)),
    )
