"""Relay problems: one implicit Euler step of sliding-mode systems, and planted ones.

ẋ = f − B s, s ∈ Sgn(x), over a step h: x = x₀ + hBz with z = −s ∈ [−1, 1] and −x ∈ N_[−1,1](z), a relay problem with
M = hB and q = x₀. Explicit steps would chatter around x = 0; here a step that can reach it lands there with |z| < 1.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.linear import LCPPoint, Relay
from cpbench.foundation.matrices import Matrix, Vector
from cpbench.generators.base import Instance, collection, dyadic, generator

STEP = 2.0**-6


@collection(
    "relays",
    "relay",
    "steps of sliding-mode systems, and relays with a planted solution",
    "Acary and Brogliato 2010, Syst. Control Lett. 59:284; Filippov 1988; planted by cpbench",
)
def build() -> list[Instance]:
    rng = generator(21)
    return [
        sliding_scalars(),
        filippov_spiral(),
        _planted("monotone-20", rng, 20),
        _sparse("sparse-60", rng, 60),
        *(_planted(f"monotone-{n}", rng, n) for n in (30, 40)),
        *(_sparse(f"sparse-{n}", rng, n) for n in (30, 50, 100, 200, 400)),
    ]


def sliding_scalars() -> Instance:
    """Build ẋ = −Sgn(x), several at once: |x₀| ≤ h ends at 0 with z = −x₀/h, any other moves by h towards it."""
    x0 = STEP * np.array([0.0, 0.25, -0.75, 1.0, 3.0, -2.0, 0.5, -8.0])
    problem = Relay(M=STEP * np.eye(8), q=x0, lb=-np.ones(8), ub=np.ones(8), name="sliding-scalars")
    return Instance(problem, LCPPoint(z=np.clip(-x0 / STEP, -1.0, 1.0)), "closed form", properties={"class": "SPD"})


def filippov_spiral() -> Instance:
    """Build ẋ₁ = −s₁ + 2s₂, ẋ₂ = −2s₁ − s₂, a spiral into 0 in finite time; the step that gets there, z = (1/4,
    −1/2).
    """
    M, z = STEP * np.array([[1.0, -2.0], [2.0, 1.0]]), np.array([0.25, -0.5])
    problem = Relay(M=M, q=-M @ z, lb=-np.ones(2), ub=np.ones(2), name="filippov-spiral")
    return Instance(problem, LCPPoint(z=z), "closed form", properties={"class": "PD nonsymmetric"})


def _around(name: str, M: Matrix, rng: np.random.Generator, properties: dict[str, Any]) -> Instance:
    """Build z at a bound, between, or at a bound without force (one in five)."""
    n = M.shape[0]
    state = rng.integers(0, 5, n)
    z: Vector = dyadic(rng, n, -2, 2)
    lb = np.where((state == 0) | (state == 4), z, z - 1.0)
    ub = np.where(state == 1, z, z + 0.5)
    w = np.select([state == 0, state == 1], [1.0 + dyadic(rng, n, 0, 2), -0.5 - dyadic(rng, n, 0, 2)], 0.0)
    problem = Relay(M=M, q=w - M @ z, lb=lb, ub=ub, name=name)
    return Instance(problem, LCPPoint(z=z), "planted", properties={"degenerate": True, **properties})


@collection(
    "relays-large",
    "relay",
    "chains of masses with dry friction, to 10⁵ masses",
    "Acary and Brogliato 2010, Syst. Control Lett. 59:284; planted by cpbench",
    tier="standard",
)
def build_large() -> list[Instance]:
    rng = generator(2100)
    sparse = [_sparse(f"sparse-{n}", rng, n) for n in (2000, 5000, 10_000, 100_000)]
    return [_planted(f"monotone-{n}", rng, n) for n in (300, 1000)] + sparse


def _planted(name: str, rng: np.random.Generator, n: int) -> Instance:
    G, S = dyadic(rng, (n, n), -1, 1), dyadic(rng, (n, n), -1, 1)
    M = G @ G.T + np.eye(n) + np.triu(S, 1) - np.triu(S, 1).T
    return _around(name, M, rng, {"class": "PD nonsymmetric"})


def _sparse(name: str, rng: np.random.Generator, n: int) -> Instance:
    """Build a tridiagonal system: a chain of masses with dry friction, coupled by springs."""
    M = sp.diags_array([np.full(n - 1, -1.0), np.full(n, 2.5), np.full(n - 1, -1.0)], offsets=[-1, 0, 1])
    return _around(name, sp.csr_array(M), rng, {"class": "SPD"})
