"""Problems over boxes, polyhedra and cones made around a chosen solution."""

from __future__ import annotations

import numpy as np
import planted
from planted import square, stored

from cpbench.formulations import AVI, SOCLCP, AVIPoint, ConeQP, ConeQPPoint, LCPPoint, Relay, SOCLCPPoint
from cpbench.formulations.conic import cone_fields
from cpbench.foundation.cones import Cone, ProductCone


def boxed(rng: np.random.Generator, n: int, *, finite: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return z, F, lb, ub with −F ∈ N_[lb,ub](z): below, above, between, fixed, and without a bound unless `finite`."""
    z = rng.standard_normal(n)
    room, force = rng.uniform(0.5, 2.0, (2, n)), rng.uniform(0.0, 2.0, n)
    state = rng.integers(0, 4, n)
    lb = np.where((state == 0) | (state == 3), z, z - room[0])
    ub = np.where((state == 1) | (state == 3), z, z + room[1])
    F = np.select([state == 0, state == 1, state == 3], [force, -force, rng.standard_normal(n)], 0.0)
    if not finite:
        lb[(lb < z) & (rng.random(n) < 0.5)] = -np.inf
        ub[(ub > z) & (rng.random(n) < 0.5)] = np.inf
    return z, F, lb, ub


def relay(rng: np.random.Generator, n: int, kind: str = "monotone", *, sparse: bool = False) -> tuple[Relay, LCPPoint]:
    M = square(rng, n, kind)
    z, w, lb, ub = boxed(rng, n, finite=True)
    return Relay(M=stored(M, sparse), q=w - M @ z, lb=lb, ub=ub), LCPPoint(z=z)


def avi(
    rng: np.random.Generator, n: int, m: int, k: int, kind: str = "monotone", *, sparse: bool = False
) -> tuple[AVI, AVIPoint]:
    M = square(rng, n, kind)
    A, C = rng.standard_normal((m, n)), rng.standard_normal((k, n))
    z, F, lb, ub = boxed(rng, n, finite=False)
    lam, slack = planted.complementary(rng, m)
    mu = rng.standard_normal(k)
    problem = AVI(
        M=stored(M, sparse),
        q=F - M @ z + A.T @ lam + C.T @ mu,
        A=stored(A, sparse),
        b=A @ z - slack,
        C=stored(C, sparse),
        d=C @ z,
        lb=lb,
        ub=ub,
    )
    return problem, AVIPoint(z=z, lam=lam, mu=mu)


def cone(rng: np.random.Generator, *, cylinders: bool = False) -> ProductCone:
    """Draw a product of every kind of factor, some twice."""
    factors = [
        (Cone.NONNEGATIVE, 1, 3),
        (Cone.SECOND_ORDER, 2, 3, rng.uniform(0.2, 2.0, 2)),
        (Cone.ZERO, 1, 1),
        (Cone.FREE, 1, 2),
        (Cone.SECOND_ORDER, 1, 2, np.ones(1)),
        (Cone.ROLLING, 2, 5, rng.uniform(0.2, 1.0, 2), rng.uniform(0.2, 1.0, 2)),
        (Cone.ROLLING_DUAL, 1, 3, np.array([0.5]), np.array([0.25])),
    ]
    if cylinders:
        factors.append((Cone.CYLINDER, 2, 3, np.array([0.0, 0.75])))
    return ProductCone.of(*factors)


def pair(rng: np.random.Generator, K: ProductCone) -> tuple[np.ndarray, np.ndarray]:
    """Return s ∈ K and y with −y ∈ N_K(s): the two parts of a random vector by Moreau's decomposition, one factor in
    six 0."""
    x = 2.0 * rng.standard_normal(K.rows)
    factor = np.repeat(np.arange(K.size.size), K.size.astype(int))
    x[np.isin(factor, np.flatnonzero(rng.random(K.size.size) < 1 / 6))] = 0.0
    s = K.project(x)
    return s, s - x


def soclcp(
    rng: np.random.Generator, K: ProductCone | None = None, kind: str = "monotone", *, sparse: bool = False
) -> tuple[SOCLCP, SOCLCPPoint]:
    K = cone(rng) if K is None else K
    M = square(rng, K.rows, kind)
    x, w = pair(rng, K)
    return SOCLCP(M=stored(M, sparse), q=w - M @ x, **cone_fields(K)), SOCLCPPoint(x=x)


def coneqp(
    rng: np.random.Generator,
    n: int,
    K: ProductCone | None = None,
    kind: str = "positive definite",
    *,
    sparse: bool = False,
) -> tuple[ConeQP, ConeQPPoint]:
    K = cone(rng, cylinders=True) if K is None else K
    Q, A = square(rng, n, kind), rng.standard_normal((K.rows, n))
    x = rng.standard_normal(n)
    s, y = pair(rng, K)
    problem = ConeQP.over(stored(Q, sparse), A.T @ y - Q @ x, K, stored(A, sparse), s - A @ x)
    return problem, ConeQPPoint(x=x, y=y)
