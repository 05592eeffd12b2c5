"""Frictional contact made for an answer: r and u first, contact by contact, then q = u − Wr, exactly.

A contact sticks (u = 0, r inside its cone), slides (u_T against r_T on the boundary of the cone), is open
(r = 0, u_N > 0) or grazes (r = 0, u = 0). Sliding directions are the Pythagorean (±3, ±4)/5, so that ‖r_T‖ = μ r_N
and ‖u_T‖ are exact; W = HᵀM⁻¹H has powers of two for masses.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.contact import FCPoint
from cpbench.formulations.local_contact import FrictionContact
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Dense, Matrix, Vector
from cpbench.generators.base import Instance, collection, dyadic, generator

CITATION = "planted by cpbench"

MU = 0.625
"""Friction of the planted contacts: r_N = 8 carries ‖r_T‖ = 5."""
DIRECTIONS = np.array([[3.0, 4], [4, 3], [-3, 4], [-4, 3], [3, -4], [4, -3], [-3, -4], [-4, -3]])
STATES = ("stick", "slide", "open", "graze")


@collection("contact-planted-3d", "fc", "three-dimensional contacts with planted reactions, Delassus form", CITATION)
def build_3d() -> list[Instance]:
    """Build contacts: full rank, hyperstatic, nonsymmetric, light beside heavy, frictionless, fast, one contact each
    way.
    """
    rng = generator(3)
    return [
        *(_one(state) for state in ("stick", "slide", "open")),
        fast_sliding(),
        _scene("full-rank-6", rng, nc=6, bodies=5, states=STATES[:3]),
        _scene("full-rank-30", rng, nc=30, bodies=20, states=STATES[:3]),
        _scene("hyperstatic-20", rng, nc=20, bodies=5, states=STATES[:2]),
        _scene("hyperstatic-60", rng, nc=60, bodies=14, states=STATES),
        _scene("light-beside-heavy-12", rng, nc=12, bodies=8, states=STATES[:3], masses=10),
        _scene("frictionless-10", rng, nc=10, bodies=6, states=("stick", "open"), mu=0.0),
        _scene("nonsymmetric-10", rng, nc=10, bodies=8, states=STATES[:3], skew=True),
    ]


@collection("contact-planted-2d", "fc", "two-dimensional contacts with planted reactions, Delassus form", CITATION)
def build_2d() -> list[Instance]:
    """Build contacts in the plane: full rank, hyperstatic, with all four states of a contact."""
    rng = generator(2)
    return [
        _scene("full-rank-2d-5", rng, nc=5, bodies=4, states=STATES[:3], dimension=2),
        _scene("full-rank-2d-40", rng, nc=40, bodies=30, states=STATES[:3], dimension=2),
        _scene("hyperstatic-2d-16", rng, nc=16, bodies=6, states=STATES, dimension=2),
    ]


@collection(
    "contact-planted-large",
    "fc",
    "a hundred and more contacts with planted reactions, Delassus form",
    "planted by cpbench",
    tier="standard",
)
def build_large() -> list[Instance]:
    """Build large problems, on which solvers of the whole matrix differ from those of one contact at a time."""
    rng = generator(4)
    return [
        _scene("full-rank-100", rng, nc=100, bodies=75, states=STATES[:3]),
        _scene("hyperstatic-150", rng, nc=150, bodies=35, states=STATES),
        _scene("light-beside-heavy-120", rng, nc=120, bodies=80, states=STATES[:3], masses=6),
        _scene("hyperstatic-2d-200", rng, nc=200, bodies=80, states=STATES, dimension=2),
        _scene("hyperstatic-400", rng, nc=400, bodies=95, states=STATES),
        _scene("light-beside-heavy-400", rng, nc=400, bodies=270, states=STATES[:3], masses=6),
    ]


@collection(
    "contact-chains", "fc", "chains of bodies that touch their neighbours, to 10⁵ rows", CITATION, tier="standard"
)
def build_chains() -> list[Instance]:
    return [chain(nc) for nc in (400, 600, 1000, 2000, 3000, 30_000)]


@collection("contact-chains-huge", "fc", "a chain of 10⁵ contacts", CITATION, tier="large")
def build_huge() -> list[Instance]:
    return [chain(100_000)]


def chain(nc: int) -> Instance:
    """Build a row of nc + 1 spheres of equal mass that touch their neighbours; W is block tridiagonal, the states of
    contacts are drawn."""
    rng = generator(400 + nc)
    arms = dyadic(rng, (2, nc, 3, 3), -1, 1, 4)
    c, axis, freedom = np.meshgrid(np.arange(nc), np.arange(3), np.arange(6), indexing="ij")
    parts = [np.concatenate([np.broadcast_to(np.eye(3), (nc, 3, 3)), arms[side]], axis=2) for side in (0, 1)]
    rows = np.concatenate([(6 * (c + side) + freedom).ravel() for side in (0, 1)])
    values = np.concatenate([sign * part.ravel() for sign, part in zip((1.0, -1.0), parts, strict=True)])
    H = sp.csr_array((values, (rows, np.tile((3 * c + axis).ravel(), 2))), shape=(6 * (nc + 1), 3 * nc))
    W = sp.csr_array(H.T @ H)
    states = [STATES[k] for k in rng.integers(0, 3, nc)]
    r, u = contact_states(rng, states, MU, 3)
    facts: dict[str, object] = {"symmetric": True, "states": {s: states.count(s) for s in STATES[:3]}}
    return planted(f"chain-{nc}", W, r, u, MU, facts)


def contact_states(rng: np.random.Generator, states: Sequence[str], mu: float, dimension: int) -> tuple[Dense, Dense]:
    """Return r and u of contacts in the given states, shape (nc, d) each; complementary by construction."""
    nc, d = len(states), dimension
    r, u = np.zeros((nc, d)), np.zeros((nc, d))
    for c, state in enumerate(states):
        direction = DIRECTIONS[rng.integers(8)] if d == 3 else np.array([5.0 * (1 - 2 * rng.integers(2))])
        size = 2.0 ** rng.integers(-1, 2)
        if state in ("stick", "slide"):
            r[c, 0] = 8.0 * size
            # inside the cone for sticking, on its boundary for sliding: ‖direction‖ = 5 = 8 MU
            r[c, 1:] = direction * size * (mu / MU) * (1.0 if state == "slide" else 0.5)
        if state == "slide":
            u[c, 1:] = -direction * 2.0 ** rng.integers(-3, 2)
        if state == "open":
            u[c, 0] = 2.0 + size
            u[c, 1:] = direction / 16.0
    return r, u


def delassus(rng: np.random.Generator, nc: int, bodies: int, dimension: int, masses: int) -> Matrix:
    """Return HᵀM⁻¹H of contacts between pairs of bodies in CSR, masses 2^-masses … 2^masses."""
    H = between_pairs(rng, nc, bodies, dimension)
    inverse = np.repeat(2.0 ** rng.integers(-masses, masses + 1, bodies), H.shape[0] // bodies)
    return sp.csr_array(H.T @ (sp.diags_array(inverse) @ H))


def between_pairs(rng: np.random.Generator, nc: int, bodies: int, dimension: int) -> sp.csr_array:
    """Return H of contacts that join two bodies of 6 (3 in the plane) freedoms each."""
    freedoms = 6 if dimension == 3 else 3
    H = sp.lil_array((freedoms * bodies, dimension * nc))
    for c in range(nc):
        columns = slice(dimension * c, dimension * (c + 1))
        first = c % bodies
        second = (first + 1 + int(rng.integers(bodies - 1))) % bodies
        for body, sign in ((first, 1.0), (second, -1.0)):
            arm = dyadic(rng, (freedoms - dimension, dimension), -1, 1, 4)
            H[freedoms * body : freedoms * (body + 1), columns] = sign * np.vstack([np.eye(dimension), arm])
    return sp.csr_array(H)


def _scene(
    name: str,
    rng: np.random.Generator,
    *,
    nc: int,
    bodies: int,
    states: Sequence[str],
    dimension: int = 3,
    mu: float = MU,
    masses: int = 2,
    skew: bool = False,
) -> Instance:
    W = delassus(rng, nc, bodies, dimension, masses)
    if skew:
        S = sp.csr_array(np.triu(dyadic(rng, W.shape, -1, 1), 1) / 64)
        W = sp.csr_array(W + S - S.T)
    chosen = [states[int(rng.integers(len(states)))] for _ in range(nc)]
    r, u = contact_states(rng, chosen, mu, dimension)
    rank = matrices.rank(W)
    properties = {"rank": rank, "symmetric": not skew, "states": {s: chosen.count(s) for s in states}}
    return planted(name, W, r, u, mu, properties)


def planted(name: str, W: Matrix, r: Dense, u: Dense, mu: float, properties: dict[str, object]) -> Instance:
    """Plant r and u in the local problem with friction `mu` everywhere."""
    nc, d = r.shape
    flat: Vector = r.ravel()
    problem = FrictionContact(W=W, q=u.ravel() - W @ flat, mu=np.full(nc, mu), dimension=d, name=name)
    return Instance(problem, FCPoint(r=flat), "planted", properties=properties)


def _one(state: str) -> Instance:
    """Build one contact with a full 3×3 block."""
    W = np.array([[2.0, 0.5, -0.25], [0.5, 1.5, 0.25], [-0.25, 0.25, 1.0]])
    r, u = contact_states(generator(1), [state], MU, 3)
    return planted(f"one-{state}", W, r, u, MU, {"rank": 3, "symmetric": True, "states": {state: 1}})


def fast_sliding() -> Instance:
    """Build one contact dragged at 5000 in the direction (3, 4)/5: a facet's direction error is small beside the
    speed.
    """
    r = np.array([[8.0, -3.0, -4.0]])
    u = np.array([[0.0, 3000.0, 4000.0]])
    return planted("one-fast", np.eye(3), r, u, MU, {"rank": 3, "symmetric": True, "states": {"slide": 1}})
