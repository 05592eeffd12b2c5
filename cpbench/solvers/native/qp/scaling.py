"""A QP with data near size one: min ½xᵀHx + gᵀx subject to lower ≤ (x, Gx) ≤ upper, G the rows of A and then of C.

z = Dx, H = c DQD, g = c Dp, rows E[A; C]D, with diagonal D, E of powers of two. Its multipliers y (of x and then of Gx,
positive at lower bounds, negative at upper ones) are those of the problem divided by D and E, times c.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from cpbench import matrices
from cpbench.formulations.qp import QP, QPPoint
from cpbench.kernel_cache import load
from cpbench.matrices import Dense, Matrix, Vector, max_abs
from cpbench.solvers.native.qp.claims import KERNEL

PASSES = 4
"""Of equilibration; every one takes the root of what is left."""


@dataclass(frozen=True, eq=False)
class ScaledQP:
    """problem : what was asked. H (n, n), g (n,), G (r, n), lower, upper (n + r,). D (n,), E (r,), c : the scales."""

    problem: QP
    H: Matrix
    g: Vector
    G: Matrix
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


def stacked(problem: QP) -> tuple[Vector, Vector, Dense]:
    """Return bounds of z and then of the rows [A; C], which come dense."""
    rows = [matrices.dense(M) for M in (problem.A, problem.C) if M.shape[0]]
    G = rows[0] if len(rows) == 1 else np.vstack(rows) if rows else np.zeros((0, problem.p.size))
    return *limits(problem), G


def limits(problem: QP) -> tuple[Vector, Vector]:
    """Return bounds of z and then of the rows [A; C]."""
    lower = np.concatenate([problem.lb, problem.b, problem.d])
    return lower, np.concatenate([problem.ub, np.full(problem.b.size, np.inf), problem.d])


def scaled(problem: QP, *, keep_sparse: bool = False) -> ScaledQP:
    """Return the scaled problem, dense unless `keep_sparse` and some of its matrices are sparse."""
    n, r = problem.p.size, problem.b.size + problem.d.size
    D, E = np.ones(n), np.ones(r)
    lower, upper = limits(problem)
    if keep_sparse and any(matrices.is_sparse(M) for M in (problem.Q, problem.A, problem.C)):
        H, G = sp.csr_array(problem.Q), sp.csr_array(sp.vstack([problem.A, problem.C], format="csr"))
        H, G = _sparse_equilibrated(H, G, D, E)
    else:
        _, _, G = stacked(problem)
        H, G = np.array(matrices.dense(problem.Q)), np.array(G)
        load(KERNEL).equilibrate(H, G, D, E, PASSES)
    g = D * problem.p
    c = 2.0 ** -np.round(np.log2(max(max_abs(H), max_abs(g)) or 1.0))
    by = np.concatenate([1.0 / D, E])
    return ScaledQP(problem, c * H, c * g, G, lower * by, upper * by, D, E, float(c))


def _sparse_equilibrated(H: sp.csr_array, G: sp.csr_array, D: Vector, E: Vector) -> tuple[Matrix, Matrix]:
    """Equilibrate as the kernel `equilibrate` does, entries of sparse matrices."""
    H, G = H.copy(), G.copy()
    h_rows = np.repeat(np.arange(H.shape[0]), np.diff(H.indptr))
    g_rows = np.repeat(np.arange(G.shape[0]), np.diff(G.indptr))
    for _ in range(PASSES):
        column, row = np.zeros(D.size), np.zeros(E.size)
        np.maximum.at(column, H.indices, abs(H.data))
        np.maximum.at(column, G.indices, abs(G.data))
        np.maximum.at(row, g_rows, abs(G.data))
        column, row = _root(column), _root(row)
        H.data *= column[h_rows] * column[H.indices]
        G.data *= row[g_rows] * column[G.indices]
        D *= column
        E *= row
    return H, G


def _root(size: Vector) -> Vector:
    """Return powers of two near size^-½, 1 where the size is 0."""
    return 2.0 ** np.round(-0.5 * np.log2(np.where(size > 0.0, size, 1.0)))
