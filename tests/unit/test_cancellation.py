"""Errors of answers with parts of very different size, against arithmetic with 60 digits.

z − P(z − w) must not be formed as it stands there: of z = 1e-12 beside w = 1e6 nothing is left in z − w.
"""

from __future__ import annotations

import itertools
from typing import Any

import mpmath as mp
import numpy as np
import pytest

from cpbench.formulations import (
    AVI,
    CP,
    GE,
    QVI,
    SOCLCP,
    VI,
    AVIPoint,
    ConeQP,
    ConeQPPoint,
    LCPPoint,
    Relay,
    SOCLCPPoint,
)
from cpbench.formulations.conic import CPPoint, cone_defect, cone_fields
from cpbench.formulations.expressions import Map
from cpbench.formulations.variational import GEPoint, QVIPoint, VIPoint
from cpbench.foundation.cones import Cone, ProductCone

MU, MU_R = 0.5, 0.25
DIGITS = 1e-13
"""Relative error of a measured error that is allowed."""


def exact(x: np.ndarray) -> list[Any]:
    return [mp.mpf(float(number)) for number in x]


def length(x: list[Any]) -> Any:
    return mp.sqrt(mp.fsum(number**2 for number in x))


def clip(x: list[Any], most: Any) -> list[Any]:
    size = length(x)
    return [number * most / size for number in x] if size > most else x


def project(kind: Cone, y: list[Any], mu: Any, mu_r: Any) -> list[Any]:
    """The nearest point of one factor, in the precision that is set; r_N by bisection where two groups are clipped."""
    k = (len(y) - 1) // 2
    match kind:
        case Cone.SECOND_ORDER:
            return project_groups(y, [(y[1:], mu)])
        case Cone.ROLLING:
            return project_groups(y, [(y[1 : 1 + k], mu), (y[1 + k :], mu_r)])
        case Cone.ROLLING_DUAL:
            other = project(Cone.ROLLING, [-number for number in y], mu, mu_r)
            return [a + b for a, b in zip(y, other, strict=True)]
        case Cone.CYLINDER:
            return [max(y[0], mp.mpf(0)), *clip(y[1:], mu)]
        case Cone.BALL:
            return clip(y, mu)
    raise AssertionError(kind)


def project_groups(y: list[Any], groups: list[tuple[list[Any], Any]]) -> list[Any]:
    """r_N is the greatest of what the sets of clipped groups give: that of the right one."""
    rn = max(y[0], mp.mpf(0))
    for number in (1, 2):
        for chosen in itertools.combinations(groups, number):
            top = y[0] + mp.fsum(mu * length(part) for part, mu in chosen)
            candidate = top / (1 + mp.fsum(mu**2 for _, mu in chosen))
            if all(length(part) >= mu * candidate for part, mu in chosen):
                rn = max(rn, candidate)
    return [rn, *itertools.chain(*(clip(part, mu * rn) for part, mu in groups))]


def exact_defect(kind: Cone, x: np.ndarray, w: np.ndarray) -> np.ndarray:
    with mp.workdps(60):
        a, b = exact(x), exact(w)
        projected = project(kind, [s - t for s, t in zip(a, b, strict=True)], mp.mpf(MU), mp.mpf(MU_R))
        return np.array([float(s - p) for s, p in zip(a, projected, strict=True)])


X = {
    "inside": np.array([5.0, 0.3, 0.4]),
    "on the boundary": np.array([5.0, 1.5, 2.0]),
    "a little outside": np.array([5.0, 1.5, 2.0625]),
    "far outside": np.array([-1.0, 3.0, 1.0]),
}
"""Second-order cone with μ = ½."""
W = {
    "inside": np.array([4.0, -0.3, 0.4]),
    "on the boundary": np.array([2.5, -3.0, -4.0]),
    "outside": np.array([2.0, -3.0, -4.0]),
}
SIZES = [(1e-12, 1e6), (2.0**-40, 2.0**20), (1e6, 1e-12), (2.0**20, 2.0**-40), (1e12, 1.0)]


@pytest.mark.parametrize(("small", "large"), SIZES)
@pytest.mark.parametrize("dual", W)
@pytest.mark.parametrize("primal", X)
def test_second_order_cones(primal, dual, small, large):
    x, w = small * X[primal], large * W[dual]
    K = ProductCone.of((Cone.SECOND_ORDER, 1, 3, MU))
    expected = exact_defect(Cone.SECOND_ORDER, x, w)
    rounding = 1e-15 * max(np.abs(x).max(), np.abs(w).max())
    lost = np.abs(x - K.project(x - w) - expected).max()
    here = np.abs(cone_defect(K, x, w) - expected).max()
    if small in (2.0**-40, 2.0**20):  # everything that cancels does so exactly
        assert here <= DIGITS * max(min(np.abs(x).max(), np.abs(w).max()), np.abs(expected).max())
    assert here <= min(2.0 * lost + 1e-2 * rounding, rounding)


