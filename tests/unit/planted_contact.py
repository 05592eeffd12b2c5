"""Contact problems made around a chosen solution: bilateral constraints, rolling friction, elliptic cones."""

from __future__ import annotations

from typing import Any

import numpy as np
from planted import bodies_and_contacts, contact_state, friction, square, stored

from cpbench.formulations import (
    AnisotropicFrictionContact,
    FCMPoint,
    FCPoint,
    GFCPoint,
    GlobalFrictionContact,
    GlobalRollingFrictionContact,
    MixedFrictionContact,
    RollingFrictionContact,
)


def rolling_state(
    rng: np.random.Generator, nc: int, d: int, mu: np.ndarray, mu_r: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return r, u of contacts that separate, stick, slide, roll, or both slide and roll; rows (N, T, M), d = 3 or 5."""
    k = (d - 1) // 2
    r, u = np.zeros((nc, d)), np.zeros((nc, d))
    tangential, rolling = slice(1, 1 + k), slice(1 + k, d)
    for c in range(nc):
        state = rng.choice(["separate", "stick", "slide", "roll", "both"], p=[0.2, 0.2, 0.2, 0.2, 0.2])
        if state == "separate":
            u[c, 0] = rng.uniform(0.1, 2.0)
            u[c, 1:] = rng.standard_normal(d - 1)
            continue
        r[c, 0] = rng.uniform(0.1, 2.0)
        for part, bound, moves in (
            (tangential, mu[c] * r[c, 0], state in ("slide", "both")),
            (rolling, mu_r[c] * r[c, 0], state in ("roll", "both")),
        ):
            way = rng.standard_normal(k)
            way = way / np.linalg.norm(way)
            r[c, part] = bound * way * (1.0 if moves else rng.uniform(0.0, 0.7))
            if moves:
                u[c, part] = -rng.uniform(0.1, 2.0) * way
    return r.ravel(), u.ravel()


def rfc(
    rng: np.random.Generator, nc: int, d: int, kind: str = "positive definite", *, sparse: bool = False
) -> tuple[RollingFrictionContact, FCPoint]:
    W = square(rng, nc * d, kind)
    mu, mu_r = friction(rng, nc), friction(rng, nc)
    r, u = rolling_state(rng, nc, d, mu, mu_r)
    problem = RollingFrictionContact(W=stored(W, sparse), q=u - W @ r, mu=mu, mu_r=mu_r, dimension=d)
    return problem, FCPoint(r=r)


def afc(
    rng: np.random.Generator, nc: int, kind: str = "positive definite", *, sparse: bool = False
) -> tuple[AnisotropicFrictionContact, FCPoint]:
    """Return r = Sr′, u = S⁻¹u′ of isotropic contacts with μ = 1."""
    W = square(rng, 3 * nc, kind)
    mu = rng.uniform(0.1, 1.0, (nc, 2))
    S = np.column_stack([np.ones(nc), mu]).ravel()
    r, u = contact_state(rng, nc, 3, np.ones(nc))
    r, u = S * r, u / S
    return AnisotropicFrictionContact(W=stored(W, sparse), q=u - W @ r, mu=mu, dimension=3), FCPoint(r=r)


def fcm(
    rng: np.random.Generator, nc: int, p: int, d: int, kind: str = "positive definite", *, sparse: bool = False
) -> tuple[MixedFrictionContact, FCMPoint]:
    """Return [[W, V], [Vᵀ, R]] of a kind of `square`."""
    n = nc * d
    whole = square(rng, n + p, kind)
    W, V, R = whole[:n, :n], whole[:n, n:], whole[n:, n:]
    mu = friction(rng, nc)
    r, u = contact_state(rng, nc, d, mu)
    lam = rng.standard_normal(p)
    problem = MixedFrictionContact(
        W=stored(W, sparse),
        V=stored(V, sparse),
        R=stored(R, sparse),
        q=u - W @ r - V @ lam,
        s=-(V.T @ r + R @ lam),
        mu=mu,
        dimension=d,
    )
    return problem, FCMPoint(r=r, lam=lam)


def dynamics(
    rng: np.random.Generator, p: int, bodies: tuple[np.ndarray, np.ndarray], r: np.ndarray, u: np.ndarray, sparse: bool
) -> tuple[dict[str, Any], GFCPoint]:
    """Return data by which r, u and p bilateral constraints are in balance on bodies (M, H), and the answer."""
    M, H = bodies
    n = len(M)
    G, v, lam = rng.standard_normal((n, p)), rng.standard_normal(n), rng.standard_normal(p)
    matrices = {"M": stored(M, sparse), "H": stored(H, sparse), "G": stored(G, sparse)}
    vectors = {"f": M @ v - H @ r - G @ lam, "w": u - H.T @ v, "b": -G.T @ v}
    return matrices | vectors, GFCPoint(v=v, r=r, lam=lam)


def gfc(
    rng: np.random.Generator, bodies: int, nc: int, p: int, d: int, *, symmetric: bool = True, sparse: bool = False
) -> tuple[GlobalFrictionContact, GFCPoint]:
    """Plant rigid bodies with p bilateral constraints."""
    made, mu = bodies_and_contacts(rng, bodies, nc, d, symmetric), friction(rng, nc)
    data, point = dynamics(rng, p, made, *contact_state(rng, nc, d, mu), sparse)
    return GlobalFrictionContact(**data, mu=mu, dimension=d), point


def grfc(
    rng: np.random.Generator, bodies: int, nc: int, p: int, d: int, *, sparse: bool = False
) -> tuple[GlobalRollingFrictionContact, GFCPoint]:
    made, mu, mu_r = bodies_and_contacts(rng, bodies, nc, d, True), friction(rng, nc), friction(rng, nc)
    data, point = dynamics(rng, p, made, *rolling_state(rng, nc, d, mu, mu_r), sparse)
    return GlobalRollingFrictionContact(**data, mu=mu, mu_r=mu_r, dimension=d), point
