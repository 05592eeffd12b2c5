"""A QP with data near size one: min ½xᵀHx + gᵀx subject to lower ≤ (x, Gx) ≤ upper, G the rows of A and then of C.

z = Dx, H = c DQD, g = c Dp, rows E[A; C]D, with diagonal D, E of powers of two. Its multipliers y (of x and then of Gx,
positive at lower bounds, negative at upper ones) are those of the problem divided by D and E, times c.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.programs import QP, QPPoint
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Dense, Matrix, Vector, max_abs
from cpbench_solvers.kernels import qp_dense, qp_sparse
from cpbench_solvers.qp.kkt_system import Entries
from cpbench_solvers.qp.presolve import SparseQP, sparse_data

PASSES = 4
"""Of equilibration; every one takes the root of what is left."""
RUIZ_STEPS = 8


@dataclass(frozen=True, eq=False)
class Scales:
    """problem : what was asked. g (n,), lower, upper (n + r,). D (n,), E (r,), c : the scales."""

    problem: QP | SparseQP
    g: Vector
    lower: Vector
    upper: Vector
    D: Vector
    E: Vector
    c: float

    def parts(self, x: Vector, y: Vector) -> tuple[Vector, Vector, Vector, Vector]:
        """Return z, λ, μ, ν; z within its bounds, exactly at those whose multiplier is not 0."""
        n, m = self.g.size, self.problem.b.size
        nu = y[:n] / (self.c * self.D)
        z = np.clip(self.D * x, self.problem.lb, self.problem.ub)
        rows = y[n:] * self.E / self.c
        return z, rows[:m], rows[m:], nu

    def start(self, point: QPPoint) -> tuple[Vector, Vector]:
        """Return x and y of a point."""
        rows = np.concatenate([point.lam, point.mu])
        return point.z / self.D, self.c * np.concatenate([point.nu * self.D, rows / self.E])


@dataclass(frozen=True, eq=False)
class ScaledQP(Scales):
    """H (n, n), G (r, n), and what scales them."""

    H: Matrix
    G: Matrix


def stacked(problem: QP) -> tuple[Vector, Vector, Dense]:
    """Return bounds of z and then of the rows [A; C], which come dense."""
    rows = [matrices.dense(M) for M in (problem.A, problem.C) if M.shape[0]]
    G = rows[0] if len(rows) == 1 else np.vstack(rows) if rows else np.zeros((0, problem.p.size))
    return *limits(problem), G


def limits(problem: QP | SparseQP) -> tuple[Vector, Vector]:
    """Return bounds of z and then of the rows [A; C]."""
    lower = np.concatenate([problem.lb, problem.b, problem.d])
    return lower, np.concatenate([problem.ub, np.full(problem.b.size, np.inf), problem.d])


def scaled(problem: QP, *, keep_sparse: bool = False) -> ScaledQP:
    """Return the scaled problem, dense unless `keep_sparse` and some of its matrices are sparse."""
    n, r = problem.p.size, problem.b.size + problem.d.size
    if keep_sparse and any(matrices.is_sparse(M) for M in (problem.Q, problem.A, problem.C)):
        scales, H, G = sparse_scaled(sparse_data(problem))
        return ScaledQP(
            **vars(scales),
            H=sp.csr_array((H[2], H[1], H[0]), shape=(n, n)),
            G=sp.csr_array((G[2], G[1], G[0]), shape=(r, n)),
        )
    D, E = np.ones(n), np.ones(r)
    H, G = np.array(matrices.dense(problem.Q)), np.array(stacked(problem)[2])
    qp_dense.equilibrate(H, G, D, E, PASSES)
    scales = _scales(problem, D, E, max_abs(H))
    return ScaledQP(**vars(scales), H=scales.c * H, G=G)


def sparse_scaled(data: SparseQP) -> tuple[Scales, Entries, Entries]:
    """Return the scales, and H and G as the kernels take sparse matrices."""
    (indptr, indices, numbers), (G_indptr, G_indices, G_numbers) = data.Q, data.G
    H: Entries = indptr.copy(), indices.copy(), numbers.copy()
    G: Entries = G_indptr.copy(), G_indices.copy(), G_numbers.copy()
    D, E = np.ones(data.p.size), np.ones(data.b.size + data.d.size)
    qp_sparse.equilibrate(H, G, D, E, PASSES)
    scales = _scales(data, D, E, max_abs(H[2]))
    H[2][:] *= scales.c
    return scales, H, G


def _scales(problem: QP | SparseQP, D: Vector, E: Vector, top: float) -> Scales:
    """top : of the scaled Q."""
    g, by, (lower, upper) = D * problem.p, np.concatenate([1.0 / D, E]), limits(problem)
    c = float(2.0 ** -np.round(np.log2(max(top, max_abs(g)) or 1.0)))
    return Scales(problem, c * g, lower * by, upper * by, D, E, c)


def equilibrate(M: Matrix, groups: Any) -> Vector:
    """Return d > 0, equal within each group, such that the largest entry of every group of rows of diag(d) M diag(d) is
    about 1 (symmetric Ruiz scaling); a group of zero rows and columns keeps 1. Shape (n,).
    """
    n = M.shape[0]
    d = np.ones(n)
    if n == 0:
        return d
    size: Any = abs(M)
    for _ in range(RUIZ_STEPS):
        rows = _tops(congruent(size, d))
        top = np.zeros(int(groups[-1]) + 1)
        np.maximum.at(top, groups, rows)
        d = d / np.sqrt(np.where(top > 0, top, 1.0))[groups]
    return d


def _tops(size: Any) -> Vector:
    """Return the largest number of every row and column with the same index."""
    tops = [size.max(axis=axis) for axis in (0, 1)]
    return np.maximum(*[top.toarray().ravel() if sp.issparse(size) else top for top in tops])


def congruent(M: Matrix, d: Vector) -> Matrix:
    """Return diag(d) M diag(d)."""
    return sp.csr_array(sp.diags_array(d) @ M @ sp.diags_array(d)) if sp.issparse(M) else M * d[:, None] * d
