"""Problems drawn at random, from parameters that are spread over what makes problems hard; each has a solution.

Every family draws its own parameters from a generator of random numbers: size, decades of conditioning, rank, share of
degenerate pairs, decades of masses, range of friction. The solutions are planted: q = w − Mz.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np

from cpbench.formulations import LCP, MLCP, QP, Relay
from cpbench.formulations.base import Problem
from cpbench.formulations.global_contact import GlobalFrictionContact
from cpbench.formulations.local_contact import FrictionContact
from cpbench.foundation.matrices import Dense, Vector

Rng = np.random.Generator
Draw: TypeAlias = Callable[[Rng], Problem]
FAMILIES: dict[str, tuple[Draw, ...]] = {}
"""Formulation -> its families. Others have the built-in problems and their mutations."""


def family(node: str) -> Callable[[Draw], Draw]:
    """Return a decorator that enters a function as one more family of a formulation."""

    def enter(draw: Draw) -> Draw:
        FAMILIES[node] = (*FAMILIES.get(node, ()), draw)
        return draw

    return enter


def _size(rng: Rng, most: int) -> int:
    return int(np.exp(rng.uniform(0.0, np.log(most))) + 0.5)


def _operator(rng: Rng, n: int) -> Dense:
    """Draw a positive semidefinite matrix: eigenvalues over some decades, some 0, perhaps a skew part and units."""
    U = np.linalg.qr(rng.normal(size=(n, n)))[0]
    values = 10.0 ** rng.uniform(-rng.uniform(0, 8), 0, n)
    values[: int(rng.integers(0, n // 2 + 1)) * int(rng.integers(0, 2))] = 0.0
    M = (U * values) @ U.T
    M = (M + M.T) / 2
    if rng.random() < 0.5:
        S = np.triu(rng.normal(size=(n, n)), 1) * 10.0 ** rng.uniform(-3, 1)
        M = M + S - S.T
    units = 10.0 ** (rng.uniform(0, 3) * rng.uniform(-1, 1, n))
    return np.asarray(units[:, None] * M * units)


def _pairs(rng: Rng, n: int) -> tuple[Vector, Vector]:
    """Draw z ≥ 0 and w ≥ 0 that complement each other: some pairs are both 0, sizes are over some decades."""
    sizes = 10.0 ** rng.uniform(-rng.uniform(0, 4), 0, n)
    state = rng.choice(3, n, p=np.array([0.45, 0.45, 0.1]) if rng.random() < 0.5 else np.array([0.2, 0.2, 0.6]))
    return np.where(state == 0, sizes, 0.0), np.where(state == 1, sizes, 0.0)


@family("lcp")
def planted_lcp(rng: Rng) -> LCP:
    """Draw a monotone LCP with a planted solution."""
    n = _size(rng, 40)
    M, (z, w) = _operator(rng, n), _pairs(rng, n)
    return LCP(M=M, q=w - M @ z)


@family("lcp")
def whole_lcp(rng: Rng) -> LCP:
    """Draw an LCP of small whole numbers, whose ratios tie; M is not a P-matrix as a rule."""
    n = _size(rng, 12)
    M = rng.integers(-2, 3, (n, n)).astype(float)
    z = rng.integers(0, 3, n) * rng.integers(0, 2, n).astype(float)
    w = np.where(z > 0, 0.0, rng.integers(0, 3, n))
    return LCP(M=M, q=np.asarray(w - M @ z, dtype=float))


@family("mlcp")
def planted_mlcp(rng: Rng) -> MLCP:
    """Draw a monotone mixed LCP; its equations may be singular."""
    n, m = _size(rng, 12), _size(rng, 25)
    M, u, (v, w) = _operator(rng, n + m), rng.normal(size=n), _pairs(rng, m)
    A, C, D, B = M[:n, :n], M[:n, n:], M[n:, :n], M[n:, n:]
    return MLCP(A=A, C=C, D=D, B=B, a=-(A @ u + C @ v), b=w - D @ u - B @ v)


@family("relay")
def planted_relay(rng: Rng) -> Relay:
    """Draw a relay problem of a monotone operator, bounds of ±1 in units of their own."""
    n = _size(rng, 30)
    M, bound = _operator(rng, n), 10.0 ** rng.uniform(-2, 2, n)
    state = rng.integers(0, 4, n)
    z = np.select([state == 0, state == 1], [-bound, bound], rng.uniform(-1, 1, n) * bound)
    w = np.select([state == 0, state == 1], [rng.uniform(0, 1, n), -rng.uniform(0, 1, n)], 0.0)
    return Relay(M=M, q=w - M @ z, lb=-bound, ub=bound)


@family("qp")
def planted_qp(rng: Rng) -> QP:
    """Draw a convex QP with rows, repeated ones among them, and bounds; its multipliers are planted."""
    n, m = _size(rng, 20), _size(rng, 30)
    U = np.linalg.qr(rng.normal(size=(n, n)))[0]
    values = 10.0 ** rng.uniform(-rng.uniform(0, 8), 0, n) * (rng.random(n) < rng.uniform(0.3, 1))
    Q, z = (U * values) @ U.T, rng.normal(size=n) * 10.0 ** rng.uniform(-2, 2)
    A = rng.integers(-2, 3, (m, n)) * 10.0 ** rng.uniform(-2, 2, (m, 1)) * (rng.random((m, n)) < 0.6)
    A = np.vstack([A, A[: int(rng.integers(0, m // 2 + 1))]])
    lam, slack = _pairs(rng, len(A))
    lb, nu = np.full(n, -np.inf), np.zeros(n)
    at = rng.random(n) < 0.3
    lb[at], nu[at] = z[at], rng.uniform(0, 1, int(at.sum())) * rng.integers(0, 2, int(at.sum()))
    return QP.build((Q + Q.T) / 2, A.T @ lam + nu - Q @ z, A, A @ z - slack, lb=lb)


# ------------------------------------------------------------------------------------------- contacts


def _scene(rng: Rng) -> dict[str, Any]:
    """Draw bodies that touch each other and the ground, in 2 or 3 dimensions, with reactions that solve the step.

    Reactions are open, sticking, sliding or on the edges between these; f and w follow from them.
    """
    d = int(rng.integers(2, 4))
    bodies, nc = _size(rng, 8), _size(rng, 16)
    dofs = 3 if d == 2 else 6
    masses = 10.0 ** (rng.uniform(0, 6) * rng.uniform(-0.5, 0.5, bodies))
    M = np.repeat(masses, dofs) * np.tile(np.r_[np.ones(d), np.full(dofs - d, 10.0 ** rng.uniform(-3, 0))], bodies)
    H = np.zeros((dofs * bodies, d * nc))
    for c in range(nc):
        frame = np.linalg.qr(rng.normal(size=(d, d)))[0]
        for body, sign in {int(rng.integers(bodies)): 1.0, int(rng.integers(-1, bodies)): -1.0}.items():
            if body >= 0:
                arm = rng.uniform(-1, 1, d)
                turn = np.cross(arm, frame) if d == 3 else (arm[0] * frame[:, 1] - arm[1] * frame[:, 0])[:, None]
                H[dofs * body : dofs * (body + 1), d * c : d * (c + 1)] += sign * np.hstack([frame, turn]).T
    if rng.random() < 0.3 and nc > 1:
        H[:, :d] = H[:, d : 2 * d]
    mu = np.full(nc, rng.uniform(0, 1)) if rng.random() < 0.5 else 10.0 ** rng.uniform(-3, 0.5, nc)
    r, u = _states(rng, nc, d, mu)
    v = 10.0 ** rng.uniform(-3, 0) * rng.normal(size=M.size)
    return {"M": M, "H": H, "f": M * v - H @ r, "w": u - H.T @ v, "mu": mu, "dimension": d}


def _states(rng: Rng, nc: int, d: int, mu: Vector) -> tuple[Vector, Vector]:
    """Draw reactions and velocities that fulfil Coulomb's law at every contact."""
    r, u = np.zeros((nc, d)), np.zeros((nc, d))
    tangent = rng.normal(size=(nc, d - 1))
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    force, speed = 10.0 ** rng.uniform(-2, 1, nc), 10.0 ** rng.uniform(-2, 1, nc)
    for c, state in enumerate(rng.choice(5, nc, p=[0.3, 0.3, 0.3, 0.05, 0.05])):
        if state == 0:  # open
            u[c] = np.r_[speed[c], rng.normal(size=d - 1)]
        elif state == 4:  # touches without a force
            u[c, 1:] = tangent[c] * speed[c] * rng.integers(0, 2)
        else:
            share = {1: rng.uniform(0, 0.9), 2: 1.0, 3: 1.0}[int(state)]
            r[c] = force[c] * np.r_[1.0, -mu[c] * share * tangent[c]]
            u[c, 1:] = tangent[c] * speed[c] * (state == 2)
    return r.ravel(), u.ravel()


@family("fc")
def planted_fc(rng: Rng) -> FrictionContact:
    """Draw a step of bodies in contact as W and q."""
    scene = _scene(rng)
    H, M = scene["H"], scene["M"]
    half = H / np.sqrt(M)[:, None]
    q = H.T @ (scene["f"] / M) + scene["w"]
    return FrictionContact(W=half.T @ half, q=q, mu=scene["mu"], dimension=scene["dimension"])


@family("gfc")
def planted_gfc(rng: Rng) -> GlobalFrictionContact:
    """Draw the same with the bodies in it."""
    scene = _scene(rng)
    M = np.diag(scene.pop("M"))
    return GlobalFrictionContact(M=M, **scene)