@pytest.mark.parametrize("kind", [Cone.ROLLING, Cone.ROLLING_DUAL, Cone.CYLINDER, Cone.BALL, Cone.SECOND_ORDER])
@pytest.mark.parametrize("exponent", [-18, -12, -3, 0, 3, 12, 18])
def test_sizes_of_every_kind(kind, exponent):
    """Backward stable: the exact defect of x and w that differ from these in the last digits."""
    rng = np.random.default_rng(exponent + 20)
    for size in (3, 5):
        K = ProductCone.of((kind, 1, size, MU, MU_R))
        for _ in range(6):
            x, w = rng.standard_normal((2, size))
            w *= 10.0**exponent
            expected = exact_defect(kind, x, w)
            error = np.abs(cone_defect(K, x, w) - expected)
            assert error.max() <= 1e-14 * max(1.0, np.abs(w).max())
            if np.abs(expected).max() <= 10.0 * min(np.abs(x).max(), np.abs(w).max()):
                assert error.max() <= 1e-11 * np.abs(expected).max()


# ------------------------------------------------------------------------------------------------- nodes

SMALL, LARGE = 2.0**-40, 2.0**20  # 9e-13 and 1e6
CONE = ProductCone.of((Cone.SECOND_ORDER, 1, 3, MU))


def constant(w: np.ndarray) -> Map:
    import casadi as ca

    z = ca.SX.sym("z", w.size)
    return Map.from_casadi(z, ca.SX(ca.DM(w)) + 0 * z)


def bounds(z: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """z in [0, 1] pushed down by 1e6, z in [-1, 1] pushed up: what is between z and its bound is the error."""
    return np.array([z, 1.0 - 2.0**-50]), np.array([LARGE, -LARGE]), np.array([z, -(2.0**-50)])


def test_boxes():
    z, w, defect = bounds(SMALL)
    lb, ub, expected = np.zeros(2), np.ones(2), np.linalg.norm(defect)
    M = np.zeros((2, 2))
    relay = Relay(M=M, q=w, lb=lb, ub=ub).residuals(LCPPoint(z))
    assert relay.parts["natural_absolute"] == expected
    avi = AVI(M=M, q=w, lb=lb, ub=ub).residuals(AVIPoint(z))
    assert avi.parts["natural_absolute"] == expected


def test_a_small_force_on_a_large_unknown():
    z, w = np.array([LARGE, LARGE]), np.array([SMALL, -3.0 * SMALL])
    lb, ub = np.full(2, -2.0 * LARGE), np.full(2, 2.0 * LARGE)
    expected = np.linalg.norm(w)  # over their sizes, ub is ½ above z and the force −1
    assert np.linalg.norm(z - np.clip(z - w, lb, ub)) != pytest.approx(expected, rel=1e-3)
    M = np.zeros((2, 2))
    relay = Relay(M=M, q=w, lb=lb, ub=ub).residuals(LCPPoint(z))
    assert relay.parts["natural_absolute"] == pytest.approx(expected, rel=DIGITS)
    assert relay.measured["unit_free"] == pytest.approx(np.hypot(1.0 / 3.0, 0.5), rel=DIGITS)
    avi = AVI(M=M, q=w, lb=lb, ub=ub).residuals(AVIPoint(z))
    assert avi.parts["natural_absolute"] == pytest.approx(expected, rel=DIGITS)
    assert avi.measured["unit_free"] == pytest.approx(np.hypot(1.0 / 3.0, 0.5), rel=DIGITS)


def conic_errors(x: np.ndarray, w: np.ndarray) -> dict[str, float]:
    """‖x − P_K(x − w)‖ as each node with a cone measures it."""
    fields: Any = cone_fields(CONE)
    M = np.zeros((3, 3))
    F = constant(w)
    s_is_x: Any = ConeQP(Q=M, p=w, A=np.eye(3), b=np.zeros(3), **fields)
    return {
        "soclcp": SOCLCP(M=M, q=w, **fields).residuals(SOCLCPPoint(x)).parts["natural_absolute"],
        "coneqp": s_is_x.residuals(ConeQPPoint(x, w)).parts["natural_absolute"],
        "cp": CP(F=F, **fields).residuals(CPPoint(x=x, lam=np.zeros(0))).parts["natural_absolute"],
        "vi": VI(F=F, **fields).residuals(VIPoint(x)).parts["natural_absolute"],
        "ge": GE(F=F, **fields).residuals(GEPoint(x)).parts["natural_absolute"],
        "qvi": QVI(F=F, **fields).residuals(QVIPoint(x)).parts["natural_absolute"],
    }


@pytest.mark.parametrize(("x_size", "w_size"), [(SMALL, LARGE), (LARGE, SMALL)])
def test_nodes_with_cones(x_size, w_size):
    for primal, dual in (("on the boundary", "on the boundary"), ("a little outside", "on the boundary")):
        x, w = x_size * X[primal], w_size * W[dual]
        expected = float(np.linalg.norm(exact_defect(Cone.SECOND_ORDER, x, w)))
        lost = float(np.linalg.norm(x - CONE.project(x - w)))
        for node, error in conic_errors(x, w).items():
            assert error == pytest.approx(expected, rel=DIGITS, abs=1e-13 * SMALL), node
        if primal == "a little outside" and x_size == SMALL:
            assert lost != pytest.approx(expected, rel=1e-2), "the plain formula has no digit of it"


def test_unit_free_cone_error():
    x, w = SMALL * X["a little outside"], LARGE * W["on the boundary"]
    fields: Any = cone_fields(CONE)
    judged = SOCLCP(M=np.eye(3), q=w - x, **fields).residuals(SOCLCPPoint(x)).measured["unit_free"]
    scale = np.abs(w).max()  # of both: x is far below ‖q‖∞/max|M|
    expected = np.linalg.norm(exact_defect(Cone.SECOND_ORDER, x / scale, w / scale))
    assert judged == pytest.approx(float(expected), rel=1e-9)
