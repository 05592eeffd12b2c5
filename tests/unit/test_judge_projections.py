"""The judge's own projections and parallel rows, against 80 digits and exact cancellation."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
import scipy.sparse as sp

from cpbench.formulations import QP, QPPoint
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.verification.projections import project
from cpbench.verification.verdict import judge

EPS = float(np.finfo(np.float64).eps)
SIZES = (1e-12, 1e-4, 1.0, 1e4, 1e12)
COEFFICIENTS = (0.0, 1e-8, 0.3, 1.0, 1e8)
SHAPES = [
    *((Cone.SECOND_ORDER, 3, mu, 0.0) for mu in (*COEFFICIENTS, np.inf)),
    (Cone.SECOND_ORDER, 2, 0.3, 0.0),
    (Cone.SECOND_ORDER, 4, 1e-8, 0.0),
    *((Cone.ROLLING, size, mu, mu_r) for size in (3, 5) for mu, mu_r in ((0.3, 0.1), (0.0, 0.5), (1.0, 1e-8))),
    *((Cone.ROLLING_DUAL, size, 0.3, 0.1) for size in (3, 5)),
    *((Cone.CYLINDER, 3, mu, 0.0) for mu in COEFFICIENTS),
    *((Cone.BALL, 3, mu, 0.0) for mu in COEFFICIENTS),
]


def _points(size: int) -> np.ndarray:
    rng = np.random.default_rng(7)
    return np.concatenate([s * rng.standard_normal((6, size)) for s in SIZES])


def _norm(x: list[mpmath.mpf]) -> mpmath.mpf:
    return mpmath.sqrt(sum((v * v for v in x), mpmath.mpf(0)))


def _excess(kind: Cone, x: list[mpmath.mpf], mu: float, mu_r: float) -> mpmath.mpf:
    """By how much x is outside its factor, at most its distance from it times a constant of the factor's slopes."""
    k = (len(x) - 1) // 2
    t, m = x[1 : 1 + k], x[1 + k :]
    match kind:
        case Cone.SECOND_ORDER if np.isinf(mu):
            return max(-x[0], mpmath.mpf(0))
        case Cone.SECOND_ORDER:  # the distance from the nearer side of the wedge
            return max((_norm(x[1:]) - mu * x[0]) / mpmath.sqrt(1 + mpmath.mpf(mu) ** 2), -x[0], mpmath.mpf(0))
        case Cone.ROLLING:
            return max(_norm(t) - mu * x[0], _norm(m) - mu_r * x[0], -x[0], mpmath.mpf(0))
        case Cone.ROLLING_DUAL:
            return max(mu * _norm(t) + mu_r * _norm(m) - x[0], mpmath.mpf(0))
        case Cone.CYLINDER:
            return max(_norm(x[1:]) - mu, -x[0], mpmath.mpf(0))
        case _:
            return max(_norm(x) - mu, mpmath.mpf(0))


def _support(kind: Cone, d: list[mpmath.mpf], mu: float) -> mpmath.mpf:
    """Largest dᵀk over the set, for the bounded parts; a cone's is 0 where −d is in the dual."""
    return mu * _norm(d[1:] if kind is Cone.CYLINDER else d)


def _beyond_polar(kind: Cone, d: list[mpmath.mpf], mu: float, mu_r: float) -> mpmath.mpf:
    """By how much d is outside of the polar cone: −d outside of the dual."""
    minus = [-v for v in d]
    match kind:
        case Cone.SECOND_ORDER if np.isinf(mu):
            return max(_norm(d[1:]), d[0], mpmath.mpf(0))
        case Cone.SECOND_ORDER:
            return max((mu * _norm(d[1:]) + d[0]) / mpmath.sqrt(1 + mpmath.mpf(mu) ** 2), mpmath.mpf(0))
        case Cone.ROLLING:
            return _excess(Cone.ROLLING_DUAL, minus, mu, mu_r)
        case Cone.ROLLING_DUAL:
            return _excess(Cone.ROLLING, minus, mu, mu_r)
        case _:
            return max(d[0], mpmath.mpf(0)) if kind is Cone.CYLINDER else mpmath.mpf(0)


@pytest.mark.parametrize(("kind", "size", "mu", "mu_r"), SHAPES)
def test_projections_satisfy_their_conditions(kind: Cone, size: int, mu: float, mu_r: float) -> None:
    """y = P(x) where y is in K, x − y is in the normal cone of K at y."""
    x = _points(size)
    y = project(kind, x, np.full(len(x), mu), np.full(len(x), mu_r))
    with mpmath.workdps(80):
        for row, image in zip(x, y, strict=True):
            a, b = [mpmath.mpf(float(v)) for v in row], [mpmath.mpf(float(v)) for v in image]
            d = [p - q for p, q in zip(a, b, strict=True)]
            allowed = 100 * EPS * _norm(a)
            product = sum((p * q for p, q in zip(d, b, strict=True)), mpmath.mpf(0))
            support = _support(kind, d, mu) if kind in (Cone.CYLINDER, Cone.BALL) else mpmath.mpf(0)
            assert _excess(kind, b, mu, mu_r) <= allowed
            assert _beyond_polar(kind, d, mu, mu_r) <= allowed
            assert abs(product - support) <= allowed * (_norm(a) + (_norm(b) if support else 0))


@pytest.mark.parametrize(("kind", "size", "mu", "mu_r"), SHAPES)
def test_projections_agree_with_those_of_the_solvers(kind: Cone, size: int, mu: float, mu_r: float) -> None:
    x = _points(size)
    count = len(x)
    ours = project(kind, x, np.full(count, mu), np.full(count, mu_r))
    theirs = ProductCone.of((kind, count, size, mu, mu_r)).project(x.ravel()).reshape(x.shape)
    assert (np.abs(ours - theirs).max(axis=1) <= 100 * EPS * np.linalg.norm(x, axis=1)).all()


def test_a_stored_zero_before_the_first_entry_changes_no_verdict() -> None:
    """Equalities given twice, with multipliers that cancel, and an answer that is exact."""
    entries, columns = np.array([0.0, 1.0, -2.0] * 2), np.array([0, 1, 2] * 2)
    C = sp.csr_array((entries, columns, np.array([0, 3, 6])), shape=(2, 3))
    problem = QP.build(np.eye(3), np.zeros(3), C=C, d=np.zeros(2))
    assert problem.C.nnz == 6
    point = QPPoint(z=np.zeros(3), lam=np.zeros(0), mu=np.array([1e3, -1e3]), nu=np.zeros(3))
    assert judge(problem, point, 1e-6).error == 0.0
