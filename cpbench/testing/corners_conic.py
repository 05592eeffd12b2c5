"""Cases over boxes, polyhedra and cones at the edge of what the data may be (see `corners`)."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from cpbench.formulations import AVI, SOCLCP, AVIPoint, ConeQP, ConeQPPoint, LCPPoint, Problem, Relay, SOCLCPPoint
from cpbench.formulations.conic import cone_fields
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.testing import planted_conic
from cpbench.testing.makers import plants

UNITS = (1e-8, 1e8)
Corners = dict[str, tuple[Problem, Any]]
_MANY = 10.0 ** np.array([-4, 4, 0, 2, -2, 3])
"""A unit for every unknown."""


def _rng(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


@plants("relay")
def _relay() -> Corners:
    problem, point = planted_conic.relay(_rng(110), 6)
    M, q, lb, ub, z = problem.M, problem.q, problem.lb, problem.ub, point.z
    corners: Corners = {}
    for unit in UNITS:
        corners[f"z-unit-{unit:g}"] = (Relay(M=M / unit, q=q, lb=lb * unit, ub=ub * unit), LCPPoint(z=z * unit))
        corners[f"w-unit-{unit:g}"] = (Relay(M=M * unit, q=q * unit, lb=lb, ub=ub), point)
    corners["many-units"] = (
        Relay(M=M * _MANY[:, None] * _MANY, q=q * _MANY, lb=lb / _MANY, ub=ub / _MANY),
        LCPPoint(z=z / _MANY),
    )
    e, zero = np.ones(3), np.zeros((3, 3))
    corners["zero-matrix"] = (Relay(M=zero, q=[2.0, -1.0, 1e-3], lb=-e, ub=e), LCPPoint(z=[-1.0, 1.0, -1.0]))
    corners["zero-q"] = (Relay(M=np.eye(3), q=0 * e, lb=-e, ub=e), LCPPoint(z=0 * e))
    corners["zero-q-small-box"] = (Relay(M=np.eye(3), q=0 * e, lb=-1e-8 * e, ub=1e-8 * e), LCPPoint(z=0 * e))
    corners["all-ties"] = (Relay(M=M, q=-M @ lb, lb=lb, ub=lb + 1.0), LCPPoint(z=lb))  # at a bound, and w = 0
    corners["fixed"] = (Relay(M=M, q=q, lb=z, ub=z), point)
    corners["fixed-at-zero"] = (Relay(M=np.eye(3), q=e, lb=0 * e, ub=0 * e), LCPPoint(z=0 * e))
    corners["far-bounds"] = (
        Relay(M=2.0 * np.eye(2), q=[-2.0, 1.0], lb=[0.0, 0.0], ub=[1e20, 1e20]),
        LCPPoint(z=[1.0, 0.0]),
    )
    corners["large-forces"] = (Relay(M=np.eye(2), q=[1e8, -1e8], lb=-e[:2], ub=e[:2]), LCPPoint(z=[-1.0, 1.0]))
    corners["support"] = (  # what is fixed takes any force
        Relay(M=np.eye(2), q=[1e8, -0.5], lb=[1.0, -1.0], ub=[1.0, 1.0]),
        LCPPoint(z=[1.0, 0.5]),
    )
    return corners


@plants("avi")
def _avi() -> Corners:
    problem, point = planted_conic.avi(_rng(120), 6, 4, 2)
    M, q, A, b, C, d, lb, ub = (getattr(problem, k) for k in ("M", "q", "A", "b", "C", "d", "lb", "ub"))
    z, lam, mu = point.z, point.lam, point.mu
    corners: Corners = {}
    for s in UNITS:
        corners[f"z-unit-{s:g}"] = (
            AVI(M=M / s / s, q=q / s, A=A / s, b=b, C=C / s, d=d, lb=lb * s, ub=ub * s),
            AVIPoint(z=z * s, lam=lam, mu=mu),
        )
        corners[f"force-unit-{s:g}"] = (
            dataclasses.replace(problem, M=M * s, q=q * s),
            AVIPoint(z=z, lam=lam * s, mu=mu * s),
        )
        corners[f"row-unit-{s:g}"] = (
            dataclasses.replace(problem, A=A * s, b=b * s, C=C / s, d=d / s),
            AVIPoint(z=z, lam=lam / s, mu=mu * s),
        )
    corners["many-units"] = (
        AVI(
            M=M * _MANY[:, None] * _MANY, q=q * _MANY, A=A * _MANY, b=b, C=C * _MANY, d=d, lb=lb / _MANY, ub=ub / _MANY
        ),
        AVIPoint(z=z / _MANY, lam=lam, mu=mu),
    )
    E, e, none = np.eye(2), np.ones(2), np.zeros(0)
    corners["nearest-point"] = (AVI(M=E, q=0 * e, A=[[1.0, 1.0]], b=[2.0]), AVIPoint(z=e, lam=[1.0]))
    corners["zero-q-b-d"] = (AVI(M=E, q=0 * e, A=E, C=[[1.0, -1.0]]), AVIPoint(z=0 * e, lam=0 * e, mu=[0.0]))
    corners["zero-M"] = (AVI(M=np.zeros((2, 2)), q=e, A=E, b=e), AVIPoint(z=e, lam=e))
    corners["equation"] = (AVI(M=2 * E, q=-e), AVIPoint(z=e / 2))
    corners["empty-rows"] = (AVI(M=np.zeros((0, 0)), q=none, lb=none, ub=none), AVIPoint(z=none))
    corners["fixed"] = (AVI(M=E, q=[1.0, -1.0], lb=2 * e, ub=2 * e), AVIPoint(z=2 * e))
    corners["one-sided"] = (AVI(M=E, q=[1.0, -3.0], lb=[0.0, -np.inf], ub=[np.inf, 2.0]), AVIPoint(z=[0.0, 2.0]))
    corners["row-twice"] = (
        AVI(M=E, q=0 * e, A=[[1.0, 1.0], [2.0, 2.0]], b=[2.0, 4.0]),
        AVIPoint(z=e, lam=[0.5, 0.25]),
    )
    corners["equality-as-rows"] = (  # z₁ + z₂ = 0 once more as two inequalities
        AVI(M=E, q=[-1.0, 1.0], A=[[1.0, 1.0], [-1.0, -1.0]], b=[0.0, 0.0], C=[[1.0, 1.0]], d=[0.0]),
        AVIPoint(z=[1.0, -1.0], lam=[3.0, 1.0], mu=[-2.0]),
    )
    corners["idle-row"] = (AVI(M=E, q=[0.0, 1.0], A=E, b=[-1e8, 0.0]), AVIPoint(z=[0.0, 0.0], lam=[0.0, 1.0]))
    corners["zero-row"] = (AVI(M=E, q=-e, A=[[0.0, 0.0]], b=[-1.0]), AVIPoint(z=e, lam=[0.0]))
    skew = np.array([[0.0, 1.0], [-1.0, 0.0]])
    corners["all-ties"] = (  # at every bound and row, with no force
        AVI(M=skew, q=-skew @ e, A=E, b=e, lb=e, ub=np.full(2, np.inf)),
        AVIPoint(z=e, lam=0 * e),
    )
    return corners


@plants("soclcp")
def _soclcp() -> Corners:
    K = planted_conic.cone(_rng(130))
    problem, point = planted_conic.soclcp(_rng(131), K)
    M, q, x = problem.M, problem.q, point.x
    fields = cone_fields(K)
    corners: Corners = {}
    for s in UNITS:
        corners[f"x-unit-{s:g}"] = (SOCLCP(M=M / s, q=q, **fields), SOCLCPPoint(x=x * s))
        corners[f"w-unit-{s:g}"] = (SOCLCP(M=M * s, q=q * s, **fields), point)
    corners["zero-q"] = (SOCLCP(M=np.eye(K.rows), q=np.zeros(K.rows), **fields), SOCLCPPoint(x=np.zeros(K.rows)))
    inside = K.project_dual(np.ones(K.rows))
    inside[np.repeat(K.kind == Cone.FREE, K.size.astype(int))] = 0.0
    zero = np.zeros((K.rows, K.rows))
    corners["zero-M"] = (SOCLCP(M=zero, q=inside, **fields), SOCLCPPoint(x=np.zeros(K.rows)))
    corners["all-ties"] = (SOCLCP(M=M, q=-M @ x, **fields), point)  # w = 0, much of x on the boundary
    one = {
        "ray-and-half-space": ProductCone.of((Cone.SECOND_ORDER, 4, 3, np.array([0.0, np.inf, 0.0, np.inf]))),
        "cones-of-one": ProductCone.of((Cone.SECOND_ORDER, 4, 1, np.array([0.0, 1.0, 1e3, np.inf]))),
        "flat-and-sharp": ProductCone.of((Cone.SECOND_ORDER, 3, 3, np.array([1e-6, 1e6, 1.0]))),
        "large-cone": ProductCone.of((Cone.SECOND_ORDER, 1, 9, 1.0)),
        "rolling-rays": ProductCone.of((Cone.ROLLING, 3, 5, np.array([0.0, 0.5, 0.0]), np.array([0.5, 0.0, 0.0]))),
        "plane-rolling": ProductCone.of((Cone.ROLLING, 2, 3, 0.5, 0.25), (Cone.ROLLING_DUAL, 2, 5, 0.5, 0.25)),
        "only-zero": ProductCone.of((Cone.ZERO, 2, 2)),
        "only-free": ProductCone.of((Cone.FREE, 2, 2)),
        "orthant": ProductCone.of((Cone.NONNEGATIVE, 1, 5)),
        "empty-factor": ProductCone.of((Cone.NONNEGATIVE, 1, 0), (Cone.SECOND_ORDER, 1, 3, 1.0), (Cone.FREE, 1, 0)),
    }
    for i, (name, cone) in enumerate(one.items()):
        corners[name] = planted_conic.soclcp(_rng(140 + i), cone, "positive definite")
    corners["support"] = (  # x = 0 in {0}: whatever the force there, it is not a measure for the rest
        SOCLCP(M=np.eye(2), q=[1e8, -0.5], **cone_fields(ProductCone.of((Cone.ZERO, 1, 1), (Cone.NONNEGATIVE, 1, 1)))),
        SOCLCPPoint(x=[0.0, 0.5]),
    )
    return corners


@plants("coneqp")
def _coneqp() -> Corners:
    K = planted_conic.cone(_rng(150), cylinders=True)
    problem, point = planted_conic.coneqp(_rng(151), 8, K)
    Q, p, A, b, x, y = problem.Q, problem.p, problem.A, problem.b, point.x, point.y
    fields = cone_fields(K)
    radius = np.where(K.kind == Cone.CYLINDER, K.mu, 0.0)
    corners: Corners = {}
    for s in UNITS:
        corners[f"objective-unit-{s:g}"] = (ConeQP(Q=Q * s, p=p * s, A=A, b=b, **fields), ConeQPPoint(x=x, y=y * s))
        corners[f"x-unit-{s:g}"] = (ConeQP(Q=Q / s / s, p=p / s, A=A / s, b=b, **fields), ConeQPPoint(x=x * s, y=y))
    for s in (1e-6, 1e8):  # in units of 1e-8, rounding y is an error of 1e-9 in the natural map
        scaled = {**fields, "cone_mu": np.where(radius > 0, radius * s, K.mu)}  # the radius is a length of s
        corners[f"s-unit-{s:g}"] = (ConeQP(Q=Q, p=p, A=A * s, b=b * s, **scaled), ConeQPPoint(x=x, y=y / s))
    cones = planted_conic.cone(_rng(152))
    unit = np.repeat(10.0 ** np.linspace(-6, 6, cones.size.size), cones.size.astype(int))
    plain, at = planted_conic.coneqp(_rng(153), 8, cones)
    corners["a-unit-for-each-factor"] = (
        ConeQP.over(plain.Q, plain.p, cones, plain.A * unit[:, None], plain.b * unit),
        ConeQPPoint(x=at.x, y=at.y / unit),
    )
    E, e, none = np.eye(2), np.ones(2), ProductCone.of()
    ball = ProductCone.of((Cone.SECOND_ORDER, 1, 3, 1.0))
    disk = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    corners["zero-Q"] = (  # min x₁ + x₂ over the unit disk
        ConeQP.over(np.zeros((2, 2)), e, ball, disk, np.array([1.0, 0, 0])),
        ConeQPPoint(x=-e / np.sqrt(2), y=[np.sqrt(2), 1.0, 1.0]),
    )
    corners["zero-p"] = (ConeQP.over(E, 0 * e, ball, disk, np.array([1.0, 0, 0])), ConeQPPoint(x=0 * e, y=np.zeros(3)))
    corners["zero-p-b"] = (ConeQP.over(E, 0 * e, ball, disk), ConeQPPoint(x=0 * e, y=np.zeros(3)))
    corners["zero-A"] = (ConeQP.over(E, -e, ball, 0 * disk, np.array([1.0, 0, 0])), ConeQPPoint(x=e, y=np.zeros(3)))
    corners["unconstrained"] = (
        ConeQP.over(E, -e, none, np.zeros((0, 2)), np.zeros(0)),
        ConeQPPoint(x=e, y=np.zeros(0)),
    )
    corners["no-unknowns"] = (
        ConeQP.over(np.zeros((0, 0)), np.zeros(0), ball, np.zeros((3, 0)), np.array([1.0, 0, 0])),
        ConeQPPoint(x=np.zeros(0), y=np.zeros(3)),
    )
    corners["equality"] = (
        ConeQP.over(E, 0 * e, ProductCone.of((Cone.ZERO, 1, 1)), np.array([[1.0, 1.0]]), np.array([-2.0])),
        ConeQPPoint(x=e, y=[1.0]),
    )
    corners["idle-row"] = (
        ConeQP.over(E, np.array([0.0, 1.0]), ProductCone.of((Cone.NONNEGATIVE, 1, 2)), E, np.array([1e8, 0.0])),
        ConeQPPoint(x=[0.0, 0.0], y=[0.0, 1.0]),
    )
    shapes = {
        "rays": ProductCone.of((Cone.SECOND_ORDER, 3, 3, np.array([0.0, np.inf, 1e-3]))),
        "cones-of-one": ProductCone.of((Cone.SECOND_ORDER, 3, 1, np.array([0.0, 1.0, np.inf]))),
        "cylinders": ProductCone.of((Cone.CYLINDER, 3, 3, np.array([0.0, 1e-3, 2.0])), (Cone.CYLINDER, 1, 1, 1.0)),
    }
    for i, (name, cone) in enumerate(shapes.items()):
        corners[name] = planted_conic.coneqp(_rng(160 + i), 6, cone)
    s, _ = planted_conic.pair(_rng(170), K)
    corners["all-ties"] = (ConeQP.over(Q, -Q @ x, K, A, s - A @ x), ConeQPPoint(x=x, y=np.zeros(K.rows)))
    return corners


def infeasible(node: str) -> dict[str, Problem]:
    """Return problems without solution; a relay always has one (its box is compact)."""
    rows, e = np.array([[1.0], [-1.0]]), np.ones(2)
    if node == "avi":  # z ≥ 1 and −z ≥ 1; F = −1 with z unbounded above
        crossed = AVI(M=np.eye(1), q=[0.0], A=rows, b=e)
        return {"crossed": crossed, "unbounded": AVI(M=np.zeros((1, 1)), q=[-1.0], lb=[0.0])}
    if node == "soclcp":  # w = q is not in K*
        ball = cone_fields(ProductCone.of((Cone.SECOND_ORDER, 1, 3, 1.0)))
        return {"negative": SOCLCP(M=np.zeros((3, 3)), q=[-1.0, 0, 0], **ball)}
    if node == "coneqp":  # x ≥ 1 and −x ≥ 1
        return {"crossed": ConeQP.over(np.eye(1), np.zeros(1), ProductCone.of((Cone.NONNEGATIVE, 1, 2)), rows, -e)}
    return {}
