"""Projections on every kind of factor: nearest by Moreau's conditions, compared with cvxpy, exact to rounding."""

from __future__ import annotations

import numpy as np
import pytest

from cpbench.foundation import cones
from cpbench.foundation.cones import Cone, ProductCone

MU, MU_R = 0.6, 0.25


def _inside(kind: Cone, x: np.ndarray, mu: float = MU, mu_r: float = MU_R) -> float:
    """How far x is outside K, by the inequality that defines K; 0 inside."""
    k = (x.size - 1) // 2
    t, m, whole = np.linalg.norm(x[1 : 1 + k]), np.linalg.norm(x[1 + k :]), np.linalg.norm(x[1:])
    match kind:
        case Cone.ZERO:
            return float(np.abs(x).max())
        case Cone.FREE:
            return 0.0
        case Cone.NONNEGATIVE:
            return float(max(0.0, -x.min()))
        case Cone.SECOND_ORDER:
            return float(max(0.0, -x[0])) if np.isinf(mu) else float(max(0.0, whole - mu * x[0]))
        case Cone.ROLLING:
            return float(max(0.0, t - mu * x[0], m - mu_r * x[0]))
        case Cone.ROLLING_DUAL:
            return float(max(0.0, mu * t + mu_r * m - x[0]))
        case Cone.CYLINDER:
            return float(max(0.0, -x[0], whole - mu))
        case Cone.BALL:
            return float(max(0.0, np.linalg.norm(x) - mu))


DUAL = {
    Cone.ZERO: Cone.FREE,
    Cone.FREE: Cone.ZERO,
    Cone.NONNEGATIVE: Cone.NONNEGATIVE,
    Cone.ROLLING: Cone.ROLLING_DUAL,
    Cone.ROLLING_DUAL: Cone.ROLLING,
}
CONES = [
    *((kind, 4, MU, MU_R) for kind in (Cone.ZERO, Cone.FREE, Cone.NONNEGATIVE)),
    *((Cone.SECOND_ORDER, size, mu, 0.0) for size in (1, 2, 3, 7) for mu in (0.0, 1e-8, MU, 1.0, 1e8, np.inf)),
    *(
        (kind, size, mu, mu_r)
        for kind in (Cone.ROLLING, Cone.ROLLING_DUAL)
        for size in (3, 5)
        for mu, mu_r in ((MU, MU_R), (0.0, MU_R), (MU, 0.0), (0.0, 0.0), (1e3, 1e-3))
    ),
]


def _points(rng: np.random.Generator, size: int) -> list[np.ndarray]:
    """Generic, near the axis and its opposite, with nothing along some directions, and of size 1e±8."""
    points = [rng.standard_normal(size) * spread for spread in (1e-8, 1.0, 1e8) for _ in range(20)]
    for share in (1e-8, 1e-3):
        points += [s * np.eye(size)[0] + share * rng.standard_normal(size) for s in (1.0, -1.0)]
    points += [np.where(rng.random(size) < 0.5, 0.0, rng.standard_normal(size)) for _ in range(20)]
    return [*points, np.zeros(size)]


@pytest.mark.parametrize(("kind", "size", "mu", "mu_r"), CONES)
def test_the_nearest_point_of_a_cone(kind: Cone, size: int, mu: float, mu_r: float, rng: np.random.Generator) -> None:
    """p is it exactly when p ∈ K, p − x ∈ K* and pᵀ(p − x) = 0 (Moreau); all to rounding of x."""
    K = ProductCone.of((kind, 1, size, mu, mu_r))
    dual, dual_mu = (kind, np.inf if mu == 0 else 1 / mu) if kind is Cone.SECOND_ORDER else (DUAL[kind], mu)
    for x in _points(rng, size):
        p = K.project(x)
        eps = 64 * np.finfo(float).eps * np.linalg.norm(x)
        steep = max(1.0, mu if np.isfinite(mu) else 1.0, mu_r)
        assert _inside(kind, p, mu, mu_r) <= steep * eps
        steep = max(1.0, dual_mu if np.isfinite(dual_mu) else 1.0, mu_r)
        assert _inside(dual, p - x, dual_mu, mu_r) <= steep * eps
        assert abs(p @ (p - x)) <= eps * np.linalg.norm(x)
        assert np.allclose(K.project(p), p, rtol=1e-14, atol=eps)
        assert np.allclose(K.project_dual(x), K.dual().project(x), rtol=1e-12, atol=4 * eps)
        assert np.allclose(x, p - K.dual().project(-x), rtol=1e-12, atol=4 * eps)


