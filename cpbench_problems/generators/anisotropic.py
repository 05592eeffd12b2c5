"""Friction that differs along the two tangents, with associated slip: what pushes is not what opposes.

Sliding with u, the reaction is r_T = −r_N (μ₁²u₁, μ₂²u₂)/‖(μ₁u₁, μ₂u₂)‖; it is made exact by (μ₁u₁, μ₂u₂) along (3, 4).
"""

from __future__ import annotations

import numpy as np

from cpbench.formulations.contact import FCPoint
from cpbench.formulations.local_contact import AnisotropicFrictionContact, FrictionContact
from cpbench.foundation.matrices import Dense, Matrix
from cpbench.generators.base import Instance, collection, generator
from cpbench_problems.generators.contact_planted import DIRECTIONS, chain, delassus


@collection(
    "anisotropic",
    "afc",
    "blocks on planes with an elliptic friction cone",
    "Michalowski and Mroz 1978, Arch. Mech. 30:259 (associated slip); planted by cpbench",
)
def build() -> list[Instance]:
    sizes = range(10, 18)
    return [block(1.0, 0.25), block(1.0, 2.0**-10), *(_planted(f"planted-{nc}", nc) for nc in sizes)]


@collection(
    "anisotropic-large",
    "afc",
    "up to 30,000 contacts with an elliptic friction cone",
    "planted by cpbench",
    tier="standard",
)
def build_large() -> list[Instance]:
    return [
        *(_planted(f"planted-{nc}", nc) for nc in (100, 200, 400)),
        *(_chain(nc) for nc in (600, 1000, 2000, 3000, 30_000)),
    ]


def block(mu_1: float, mu_2: float) -> Instance:
    """Build a block of 1 kg, pressed by 5 N, that slides with u = (3/μ₁, 4/μ₂): friction is r_T = −(3μ₁, 4μ₂)."""
    r = np.array([5.0, -3.0 * mu_1, -4.0 * mu_2])
    u = np.array([0.0, 3.0 / mu_1, 4.0 / mu_2])
    ratio = round(mu_1 / mu_2)
    problem = AnisotropicFrictionContact(W=np.eye(3), q=u - r, mu=[[mu_1, mu_2]], name=f"block-{ratio}")  # pyright: ignore
    return Instance(problem, FCPoint(r=r), "closed form", properties={"ratio": ratio, "rank": 3, "symmetric": True})


def _planted(name: str, nc: int) -> Instance:
    rng = generator(41)
    return _around(name, delassus(rng, nc, 8, 3, 1), rng)


def _chain(nc: int) -> Instance:
    """Build a row of spheres that touch their neighbours, with the sparse W of `contact-chains`."""
    problem = chain(nc).problem
    assert isinstance(problem, FrictionContact)
    return _around(f"chain-{nc}", problem.W, generator(4100 + nc))


def _around(name: str, W: Matrix, rng: np.random.Generator) -> Instance:
    """Plant contacts in all states with coefficients 2⁻³ … 1; r = Sr′ and u = S⁻¹u′ of isotropic contacts with μ =
    1.
    """
    nc = W.shape[0] // 3
    states = [("stick", "slide", "open", "graze")[c % 4] for c in range(nc)]
    mu: Dense = np.asarray(2.0 ** rng.integers(-3, 1, (nc, 2)), dtype=np.float64)
    r, u = np.zeros((nc, 3)), np.zeros((nc, 3))
    for c, state in enumerate(states):
        direction = DIRECTIONS[rng.integers(8)]
        match state:
            case "stick":
                r[c] = np.r_[8.0, direction]
            case "slide":
                r[c], u[c] = np.r_[5.0, direction], np.r_[0.0, -direction / 4]
            case "open":
                u[c] = np.r_[2.0, direction / 16]
            case _:
                u[c] = np.r_[0.0, direction / 4]
    r[:, 1:] *= mu
    u[:, 1:] /= mu
    problem = AnisotropicFrictionContact(W=W, q=u.ravel() - W @ r.ravel(), mu=mu, name=name)
    properties = {"symmetric": True, "states": {s: states.count(s) for s in ("stick", "slide", "open", "graze")}}
    return Instance(problem, FCPoint(r=r.ravel()), "planted", properties=properties)
