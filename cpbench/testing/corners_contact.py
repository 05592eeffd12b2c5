"""Contact cases at the edge of what the data may be: joints, rolling friction, elliptic cones (see `corners`)."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from cpbench.formulations import (
    AnisotropicFrictionContact,
    FCMPoint,
    FCPoint,
    FrictionContact,
    GFCPoint,
    GlobalFrictionContact,
    GlobalRollingFrictionContact,
    MixedFrictionContact,
    Problem,
    RollingFrictionContact,
)
from cpbench.testing import planted, planted_contact
from cpbench.testing.makers import plants

UNITS = (1e-8, 1e8)
Corners = dict[str, tuple[Problem, Any]]


def _rng(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


@plants("fcm")
def _fcm() -> Corners:
    problem, point = planted_contact.fcm(_rng(60), 4, 3, 3)
    W, V, R, q, s, mu = problem.W, problem.V, problem.R, problem.q, problem.s, problem.mu
    corners: Corners = {
        "empty-3d": planted_contact.fcm(_rng(61), 0, 0, 3),
        "one-2d": planted_contact.fcm(_rng(62), 1, 1, 2),
        "nonsymmetric-3d": planted_contact.fcm(_rng(63), 3, 2, 3, "any"),
        "singular-3d": planted_contact.fcm(_rng(64), 3, 2, 3, "singular semidefinite"),
    }
    for unit in UNITS:
        corners[f"impulse-unit-{unit:g}"] = (
            dataclasses.replace(problem, W=W / unit, V=V / unit, R=R / unit),
            FCMPoint(r=point.r * unit, lam=point.lam * unit),
        )
        corners[f"velocity-unit-{unit:g}"] = (
            dataclasses.replace(problem, W=W * unit, V=V * unit, R=R * unit, q=q * unit, s=s * unit),
            point,
        )
        corners[f"constraint-unit-{unit:g}"] = (
            dataclasses.replace(problem, V=V * unit, R=R * unit**2, s=s * unit),
            FCMPoint(r=point.r, lam=point.lam / unit),
        )
    twice = [0, 1, 2, 0]  # R is singular, s in its range
    corners["constraint-twice"] = (
        MixedFrictionContact(W=W, V=V[:, twice], R=R[np.ix_(twice, twice)], q=q, s=s[twice], mu=mu),
        FCMPoint(r=point.r, lam=np.append(point.lam, 1.0) - [1.0, 0, 0, 0]),
    )
    zero = FCMPoint(r=np.zeros(12), lam=np.zeros(3))
    corners["zero-q-s"] = (dataclasses.replace(problem, q=np.zeros(12), s=np.zeros(3)), zero)
    opening = np.tile([1.0, 0.5, -2.0], 4)  # every contact leaves: nothing for the constraints to do
    corners["open-without-drift"] = (dataclasses.replace(problem, q=opening, s=np.zeros(3)), zero)
    lam = -np.linalg.solve(R, V.T @ point.r)
    u = W @ point.r + V @ point.lam + q
    corners["without-drift"] = (
        dataclasses.replace(problem, q=u - W @ point.r - V @ lam, s=np.zeros(3)),
        FCMPoint(r=point.r, lam=lam),
    )
    corners["uncoupled"] = (
        dataclasses.replace(problem, V=np.zeros((12, 3)), q=u - W @ point.r, s=-R @ point.lam),
        point,
    )
    r, u = _frictionless(4)
    corners["frictionless"] = (
        dataclasses.replace(problem, q=u - W @ r - V @ point.lam, s=-V.T @ r - R @ point.lam, mu=np.zeros(4)),
        FCMPoint(r=r, lam=point.lam),
    )
    corners["all-graze"] = (
        dataclasses.replace(problem, q=np.tile([0.0, 1.0, -2.0], 4) - V @ point.lam, s=-R @ point.lam),
        FCMPoint(r=np.zeros(12), lam=point.lam),
    )
    return corners


def _frictionless(nc: int) -> tuple[np.ndarray, np.ndarray]:
    r, u = np.zeros((nc, 3)), np.zeros((nc, 3))
    r[::2, 0], u[1::2, 0], u[:, 1] = 1.5, 0.5, 0.25
    return r.ravel(), u.ravel()


@plants("gfc")
def gfc() -> Corners:
    """Build, beside those of `corners`, what joints bring."""
    problem, point = planted_contact.gfc(_rng(70), 3, 4, 2, 3)
    return _joints(problem, point)


def _joints(problem: GlobalFrictionContact | GlobalRollingFrictionContact, point: GFCPoint) -> Corners:
    """Build velocities and masses in other units; joints given twice (K is singular); that only hold; nothing but
    joints."""
    M, H, G, v, r, lam = problem.M, problem.H, problem.G, point.v, point.r, point.lam
    u = H.T @ v + problem.w
    corners: Corners = {}
    for unit in UNITS:
        corners[f"joint-velocity-unit-{unit:g}"] = (
            dataclasses.replace(problem, f=problem.f * unit, w=problem.w * unit, b=problem.b * unit),
            GFCPoint(v=v * unit, r=r * unit, lam=lam * unit),
        )
        corners[f"joint-mass-unit-{unit:g}"] = (
            dataclasses.replace(problem, M=M * unit, f=problem.f * unit),
            GFCPoint(v=v, r=r * unit, lam=lam * unit),
        )
    half = np.concatenate([lam / 2, lam / 2])
    corners["joints-twice"] = (
        dataclasses.replace(problem, G=np.hstack([G, G]), b=np.tile(problem.b, 2)),
        GFCPoint(v=v, r=r, lam=half),
    )
    still = np.zeros_like(v)
    corners["joints-at-rest"] = (
        dataclasses.replace(problem, f=-H @ r - G @ lam, w=u, b=np.zeros_like(lam)),
        GFCPoint(v=still, r=r, lam=lam),
    )
    corners["joints-idle"] = (  # no load at all, every contact open
        dataclasses.replace(
            problem, f=still, w=np.tile(np.eye(problem.dimension)[0], problem.nc), b=np.zeros_like(lam)
        ),
        GFCPoint(v=still, r=np.zeros_like(r), lam=np.zeros_like(lam)),
    )
    corners["joints-move-it"] = (  # no load but the motion of the joints
        dataclasses.replace(problem, f=still, w=u - H.T @ _driven(M, H, G, r, lam), b=-G.T @ _driven(M, H, G, r, lam)),
        GFCPoint(v=_driven(M, H, G, r, lam), r=r, lam=lam),
    )
    return corners


def _driven(M: Any, H: Any, G: Any, r: np.ndarray, lam: np.ndarray) -> np.ndarray:
    return np.linalg.solve(M, H @ r + G @ lam)


@plants("rfc")
def _rfc() -> Corners:
    corners: Corners = {}
    for d in (3, 5):
        problem, point = planted_contact.rfc(_rng(80), 4, d)
        W, q = problem.W, problem.q
        u = W @ point.r + q
        k = (d - 1) // 2
        for unit in UNITS:
            corners[f"impulse-unit-{unit:g}-{d}"] = (
                dataclasses.replace(problem, W=W / unit),
                FCPoint(r=point.r * unit),
            )
            corners[f"velocity-unit-{unit:g}-{d}"] = (dataclasses.replace(problem, W=W * unit, q=q * unit), point)
            length = np.tile(np.r_[np.ones(1 + k), np.full(k, unit)], 4)
            corners[f"length-unit-{unit:g}-{d}"] = (
                dataclasses.replace(problem, W=W / length[:, None] / length, q=q / length, mu_r=problem.mu_r * unit),
                FCPoint(r=point.r * length),
            )
        zero = np.zeros(4 * d)
        corners[f"zero-q-{d}"] = (dataclasses.replace(problem, q=zero), FCPoint(r=zero))
        away = np.tile(np.eye(d)[0], 4)
        corners[f"zero-W-{d}"] = (dataclasses.replace(problem, W=np.zeros_like(W), q=away), FCPoint(r=zero))
        corners[f"all-graze-{d}"] = (dataclasses.replace(problem, q=u * np.tile(np.eye(d)[0] == 0, 4)), FCPoint(r=zero))
        for name, mu, mu_r in (
            ("no-friction", 0.0, 0.5),
            ("no-rolling-resistance", 0.5, 0.0),
            ("frictionless", 0.0, 0.0),
        ):
            corners[f"{name}-{d}"] = _rolling(_rng(81), d, W, np.full(4, mu), np.full(4, mu_r))
    corners["empty-3"] = planted_contact.rfc(_rng(82), 0, 3)
    corners["nonsymmetric-3"] = planted_contact.rfc(_rng(83), 3, 3, "any")
    corners["singular-5"] = planted_contact.rfc(_rng(84), 3, 5, "singular semidefinite")
    r = np.array([8.0, -3.0, -4.0, 1.2, -1.6])
    u = np.array([0.0, 3000.0, 4000.0, -600.0, 800.0])
    corners["fast-5"] = (
        RollingFrictionContact(W=np.eye(5), q=u - r, mu=[0.625], mu_r=[0.25], dimension=5),
        FCPoint(r=r),
    )
    return corners


def _rolling(rng: np.random.Generator, d: int, W: Any, mu: np.ndarray, mu_r: np.ndarray) -> tuple[Problem, Any]:
    r, u = planted_contact.rolling_state(rng, len(mu), d, mu, mu_r)
    return RollingFrictionContact(W=W, q=u - W @ r, mu=mu, mu_r=mu_r, dimension=d), FCPoint(r=r)


@plants("grfc")
def _grfc() -> Corners:
    problem, point = planted_contact.grfc(_rng(90), 3, 4, 2, 5)
    corners = _joints(problem, point)
    corners["one-3"] = planted_contact.grfc(_rng(91), 1, 1, 0, 3)
    corners["empty-3"] = planted_contact.grfc(_rng(92), 0, 0, 0, 3)
    corners["no-rolling-resistance"] = (
        dataclasses.replace(
            problem, mu=np.full(4, 0.5), mu_r=np.zeros(4), f=problem.M @ point.v, b=-problem.G.T @ point.v
        ),
        GFCPoint(v=point.v, r=np.zeros(20), lam=np.zeros(2)),
    )
    flying = np.tile(np.eye(5)[0], 4)
    leaving = dataclasses.replace(corners["no-rolling-resistance"][0], w=flying - problem.H.T @ point.v)
    corners["no-rolling-resistance"] = (leaving, corners["no-rolling-resistance"][1])
    return corners


@plants("afc")
def _afc() -> Corners:
    problem, point = planted_contact.afc(_rng(100), 4)
    W, q = problem.W, problem.q
    u, zero = W @ point.r + q, np.zeros(12)
    corners: Corners = {}
    for unit in UNITS:
        corners[f"impulse-unit-{unit:g}"] = (dataclasses.replace(problem, W=W / unit), FCPoint(r=point.r * unit))
        corners[f"velocity-unit-{unit:g}"] = (dataclasses.replace(problem, W=W * unit, q=q * unit), point)
    for ratio in (1e-3, 1e3):
        corners[f"ratio-{ratio:g}"] = _elliptic(
            _rng(101), W, np.column_stack([np.full(4, 0.5), np.full(4, 0.5 * ratio)])
        )
    corners["zero-q"] = (dataclasses.replace(problem, q=zero), FCPoint(r=zero))
    corners["zero-W"] = (dataclasses.replace(problem, W=np.zeros((12, 12)), q=np.tile([1.0, 0, 0], 4)), FCPoint(r=zero))
    corners["all-graze"] = (dataclasses.replace(problem, q=u * np.tile([0.0, 1, 1], 4)), FCPoint(r=zero))
    corners["singular"] = planted_contact.afc(_rng(102), 3, "singular semidefinite")
    r, fast = np.array([8.0, -3.0, -4.0]), np.array([0.0, 3000.0, 4000.0])
    corners["fast-round"] = (AnisotropicFrictionContact(W=np.eye(3), q=fast - r, mu=[[0.625, 0.625]]), FCPoint(r=r))
    return corners


def _elliptic(rng: np.random.Generator, W: Any, mu: np.ndarray) -> tuple[Problem, Any]:
    nc = len(mu)
    S = np.column_stack([np.ones(nc), mu]).ravel()
    r, u = planted.contact_state(rng, nc, 3, np.ones(nc))
    r, u = S * r, u / S
    return AnisotropicFrictionContact(W=W, q=u - W @ r, mu=mu), FCPoint(r=r)


WEDGE = np.array([[1.0, -1.0], [-1.0, 1.0]])
"""Two contacts that squeeze one body from both sides: u₁ + u₂ is what q says, whatever the reactions."""


def infeasible(node: str) -> dict[str, Problem]:
    """Build contact problems without solution: u_N = q_N + … cannot be made positive, or no velocity keeps the
    joints."""
    if node == "fc":
        squeezed = np.kron(WEDGE, np.diag([1.0, 0, 0])) + np.diag([0.0, 1, 1, 0, 1, 1])
        return {  # u₁N + u₂N = −2; u_N = −1
            "squeezed": FrictionContact(W=squeezed, q=np.tile([-1.0, 0, 0], 2), mu=[0.5, 0.5]),
            "immovable": FrictionContact(W=np.zeros((3, 3)), q=[-1.0, 0, 0], mu=[0.5]),
        }
    if node == "fcm":  # 0 = 1
        idle = MixedFrictionContact(
            W=np.eye(3), V=np.zeros((3, 1)), R=np.zeros((1, 1)), q=[1.0, 0, 0], s=[1.0], mu=[0.5]
        )
        return {"no-constraint-force": idle}
    if node == "rfc":
        return {"immovable": RollingFrictionContact(W=np.zeros((5, 5)), q=[-1.0, 0, 0, 0, 0], mu=[0.5], mu_r=[0.1])}
    if node == "afc":
        return {"immovable": AnisotropicFrictionContact(W=np.zeros((3, 3)), q=[-1.0, 0, 0], mu=[[0.5, 0.25]])}
    if node in ("gfc", "grfc"):
        d = 3 if node == "gfc" else 5
        H = np.zeros((2, 2 * d))
        H[0, 0], H[0, d], H[1, 1], H[1, d + 1] = 1.0, -1.0, 1.0, 1.0
        whole = {"M": np.eye(2), "H": H, "f": np.zeros(2), "w": np.tile(-np.eye(d)[0], 2), "mu": [0.5, 0.5]}
        held = {**whole, "w": np.tile(np.eye(d)[0], 2), "G": np.zeros((2, 1)), "b": [1.0]}
        if node == "gfc":
            return {"squeezed": GlobalFrictionContact(**whole), "no-joint": GlobalFrictionContact(**held)}
        rolling = {"mu_r": [0.1, 0.1]}
        return {
            "squeezed": GlobalRollingFrictionContact(**whole, **rolling),
            "no-joint": GlobalRollingFrictionContact(**held, **rolling),
        }
    return {}