@pytest.mark.parametrize("kind", [Cone.CYLINDER, Cone.BALL])
@pytest.mark.parametrize("radius", [0.0, 1e-3, 2.0])
def test_the_nearest_point_of_a_cylinder_or_a_ball(kind: Cone, radius: float, rng: np.random.Generator) -> None:
    """(x − p)ᵀ(z − p) ≤ 0 for every z in it."""
    K = ProductCone.of((kind, 1, 3, radius))
    others = np.array([K.project(4.0 * rng.standard_normal(3)) for _ in range(50)])
    for _ in range(50):
        x = 3.0 * rng.standard_normal(3)
        p = K.project(x)
        assert _inside(kind, p, radius) <= 1e-15
        assert np.allclose(K.project(p), p, rtol=1e-15, atol=0)
        assert ((others - p) @ (x - p)).max() <= 1e-13


def test_the_rolling_projection_keeps_its_digits(rng: np.random.Generator) -> None:
    """s on the boundary, y = 1e8 times a normal there: P(s − y) = s up to rounding of y, not up to its square root."""
    size, speed = rng.uniform(0.1, 2.0, (200, 1)), 1e8 * rng.uniform(0.1, 2.0, (200, 2))
    way, spin = (x / np.linalg.norm(x, axis=1)[:, None] for x in rng.standard_normal((2, 200, 2)))
    s = np.hstack([size, MU * size * way, MU_R * size * spin])
    y = np.hstack([speed @ np.array([[MU], [MU_R]]), -speed[:, :1] * way, -speed[:, 1:] * spin])
    p = cones.project_rolling_cone(s - y, np.full(200, MU), np.full(200, MU_R))
    assert np.abs(p - s).max() <= 1e-6


def test_rolling_without_moments_is_coulomb(rng: np.random.Generator) -> None:
    x, mu = rng.standard_normal((50, 5)), rng.uniform(0, 2, 50)
    x[:, 3:] = 0.0
    assert np.allclose(
        cones.project_rolling_cone(x, mu, rng.uniform(0, 2, 50))[:, :3], cones.project_friction_cone(x[:, :3], mu)
    )


def test_a_product_is_projected_factor_by_factor(rng: np.random.Generator) -> None:
    runs = [
        (Cone.SECOND_ORDER, 2, 3, np.array([0.5, np.inf])),
        (Cone.NONNEGATIVE, 1, 0),
        (Cone.ROLLING, 1, 5, MU, MU_R),
        (Cone.FREE, 1, 2),
        (Cone.ROLLING, 1, 3, MU, 0.0),
        (Cone.ZERO, 1, 2),
        (Cone.SECOND_ORDER, 1, 3, 0.0),
        (Cone.CYLINDER, 1, 3, 0.7),
    ]
    K, x = ProductCone.of(*runs), rng.standard_normal(24)
    parts, at = [], 0
    for i in range(K.kind.size):
        one = ProductCone(*(getattr(K, k)[i : i + 1] for k in ("kind", "size", "mu", "mu_r")))
        parts.append(one.project(x[at : at + one.rows]))
        at += one.rows
    assert at == x.size == K.rows
    assert np.array_equal(K.project(x), np.concatenate(parts))
    assert K.blocks.tolist() == [0] * 3 + [1] * 3 + [2] * 5 + [3, 4] + [5] * 3 + [6, 7] + [8] * 3 + [9] * 3
    flat = np.flatnonzero(~K.extended).tolist()
    assert flat == [15, 16, 17, 19, 20]  # ω of a contact that resists no rolling, {0}, the tangents of a ray
    assert not K.conical
