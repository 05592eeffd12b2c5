"""Planted cases at the edge of what the data may be: units of 1e±8, zero rows and matrices, ties, nothing to find.

A change of units changes no mathematics: a solver of a problem in newtons should solve it in units of 1e-8 N.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from cpbench.formulations import (
    LCP,
    MLCP,
    QP,
    FCPoint,
    FrictionContact,
    GFCPoint,
    GlobalFrictionContact,
    LCPPoint,
    MLCPPoint,
    Problem,
    QPPoint,
)
from cpbench.testing import planted
from cpbench.testing.makers import plants

UNITS = (1e-8, 1e8)
_NONE = np.zeros(0)


def _rng(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


@plants("lcp")
def _lcp() -> dict[str, tuple[Problem, Any]]:
    """Build impulses and velocities in other units; M, q or a row of M zero."""
    problem, point = planted.lcp(_rng(20), 8, "positive definite")
    M, q = problem.M, problem.q
    corners: dict[str, tuple[Problem, Any]] = {}
    for s in UNITS:
        corners[f"impulse-unit-{s:g}"] = (LCP(M=M / s, q=q), LCPPoint(z=point.z * s))
        corners[f"velocity-unit-{s:g}"] = (LCP(M=M * s, q=q * s), point)
    corners["zero-matrix"] = (LCP(M=np.zeros((3, 3)), q=[0.0, 1.0, 2.0]), LCPPoint(z=np.zeros(3)))
    corners["zero-q"] = (LCP(M=M, q=np.zeros(8)), LCPPoint(z=np.zeros(8)))
    corners["zero-row"] = (LCP(M=np.diag([1.0, 0.0, 1.0]), q=[-1.0, 0.5, 1.0]), LCPPoint(z=[1.0, 0.0, 0.0]))
    z = np.array([1.0, 0, 2, 0, 0, 1, 0, 3])
    monotone = planted.square(_rng(22), 8, "monotone")
    corners["all-ties"] = (
        LCP(M=monotone, q=-monotone @ z),
        LCPPoint(z=z),
    )  # w = 0 everywhere, z = 0 in half of the rows
    return corners


@plants("mlcp")
def _mlcp() -> dict[str, tuple[Problem, Any]]:
    """Return cases with u in another unit, everything smaller or larger; A and B zero; nothing to balance."""
    problem, point = planted.mlcp(_rng(21), 4, 5, "positive definite")
    A, B, C, D, a, b = problem.A, problem.B, problem.C, problem.D, problem.a, problem.b
    corners: dict[str, tuple[Problem, Any]] = {}
    for s in UNITS:
        other = MLCP(A=A / s / s, B=B, C=C / s, D=D / s, a=a / s, b=b)
        corners[f"u-unit-{s:g}"] = (other, MLCPPoint(u=point.u * s, v=point.v))
        corners[f"both-units-{s:g}"] = (
            MLCP(A=A, B=B, C=C, D=D, a=a * s, b=b * s),
            MLCPPoint(u=point.u * s, v=point.v * s),
        )
    corners["zero-a-b"] = (
        MLCP(A=A, B=B, C=C, D=D, a=np.zeros(4), b=np.zeros(5)),
        MLCPPoint(u=np.zeros(4), v=np.zeros(5)),
    )
    corners["one"] = planted.mlcp(_rng(23), 1, 1, "positive definite")
    corners["sparse-singular-A"] = planted.mlcp(_rng(24), 5, 5, "singular", sparse=True)
    u, v, w = np.array([1.0, -2.0]), np.array([3.0, 0.0]), np.array([0.0, 1.0])
    zero, E = np.zeros((2, 2)), np.array([[2.0, 1.0], [1.0, -1.0]])
    corners["zero-A-and-B"] = (MLCP(A=zero, B=zero, C=E, D=-E.T, a=-E @ v, b=w + E.T @ u), MLCPPoint(u=u, v=v))
    return corners


@plants("qp")
def _qp() -> dict[str, tuple[Problem, Any]]:
    """Build objective and z in other units; no unknowns, no objective, rows that say nothing or the same twice."""
    problem, point = planted.qp(_rng(30), 6, 4, 2)
    Q, p, A, b, C, d = problem.Q, problem.p, problem.A, problem.b, problem.C, problem.d
    z, lam, mu, nu = point.z, point.lam, point.mu, point.nu
    corners: dict[str, tuple[Problem, Any]] = {"empty": (QP.build(np.zeros((0, 0)), _NONE), _qp_point(_NONE))}
    for s in UNITS:
        corners[f"objective-unit-{s:g}"] = (
            QP.build(Q * s, p * s, A, b, C, d, problem.lb, problem.ub),
            QPPoint(z=z, lam=lam * s, mu=mu * s, nu=nu * s),
        )
        corners[f"z-unit-{s:g}"] = (
            QP.build(Q / s / s, p / s, A / s, b, C / s, d, problem.lb * s, problem.ub * s),
            QPPoint(z=z * s, lam=lam, mu=mu, nu=nu / s),
        )
    E, e = np.eye(2), np.ones(2)
    corners["linear"] = (QP.build(np.zeros((2, 2)), e, A=E, b=e), _qp_point(e, lam=e))
    corners["unconstrained"] = (QP.build(E, -e), _qp_point(e))
    corners["fixed"] = (QP.build(E, np.array([1.0, -1.0]), lb=2.0 * e, ub=2.0 * e), _qp_point(2.0 * e, nu=[3.0, 1.0]))
    at, push = np.array([1.0, -1, 2, 0, 3, -2]), np.array([1.0, 0, -1, 0, 2, -2])
    lower = push >= 0  # every unknown at a bound, two of the multipliers 0
    boxed = QP.build(Q, push - Q @ at, lb=np.where(lower, at, at - 1.0), ub=np.where(lower, np.inf, at))
    corners["at-its-bounds"] = (boxed, _qp_point(at, nu=push))
    unit = 10.0 ** np.array([-4, 4, 0, 2, -2, 3])  # every unknown in its own unit: Q from 1e-8 to 1e8
    corners["many-units"] = (
        QP.build(Q * unit[:, None] * unit, p * unit, A * unit, b, C * unit, d, problem.lb / unit, problem.ub / unit),
        QPPoint(z=z / unit, lam=lam, mu=mu, nu=nu * unit),
    )
    corners["zero-row"] = (QP.build(E, -e, A=np.zeros((1, 2)), b=np.array([-1.0])), _qp_point(e, lam=[0.0]))
    twice = np.array([[1.0, 1.0], [2.0, 2.0]])
    corners["row-twice"] = (QP.build(E, -e, C=twice, d=np.array([1.0, 2.0])), _qp_point(e / 2, mu=[-0.5, 0.0]))
    return corners


def _qp_point(z: Any, lam: Any = _NONE, mu: Any = _NONE, nu: Any = None) -> QPPoint:
    return QPPoint(z=z, lam=lam, mu=mu, nu=np.zeros(len(z)) if nu is None else nu)


@plants("fc")
def _fc() -> dict[str, tuple[Problem, Any]]:
    """Build impulses and velocities in other units, fast sliding, nothing pushes, a contact without any inertia in
    it."""
    corners: dict[str, tuple[Problem, Any]] = {}
    for d in (2, 3):
        problem, point = planted.fc(_rng(40), 4, d, "positive definite")
        W, q, mu = problem.W, problem.q, problem.mu
        for s in UNITS:
            corners[f"impulse-unit-{s:g}-{d}d"] = (
                FrictionContact(W=W / s, q=q, mu=mu, dimension=d),
                FCPoint(r=point.r * s),
            )
            corners[f"velocity-unit-{s:g}-{d}d"] = (FrictionContact(W=W * s, q=q * s, mu=mu, dimension=d), point)
        corners[f"zero-q-{d}d"] = (
            FrictionContact(W=W, q=np.zeros(4 * d), mu=mu, dimension=d),
            FCPoint(r=np.zeros(4 * d)),
        )
        corners[f"zero-W-{d}d"] = (
            FrictionContact(W=np.zeros((d, d)), q=np.eye(d)[0], mu=[0.5], dimension=d),
            FCPoint(r=np.zeros(d)),
        )
    corners["empty-2d"] = planted.fc(_rng(41), 0, 2)
    corners["nonsymmetric-2d"] = planted.fc(_rng(42), 3, 2, "any")
    r, u = np.array([8.0, -3.0, -4.0]), np.array([0.0, 3000.0, 4000.0])
    corners["fast-3d"] = (FrictionContact(W=np.eye(3), q=u - r, mu=[0.625], dimension=3), FCPoint(r=r))
    return corners


@plants("gfc")
def _gfc() -> dict[str, tuple[Problem, Any]]:
    """Build masses in other units; two contacts in one place, which share a reaction in infinitely many ways."""
    problem, point = planted.gfc(_rng(50), 3, 4, 3)
    M, H, f, w, mu = problem.M, problem.H, problem.f, problem.w, problem.mu
    corners: dict[str, tuple[Problem, Any]] = {}
    for s in UNITS:
        corners[f"mass-unit-{s:g}"] = (
            GlobalFrictionContact(M=M * s, H=H, f=f * s, w=w, mu=mu, dimension=3),
            GFCPoint(v=point.v, r=point.r * s),
        )
    twice = np.r_[0:3, 0:12]  # the first contact once more
    r = point.r[twice]
    corners["contact-twice"] = (
        GlobalFrictionContact(M=M, H=H[:, twice], f=M @ point.v - H[:, twice] @ r, w=w[twice], mu=mu[[0, 0, 1, 2, 3]]),
        GFCPoint(v=point.v, r=r),
    )
    corners["one-2d"] = planted.gfc(_rng(51), 1, 1, 2)
    still, E = planted.gfc(_rng(52), 2, 0, 3)[0].M, np.eye(12)[:, :3]
    v, push = np.r_[0.0, 1.0, -1.0, np.zeros(9)], np.array([2.0, 0.0, 0.0])  # slides freely: μ = 0
    corners["frictionless-3d"] = (
        GlobalFrictionContact(M=still, H=E, f=still @ v - E @ push, w=np.zeros(3), mu=np.zeros(1)),
        GFCPoint(v=v, r=push),
    )
    return corners
