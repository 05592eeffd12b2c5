"""Affine variational inequalities: traffic equilibrium, nearest points, and planted ones."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.linear import AVI, AVIPoint
from cpbench.foundation.matrices import Matrix, Sparse
from cpbench.generators.base import Instance, collection, dyadic, generator


@collection(
    "affine-inequalities",
    "avi",
    "affine variational inequalities over boxes and polyhedra with known solutions",
    "Braess 1968, Unternehmensforschung 12:258; Held, Wolfe, Crowder 1974, Math. Prog. 6:62; planted by cpbench",
)
def build() -> list[Instance]:
    rng = generator(23)
    return [
        braess(),
        nearest_in_simplex(),
        _planted("polyhedral-24", rng, 24, 12, 4),
        _planted("degenerate-box-40", rng, 40, 0, 0),
        *(_planted(f"polyhedral-{n}", rng, n, n // 2, n // 8) for n in (30, 32, 34, 36)),
        *(_planted(f"degenerate-box-{n}", rng, n, 0, 0) for n in (30, 36)),
    ]


@collection(
    "affine-inequalities-large",
    "avi",
    "affine variational inequalities: dense ones of up to 1000 unknowns, sparse ones of up to 10⁵",
    "planted by cpbench",
    tier="standard",
)
def build_large() -> list[Instance]:
    rng = generator(2300)
    wide = [_planted(f"polyhedral-{n}", rng, n, n // 2, n // 8) for n in (300, 1000)]
    dense = [*wide, _planted("degenerate-box-1000", rng, 1000, 0, 0)]
    return [*dense, *(_sparse(n, generator(2301 + n)) for n in (1500, 2500, 4000, 10_000, 100_000))]


def braess() -> Instance:
    """Build Braess' network with its bridge: 6 units over three routes, 2 each, at cost 92 (83 without the bridge).

    Links cost 10x, 50 + x, 50 + x, 10x, and the bridge 10 + x; z are the flows of the routes, μ their common cost.
    """
    routes = np.array([[1.0, 0, 1], [0, 1, 0], [1, 0, 0], [0, 1, 1], [0, 0, 1]])
    slope, fixed = np.array([10.0, 1, 1, 10, 1]), np.array([0.0, 50, 50, 0, 10])
    problem = AVI(
        M=routes.T @ (slope[:, None] * routes),
        q=routes.T @ fixed,
        C=np.ones((1, 3)),
        d=[6.0],
        lb=np.zeros(3),
        name="braess",
    )
    return Instance(problem, AVIPoint(z=[2.0, 2.0, 2.0], mu=[92.0]), "published", properties={"class": "SPD"})


def nearest_in_simplex() -> Instance:
    """Build the point of {z ≥ 0, Σz = 1} nearest to p: z = max(p − τ, 0) with Σz = 1."""
    p = np.array([0.75, 0.625, 0.5, 0.375, 0.25, 0.125, 0.0, -1.0])
    tau = 0.3125  # four are above: 2.25 − 4τ = 1
    z = np.maximum(p - tau, 0.0)
    problem = AVI(M=np.eye(8), q=-p, C=np.ones((1, 8)), d=[1.0], lb=np.zeros(8), name="nearest-in-simplex")
    return Instance(problem, AVIPoint(z=z, mu=[-tau]), "closed form", properties={"class": "SPD"})


def _planted(name: str, rng: np.random.Generator, n: int, m: int, k: int) -> Instance:
    G, S = dyadic(rng, (n, n), -1, 1), dyadic(rng, (n, n), -1, 1)
    M = G @ G.T + np.eye(n) + np.triu(S, 1) - np.triu(S, 1).T
    return _around(name, rng, M, dyadic(rng, (m, n), -1, 1), dyadic(rng, (k, n), -1, 1))


def _sparse(n: int, rng: np.random.Generator) -> Instance:
    """Build unknowns in a row, M of `tridiagonal`; every row of A and C has three neighbours."""
    M, A, C = tridiagonal(rng, n), _neighbours(rng, n // 2, n), _neighbours(rng, n // 8, n)
    return _around(f"sparse-polyhedral-{n}", rng, M, A, C)


def tridiagonal(rng: np.random.Generator, n: int) -> Sparse:
    """Return tridiag(−1, 4, −1) with a drawn skew part beside the diagonal; positive definite, shape (n, n)."""
    skew = dyadic(rng, n - 1, -1, 1)
    return sp.csr_array(sp.diags_array([-1.0 - skew, np.full(n, 4.0), skew - 1.0], offsets=[-1, 0, 1]))


def _neighbours(rng: np.random.Generator, rows: int, n: int) -> Sparse:
    """Return (rows, n) with entries ½ … 1 of drawn sign in three neighbouring columns of each row."""
    first = np.arange(rows) * (n - 2) // rows
    values = rng.integers(4, 9, 3 * rows) / 8.0 * rng.choice([-1.0, 1.0], 3 * rows)
    columns = (first[:, None] + np.arange(3)).ravel()
    return sp.csr_array((values, columns, 3 * np.arange(rows + 1)), shape=(rows, n))


def _around(name: str, rng: np.random.Generator, M: Matrix, A: Matrix, C: Matrix) -> Instance:
    """Plant a solution: every second row is active; unknowns in turn at the lower and the upper bound, between them,
    without bounds, and at a bound with no multiplier.
    """
    n, m, k = M.shape[0], A.shape[0], C.shape[0]
    z, mu = dyadic(rng, n, -2, 2), dyadic(rng, k, -2, 2)
    active, size = np.arange(m) % 2 == 0, dyadic(rng, m, 0, 3) + 0.125
    lam, slack = np.where(active, size, 0.0), np.where(active, 0.0, size)
    state = np.arange(n) % 5
    lb = np.select([(state == 0) | (state == 4), state == 3], [z, -np.inf], z - 1.0)
    ub = np.select([state == 1, state == 3], [z, np.inf], z + 1.0)
    F = np.select([state == 0, state == 1], [0.75, -0.5], 0.0)
    problem = AVI(M=M, q=F - M @ z + A.T @ lam + C.T @ mu, A=A, b=A @ z - slack, C=C, d=C @ z, lb=lb, ub=ub, name=name)
    properties = {"class": "PD nonsymmetric", "degenerate": True}
    return Instance(problem, AVIPoint(z=z, lam=lam, mu=mu), "planted", properties=properties)
