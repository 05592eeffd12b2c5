"""MLCPs made for a solution: u, v, w first, then a = −Au − Cv and b = w − Du − Bv, exactly."""

from __future__ import annotations

import numpy as np

from cpbench.formulations.linear import MLCP, MLCPPoint
from cpbench.foundation.matrices import Dense
from cpbench.generators.base import Instance, collection, dyadic, generator


@collection("mlcp-planted", "mlcp", "mixed LCPs of known structure with a planted solution", "planted by cpbench")
def build() -> list[Instance]:
    """Build positive definite, nonsymmetric, KKT-like (A singular), degenerate ones; more equalities than
    complementarities.
    """
    rng = generator(7)
    return [
        _monotone("monotone-10-10", rng, 10, 10),
        _monotone("monotone-40-60", rng, 40, 60),
        _monotone("many-equalities-60-10", rng, 60, 10),
        _monotone("degenerate-15-20", rng, 15, 20, degenerate=True),
        _kkt("kkt-30-20", rng, 20, 10, 20),
        _singular("singular-A-12-12", rng, 12),
    ]


def _planted(
    name: str,
    rng: np.random.Generator,
    blocks: tuple[Dense, Dense, Dense, Dense],
    properties: dict[str, object],
    *,
    degenerate: bool = False,
) -> Instance:
    A, B, C, D = blocks
    n, m = C.shape
    u = dyadic(rng, n, -2, 2)
    value = dyadic(rng, m, 0, 3) + 1.0 / 8
    active = rng.integers(0, 2, m) == 1
    v, w = np.where(active, value, 0.0), np.where(active, 0.0, value)
    if degenerate:
        v[::4] = w[::4] = 0.0
    problem = MLCP(A=A, B=B, C=C, D=D, a=-(A @ u) - C @ v, b=w - D @ u - B @ v, name=name)
    return Instance(problem, MLCPPoint(u=u, v=v), "planted", properties=properties)


def _monotone(name: str, rng: np.random.Generator, n: int, m: int, *, degenerate: bool = False) -> Instance:
    """Build [[A, C], [D, B]] = GGᵀ + I + a skew part."""
    size = n + m
    G, S = dyadic(rng, (size, size), -1, 1), dyadic(rng, (size, size), -1, 1)
    whole = G @ G.T + np.eye(size) + np.triu(S, 1) - np.triu(S, 1).T
    blocks = (whole[:n, :n], whole[n:, n:], whole[:n, n:], whole[n:, :n])
    return _planted(name, rng, blocks, {"class": "PD nonsymmetric"}, degenerate=degenerate)


def _kkt(name: str, rng: np.random.Generator, n: int, k: int, m: int) -> Instance:
    """Build optimality conditions of a strictly convex QP with k equalities and m inequalities: A indefinite, B = 0."""
    G = dyadic(rng, (n, n), -1, 1)
    E, F = dyadic(rng, (k, n), -1, 1), dyadic(rng, (m, n), -1, 1)
    A = np.block([[G @ G.T + np.eye(n), -E.T], [E, np.zeros((k, k))]])
    C = np.vstack([-F.T, np.zeros((k, m))])
    return _planted(name, rng, (A, np.zeros((m, m)), C, -C.T), {"class": "KKT"})


def _singular(name: str, rng: np.random.Generator, n: int) -> Instance:
    """Build A of rank n − 2 (no Schur complement), D = −Cᵀ, B = I: monotone as stored, so that splitting keeps it
    so.
    """
    G = dyadic(rng, (n, n - 2), -1, 1)
    C = dyadic(rng, (n, n), -1, 1)
    return _planted(name, rng, (G @ G.T, np.eye(n), C, -C.T), {"class": "PSD", "rank_A": n - 2})
