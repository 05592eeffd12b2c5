"""Quasi-variational inequalities: games with a common limit, Coulomb's friction, obstacles that give way."""

from __future__ import annotations

from typing import Any

import numpy as np

from cpbench.formulations.variational import QVI, QVIPoint
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.generators.base import Instance, collection, dyadic, generator
from cpbench_problems.generators.contact_planted import STATES, contact_states
from cpbench_problems.generators.ncp_classics import formula_map
from cpbench_problems.generators.symbols import Symbol, mapped, product, unknowns


@collection(
    "qvi-games",
    "qvi",
    "Harker's duopoly with a common limit, in two forms",
    "Harker 1991, Eur. J. Oper. Res. 54:81; Facchinei and Kanzow 2010, Ann. Oper. Res. 175:177",
)
def build_games() -> list[Instance]:
    return [duopoly(rows=False), duopoly(rows=True)]


@collection(
    "qvi-friction",
    "qvi",
    "Coulomb's friction: a disk whose radius is μ times the normal reaction",
    "Acary and Brogliato 2008, Numerical Methods for Nonsmooth Dynamical Systems; planted by cpbench",
)
def build_friction() -> list[Instance]:
    return [friction(nc) for nc in (1, 6, 20)]


@collection(
    "qvi-obstacles",
    "qvi",
    "implicit obstacle problems: what holds the membrane gives way to it",
    "Outrata, Kočvara, Zowe 1998, Nonsmooth Approach to Optimization Problems with Equilibrium Constraints, ch. 9; "
    "planted by cpbench",
)
def build_obstacles() -> list[Instance]:
    return [yielding_obstacle(n) for n in (8, 20, 30, 40, 50, 60, 80)]


@collection(
    "qvi-obstacles-large",
    "qvi",
    "implicit obstacle problems of up to 10⁴ points",
    "Outrata, Kočvara, Zowe 1998, ch. 9; planted by cpbench",
    tier="standard",
)
def build_large() -> list[Instance]:
    return [yielding_obstacle(n) for n in (500, 1000, 1500, 2000, 3000, 5000, 10_000)]


def duopoly(*, rows: bool) -> Instance:
    """Build 0 ≤ z ≤ 10, z₁ + z₂ ≤ 15: each chooses within what the other leaves. `rows`: the limit as g(y, z) ≥ 0.

    Equilibria: (5, 9), which is also the one with equal multipliers, and (t, 15 − t) for 9 ≤ t ≤ 10.
    """

    def F(z: list[Symbol]) -> list[Symbol]:
        return [2.0 * z[0] + (8.0 / 3.0) * z[1] - 34.0, 1.25 * z[0] + 2.0 * z[1] - 24.25]

    limit: dict[str, Any] = (
        {"g": formula_map(4, lambda x: [15.0 - x[0] - x[3], 15.0 - x[2] - x[1]])}  # x = (y₁, y₂, z₁, z₂)
        if rows
        else {"upper": formula_map(2, lambda z: [15.0 - z[1], 15.0 - z[0]])}
    )
    starts = [np.array(z) for z in ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0))]
    none = np.zeros(2 if rows else 0)
    problem = QVI(
        F=formula_map(2, F), lb=np.zeros(2), ub=np.full(2, 10.0), name="duopoly-rows" if rows else "duopoly", **limit
    )
    facts = {
        "class": "many solutions",
        "solutions": "(5, 9); (t, 15 - t) for 9 <= t <= 10",
        "set": "g" if rows else "box",
    }
    return Instance(
        problem,
        QVIPoint(z=[5.0, 9.0], nu=none),
        "published",
        None,
        facts,
        tuple(QVIPoint(z=z, nu=none) for z in starts),
    )


def friction(nc: int) -> Instance:
    """Build X(r) = Π ℝ₊ × disk(μ r_N), F = Wr + q: contacts that stick, slide or are open, by turns; μ = ⅝."""
    rng = generator(nc)
    n = 3 * nc
    r, u = contact_states(rng, [STATES[(k + 1) % 3] for k in range(nc)], 0.625, 3)
    H = dyadic(rng, (n + 3, n), -1, 1, 2)
    W = H.T @ H / 8.0 + np.eye(n)
    q = u.ravel() - W @ r.ravel()
    K = ProductCone.of((Cone.CYLINDER, nc, 3, 0.625))
    x = unknowns(n)
    problem = QVI(
        F=mapped(x, [row + c for row, c in zip(product(W, x), q.tolist(), strict=True)]),
        cone_kind=K.kind, cone_size=K.size, cone_mu=K.mu, cone_mu_r=K.mu_r, name=f"friction-{nc}",
    )  # fmt: skip
    return Instance(problem, QVIPoint(z=r.ravel()), "planted", properties={"class": "affine, SPD", "mu": 0.625})


def yielding_obstacle(n: int) -> Instance:
    """Build −Δu + u³ = f above lower_i(u) = a_i − (u_{i−1} + u_{i+1})/8, u = 0 at both ends; every third point is held.

    The membrane pushes its neighbourhood down. Heights and forces are planted.
    """
    rng = generator(700 + n)
    size = dyadic(rng, n, 1, 4)
    held = np.arange(n) % 3 == 0
    z = dyadic(rng, n, 1, 4)
    w = np.where(held, size, 0.0)
    around = np.pad(z, 1)
    give = (around[:-2] + around[2:]) / 8.0
    a = z + give - np.where(held, 0.0, size)
    f = 2.0 * z - around[:-2] - around[2:] + z**3 - w
    u = unknowns(n)

    def neighbours(i: int) -> list[Symbol]:
        return [u[j] for j in (i - 1, i + 1) if 0 <= j < n]

    rows, lower = [], []
    for i in range(n):
        row, beside = 2.0 * u[i] + u[i] ** 3, float(a[i])
        for v in neighbours(i):
            row, beside = row - v, beside - 0.125 * v
        rows.append(row - float(f[i]))
        lower.append(beside)
    problem = QVI(F=mapped(u, rows), lower=mapped(u, lower), name=f"yielding-obstacle-{n}")
    return Instance(problem, QVIPoint(z=z), "planted", properties={"class": "strongly monotone, moving bounds"})
