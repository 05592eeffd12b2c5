"""Contact with joints, in global form (G, b) and condensed to the local mixed form (V, R, s)."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.global_contact import GFCPoint, GlobalFrictionContact
from cpbench.formulations.local_contact import FCMPoint, MixedFrictionContact
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Dense
from cpbench.generators.base import Instance, collection, dyadic, generator
from cpbench_problems.generators.contact_global import GRAVITY, STEP, inertia
from cpbench_problems.generators.contact_planted import MU, contact_states

WEIGHT = GRAVITY * STEP
"""Impulse of 1 kg over a step [N s]."""
CITATION = "statics and Newton's second law by hand; planted by cpbench"


@collection("contact-joints", "gfc", "bodies held by joints that touch the ground", CITATION)
def build_global() -> list[Instance]:
    return [rod(), train(4, doubled=True), _planted("jointed-6", 6, 8, 4)]


@collection("contact-joints-local", "fcm", "bodies held by joints that touch the ground, local mixed form", CITATION)
def build_local() -> list[Instance]:
    return [condensed(instance) for instance in (rod(), train(4, doubled=False), train(8, doubled=True))]


def rod() -> Instance:
    """Build a rod of 1 kg and 2 m at rest, one end on a pivot, the other on the ground: each carries half of the
    weight.

    Unknowns (v_x, v_y, ω) of its centre, inertia 1/4 kg m². Pivot and ground both hold it sideways: hyperstatic.
    """
    H = np.array([[0.0, 1], [1, 0], [1, 0]])
    G = np.array([[1.0, 0], [0, 1], [0, -1]])
    problem = GlobalFrictionContact(
        M=np.diag([1.0, 1.0, 0.25]), H=H, G=G, f=[0.0, -WEIGHT, 0.0], w=np.zeros(2), mu=[0.5], dimension=2, name="rod"
    )
    point = GFCPoint(v=np.zeros(3), r=[WEIGHT / 2, 0.0], lam=[0.0, WEIGHT / 2])
    return Instance(problem, point, "closed form", properties={"hyperstatic": True, "contacts": 1, "joints": 2})


def train(blocks: int, *, doubled: bool) -> Instance:
    """Build blocks of 1 kg in a row on the ground, coupled, the first pulled with 3μ of all their weight.

    All move with v = 2μg h; coupling k pulls the blocks behind it with three times their friction. `doubled` gives
    every coupling twice, so that the forces in them are not unique (each takes half).
    """
    n, mu = 2 * blocks, 0.5
    pull, speed = 3 * mu * blocks * WEIGHT, 2 * mu * WEIGHT
    H, G = np.zeros((n, n)), np.zeros((n, blocks - 1))
    for k in range(blocks):
        H[2 * k + 1, 2 * k], H[2 * k, 2 * k + 1] = 1.0, 1.0
    for k in range(blocks - 1):
        G[2 * k, k], G[2 * k + 2, k] = -1.0, 1.0
    f = np.tile([0.0, -WEIGHT], blocks)
    f[0] += pull
    lam = 3 * mu * WEIGHT * np.arange(blocks - 1, 0, -1)
    if doubled:
        G, lam = np.hstack([G, G]), np.concatenate([lam, lam]) / 2
    name = f"train-{blocks}-doubled" if doubled else f"train-{blocks}"
    problem = GlobalFrictionContact(
        M=np.eye(n), H=H, G=G, f=f, w=np.zeros(n), mu=np.full(blocks, mu), dimension=2, name=name
    )
    r = np.tile([WEIGHT, -mu * WEIGHT], blocks)
    point = GFCPoint(v=np.tile([speed, 0.0], blocks), r=r, lam=lam)
    properties = {"contacts": blocks, "joints": len(lam), "redundant joints": doubled}
    return Instance(problem, point, "closed form", properties=properties)


def condensed(instance: Instance, *, sparse: bool = False) -> Instance:
    """Return the local mixed form of a global problem whose masses are powers of two, so that all of it is exact."""
    p = instance.problem
    assert isinstance(p, GlobalFrictionContact)
    assert isinstance(instance.solution, GFCPoint)
    stored = matrices.sparse if sparse else matrices.dense
    H, G = stored(p.H), stored(p.G)
    inverse = 1.0 / matrices.sparse(p.M).diagonal()
    scaled_H, scaled_G = (sp.diags_array(inverse) @ X if sparse else inverse[:, None] * X for X in (H, G))
    problem = MixedFrictionContact(
        W=H.T @ scaled_H,
        V=H.T @ scaled_G,
        R=G.T @ scaled_G,
        q=H.T @ (inverse * p.f) + p.w,
        s=G.T @ (inverse * p.f) + p.b,
        mu=p.mu,
        dimension=p.dimension,
        name=p.name,
    )
    point = FCMPoint(r=instance.solution.r, lam=instance.solution.lam)
    return Instance(problem, point, instance.known, properties=instance.properties)


def _planted(name: str, bodies: int, nc: int, joints: int) -> Instance:
    """Plant bodies with full 6×6 inertia blocks, contacts in all states, joints between neighbours that move."""
    rng = generator(200 + bodies)
    n = 6 * bodies
    M = np.zeros((n, n))
    for b in range(bodies):
        M[6 * b : 6 * b + 6, 6 * b : 6 * b + 6] = inertia(rng)
    H, G = _between(rng, bodies, nc, 3), _between(rng, bodies, joints, 1)
    states = [("stick", "slide", "open")[int(rng.integers(3))] for _ in range(nc)]
    r, u = contact_states(rng, states, MU, 3)
    v, lam = dyadic(rng, n, -2, 2), dyadic(rng, joints, -2, 2)
    problem = GlobalFrictionContact(
        M=M,
        H=H,
        G=G,
        f=M @ v - H @ r.ravel() - G @ lam,
        w=u.ravel() - H.T @ v,
        b=-G.T @ v,
        mu=np.full(nc, MU),
        name=name,
    )
    properties = {"contacts": nc, "joints": joints, "states": {s: states.count(s) for s in ("stick", "slide", "open")}}
    return Instance(problem, GFCPoint(v=v, r=r.ravel(), lam=lam), "planted", properties=properties)


def _between(rng: np.random.Generator, bodies: int, count: int, columns: int) -> Dense:
    """Return columns that act on a body and, the other way, on its neighbour."""
    result = np.zeros((6 * bodies, columns * count))
    for c in range(count):
        for body, sign in ((c % bodies, 1.0), ((c + 1) % bodies, -1.0)):
            at = slice(columns * c, columns * (c + 1))
            result[6 * body : 6 * body + 6, at] = sign * dyadic(rng, (6, columns), -1, 1, 4)
    return result
