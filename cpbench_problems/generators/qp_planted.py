"""QPs made for a solution: z, the active set and the multipliers first, then p, b, d and the bounds, exactly."""

from __future__ import annotations

import numpy as np

from cpbench.formulations.programs import QP, QPPoint
from cpbench.foundation.matrices import Dense
from cpbench.generators.base import Instance, collection, dyadic, generator


@collection("qp-planted", "qp", "convex QPs of known structure with planted z and multipliers", "planted by cpbench")
def build() -> list[Instance]:
    """Build strictly convex, singular and degenerate QPs, with bounds only, equalities only, and a linear program."""
    rng = generator(11)
    return [
        _planted("spd-20-15", rng, _spd(rng, 20), 15, 0, bounds=False),
        _planted("spd-60-40-10", rng, _spd(rng, 60), 40, 10, bounds=True),
        _planted("psd-30-25-5", rng, _psd(rng, 30), 25, 5, bounds=True),
        _planted("bounds-50", rng, _spd(rng, 50), 0, 0, bounds=True),
        _planted("equalities-30-12", rng, _spd(rng, 30), 0, 12, bounds=False),
        _planted("linear-20-25", rng, np.zeros((20, 20)), 25, 5, bounds=True),
        _planted("degenerate-25-20", rng, _spd(rng, 25), 20, 5, bounds=True, degenerate=True),
    ]


def _spd(rng: np.random.Generator, n: int) -> Dense:
    G = dyadic(rng, (n, n), -1, 1)
    return G @ G.T + np.eye(n)


def _psd(rng: np.random.Generator, n: int) -> Dense:
    G = dyadic(rng, (n, n // 2), -1, 1)
    return G @ G.T


def _planted(
    name: str, rng: np.random.Generator, Q: Dense, m: int, k: int, *, bounds: bool, degenerate: bool = False
) -> Instance:
    """Plant a solution at which half of the inequalities and a third of the bounds are active; degenerate: some with
    multiplier 0.
    """
    n = Q.shape[0]
    A, C = dyadic(rng, (m, n), -1, 1), dyadic(rng, (k, n), -1, 1)
    z, mu = dyadic(rng, n, -2, 2), dyadic(rng, k, -2, 2)
    value = dyadic(rng, m, 0, 3) + 1.0 / 8
    active = np.arange(m) % 2 == 0
    lam, slack = np.where(active, value, 0.0), np.where(active, 0.0, value)
    lb, ub, nu = np.full(n, -np.inf), np.full(n, np.inf), np.zeros(n)
    if bounds:
        which = np.arange(n) % 6
        lb, ub = z - 1.0, z + 1.0
        lb[which == 0], nu[which == 0] = z[which == 0], 0.5
        ub[which == 1], nu[which == 1] = z[which == 1], -0.5
        lb[which == 2], ub[which == 3] = -np.inf, np.inf
    if degenerate:
        lam[::4] = 0.0
    p = A.T @ lam + C.T @ mu + nu - Q @ z
    problem = QP.build(Q, p, A=A, b=A @ z - slack, C=C, d=C @ z, lb=lb, ub=ub, name=name)
    rank = "LP" if not Q.any() else "SPD" if name.startswith(("spd", "bounds", "eq", "deg")) else "PSD singular"
    properties = {"class": rank, "bounds": bounds, "degenerate": degenerate}
    return Instance(problem, QPPoint(z=z, lam=lam, mu=mu, nu=nu), "planted", properties=properties)
