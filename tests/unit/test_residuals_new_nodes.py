"""Errors of the nodes with joints, rolling, ellipses, boxes and cones: by plain loops, on answers made to fool them.

Rolling cones are projected on by Dykstra's alternating projections, ellipses by sampling, polyhedra by linear programs:
nothing here is shared with the package.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import planted_contact
import pytest

from cpbench.formulations import (
    AVI,
    LCP,
    MLCP,
    SOCLCP,
    AnisotropicFrictionContact,
    AVIPoint,
    ConeQP,
    ConeQPPoint,
    FCMPoint,
    FCPoint,
    FrictionContact,
    GFCPoint,
    GlobalFrictionContact,
    LCPPoint,
    MixedFrictionContact,
    MLCPPoint,
    Relay,
    SOCLCPPoint,
)
from cpbench.formulations.conic import cone_fields
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.testing import cases

E = np.eye


def _soc(x: np.ndarray, columns: list[int], mu: float) -> np.ndarray:
    """Nearest point with ‖x[columns]‖ ≤ μ x₀, the rest as it is."""
    x = x.copy()
    t = math.sqrt(sum(x[c] ** 2 for c in columns))
    if t <= mu * x[0]:
        return x
    r = max(0.0, (x[0] + mu * t) / (1 + mu * mu))
    for c in columns:
        x[c] *= mu * r / t
    x[0] = r
    return x


def _rolling(x: np.ndarray, mu: float, mu_r: float) -> np.ndarray:
    """Dykstra: alternate on the two cones, each with the correction of its last step."""
    k = (x.size - 1) // 2
    first, second = list(range(1, 1 + k)), list(range(1 + k, x.size))
    p, q = np.zeros_like(x), np.zeros_like(x)
    for _ in range(4000):
        y = _soc(x + p, first, mu)
        p = x + p - y
        z = _soc(y + q, second, mu_r)
        q = y + q - z
        if np.abs(z - x).max() < 1e-16:
            break
        x = z
    return x


def _natural_rolling(r: np.ndarray, u: np.ndarray, mu: np.ndarray, mu_r: np.ndarray, d: int) -> float:
    total, k = 0.0, (d - 1) // 2
    for c in range(len(mu)):
        rc, uc = r[d * c : d * c + d], u[d * c : d * c + d].copy()
        uc[0] += mu[c] * np.linalg.norm(uc[1 : 1 + k]) + mu_r[c] * np.linalg.norm(uc[1 + k :])
        total += float(((rc - _rolling(rc - uc, mu[c], mu_r[c])) ** 2).sum())
    return math.sqrt(total)


def test_a_wrong_ellipse_shows(rng: np.random.Generator) -> None:
    """The scaled error of an elliptic contact is 0 exactly where r solves the law, tested on its optimality conditions.

    Maximal dissipation: r_T minimises u_Tᵀr_T over the ellipse of size r_N, found by sampling it.
    """
    mu = np.array([0.9, 0.3])
    angle = np.linspace(0, 2 * np.pi, 200001)
    for _ in range(5):
        u_T, r_N = rng.standard_normal(2), rng.uniform(0.5, 2.0)
        rim = r_N * np.column_stack([mu[0] * np.cos(angle), mu[1] * np.sin(angle)])
        r = np.concatenate([[r_N], rim[(rim @ u_T).argmin()]])
        u = np.concatenate([[0.0], u_T])
        A = rng.standard_normal((3, 3))
        W = A @ A.T + E(3)
        problem = AnisotropicFrictionContact(W=W, q=u - W @ r, mu=mu[None, :])
        assert problem.residuals(FCPoint(r=r)).error < 1e-4  # of the sampled angle
        against = np.concatenate([[r_N], -r_N * mu * u_T / np.linalg.norm(u_T)])  # opposite to u: not associated
        assert problem.residuals(FCPoint(r=against)).error > 1e-3


def test_local_mixed_and_global_are_one_problem(rng: np.random.Generator) -> None:
    """gfc with joints condensed to fcm, and fcm to fc by λ = −R⁻¹(Vᵀr + s): the same errors of the contacts."""
    for make, dimension in ((planted_contact.gfc, 3), (planted_contact.grfc, 5)):
        whole, point = make(rng, 2, 3, 2, dimension)
        r = point.r + 0.2 * rng.standard_normal(point.r.size)
        K = np.block([[whole.M, -whole.G], [whole.G.T, np.zeros((2, 2))]])
        x = np.linalg.solve(K, np.concatenate([whole.H @ r + whole.f, -whole.b]))
        ours = whole.residuals(GFCPoint(v=x[:12], r=r, lam=x[12:])).measured
        assert max(ours[k] for k in ("dynamics", "constraint", "imbalance", "drift")) < 1e-12
        u, free = whole.H.T @ x[:12] + whole.w, whole.free_velocity
        scale = max(np.linalg.norm(v) for v in (r, u, free))
        if dimension == 5:
            expected = _natural_rolling(r, u, whole.mu, whole.mu_r, 5) / scale
        else:
            X, Y = np.linalg.solve(whole.M, whole.H), np.linalg.solve(whole.M, whole.G)
            F = np.linalg.solve(whole.M, whole.f)
            W, V, R = whole.H.T @ X, whole.H.T @ Y, whole.G.T @ Y
            q, s = whole.H.T @ F + whole.w, whole.G.T @ F + whole.b
            mixed = MixedFrictionContact(W=W, V=V, R=R, q=q, s=s, mu=whole.mu)
            inner = np.linalg.solve(R, np.column_stack([V.T, s]))
            local = FrictionContact(W=W - V @ inner[:, :-1], q=q - V @ inner[:, -1], mu=whole.mu)
            expected = local.residuals(FCPoint(r=r)).measured["natural"]
            theirs = mixed.residuals(FCMPoint(r=r, lam=x[12:])).measured
            assert theirs["natural"] == pytest.approx(expected, rel=1e-9)
            assert theirs["energy"] == pytest.approx(ours["energy"], rel=1e-9)
            assert theirs["opening"] == pytest.approx(ours["opening"], rel=1e-9, abs=1e-15)
        assert ours["natural"] == pytest.approx(expected, rel=1e-6)


def _rod(w: float = 0.0) -> GlobalFrictionContact:
    """One block held sideways by a joint, on the ground."""
    H, G = np.array([[0.0, 1.0], [1.0, 0.0]]), np.array([[1.0], [0.0]])
    return GlobalFrictionContact(M=E(2), H=H, G=G, f=[0.25, -1.0], w=[w, 0.0], b=[0.0], mu=[0.5], dimension=2)


NONNEGATIVE_2 = ProductCone.of((Cone.NONNEGATIVE, 1, 2))
WRONG = {
    "a far bound says nothing of sizes": (
        Relay(M=1e8 * E(1), q=[1e8], lb=[0.0], ub=[1e20]),
        LCPPoint(z=[1.0]),
    ),
    "forces beyond any z of the box": (Relay(M=E(1), q=[1e8], lb=[-1.0], ub=[1.0]), LCPPoint(z=[1.0])),
    "the force on a fixed unknown": (
        Relay(M=E(2), q=[1e8, -0.5], lb=[1.0, -1.0], ub=[1.0, 1.0]),
        LCPPoint(z=[1.0, 0.9]),
    ),
    "a multiplier in the units of its row": (AVI(M=E(1), q=[-1.0], A=[[1e8]], b=[-1e8]), AVIPoint(z=[2.0], lam=[1e-8])),
    "an idle row with a large b": (
        AVI(M=E(2), q=[0.0, 1.0], A=E(2), b=[-1e8, 0.0]),
        AVIPoint(z=[0.0, 1.0], lam=[0.0, 2.0]),
    ),
    "multipliers that cancel": (
        AVI(M=E(1), q=[-1.0], A=[[1.0]], b=[0.0], C=[[1.0]], d=[0.0], lb=[-1e8]),
        AVIPoint(z=[0.0], lam=[1e8], mu=[-1e8]),
    ),
    "rows as tight as a box under large forces": (
        AVI(M=E(1), q=[1e8], A=[[1.0], [-1.0]], b=[-1.0, -1.0]),
        AVIPoint(z=[1.0], lam=[1e8 + 1, 0.0]),
    ),
    "an idle row of a program": (
        ConeQP.over(E(2), np.array([0.0, 1.0]), NONNEGATIVE_2, None, np.array([1e8, 0.0])),
        ConeQPPoint(x=[0.0, 1.0], y=[0.0, 2.0]),
    ),
    "the force where a cone has no extent": (
        next(c.problem for c in cases("soclcp") if c.name == "support"),
        SOCLCPPoint(x=[0.0, 0.9]),
    ),
    "reactions that cancel a joint's": (_rod(), GFCPoint(v=[0.0, 0.0], r=[1.0, 1e8], lam=[-1e8 + 1.0])),
    "a joint that is not kept": (_rod(), GFCPoint(v=[0.5, 0.0], r=[1.0, -0.5], lam=[0.75])),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_answers_do_not_pass(name: str) -> None:
    problem, point = WRONG[name]
    assert problem.residuals(point).error > 1e-2


RIGHT = {
    "relay at rest": (Relay(M=E(1), q=[0.0], lb=[-1.0], ub=[1.0]), LCPPoint(z=[1e-12])),
    "equality without right side": (
        AVI(M=E(2), q=[-1.0, 1.0], C=[[1.0, 1.0]], d=[0.0]),
        AVIPoint(z=[1.0, -1.0 + 1e-12], mu=[0.0]),
    ),
    "lcp without q": (LCP(M=E(2), q=[0.0, 0.0]), LCPPoint(z=[1e-12, 0.0])),
    "mlcp without a and b": (MLCP(A=E(1), B=E(1), C=E(1), D=E(1), a=[0.0], b=[0.0]), MLCPPoint(u=[1e-12], v=[1e-12])),
    "mlcp without a": (MLCP(A=E(1), B=E(1), C=E(1), D=E(1), a=[0.0], b=[1.0]), MLCPPoint(u=[1e-12], v=[0.0])),
    "a joint that only holds": (_rod(), GFCPoint(v=[1e-14, 0.0], r=[1.0, 0.0], lam=[-0.25])),
    "constraints without drift": (
        MixedFrictionContact(W=E(3), V=np.ones((3, 1)), R=4.0 * E(1), q=[1.0, 0, 0], s=[0.0], mu=[0.5]),
        FCMPoint(r=np.zeros(3), lam=[1e-12]),
    ),
    "constraints that hold nothing": (
        MixedFrictionContact(W=E(3), V=np.zeros((3, 1)), R=E(1), q=[1.0, 0, 0], s=[0.0], mu=[0.5]),
        FCMPoint(r=np.zeros(3), lam=[1e-12]),
    ),
    "a program without p": (
        ConeQP.over(E(2), np.zeros(2), NONNEGATIVE_2, None, np.ones(2)),
        ConeQPPoint(x=[1e-12, 0.0], y=[0.0, 0.0]),
    ),
}


@pytest.mark.parametrize("name", RIGHT)
def test_rounding_is_no_false_alarm(name: str) -> None:
    problem, point = RIGHT[name]
    assert problem.residuals(point).error < 1e-10


def test_speed_hides_a_reaction_that_reaction_error_shows() -> None:
    """Sliding at 1e8 with 2r: accepted by the natural map and the energy norm; `reaction_error` tells."""
    problem = FrictionContact(W=E(3), q=[-1.0, 1e8, 0.0], mu=[0.5])
    parts = problem.residuals(FCPoint(r=[2.0, -1.0, 0.0])).parts
    assert parts["reaction_error"] > 0.3
    assert problem.residuals(FCPoint(r=[1.0, -0.5, 0.0])).parts["reaction_error"] < 1e-7


def test_joints_given_twice_have_the_scale_of_joints_given_once() -> None:
    """K is singular then; the free motion, which scales the contact errors, is the same."""
    twice = next(c.problem for c in cases("gfc") if c.name == "joints-twice")
    once = dataclasses.replace(twice, G=twice.G[:, :2], b=twice.b[:2])
    assert twice.saddle.singular
    assert not once.saddle.singular
    assert np.allclose(twice.free_velocity, once.free_velocity, rtol=1e-8, atol=1e-9)
    repeated = next(c.problem for c in cases("fcm") if c.name == "constraint-twice")
    single = dataclasses.replace(repeated, V=repeated.V[:, :3], R=repeated.R[:3, :3], s=repeated.s[:3])
    assert repeated.factorization.singular
    assert np.allclose(repeated.free_velocity, single.free_velocity, rtol=1e-8, atol=1e-9)


def test_a_cone_with_all_factors_fixed_has_no_scale() -> None:
    """{0} alone: x = 0 is the answer whatever q is."""
    problem = SOCLCP(M=E(2), q=[3.0, -4.0], **cone_fields(ProductCone.of((Cone.ZERO, 1, 2))))
    assert problem.residuals(SOCLCPPoint(x=[0.0, 0.0])).error == 0.0
    assert problem.residuals(SOCLCPPoint(x=[1.0, 0.0])).error == pytest.approx(0.2)


def test_fixed_unknowns_are_data_like_equalities():
    """DTOC3 of Maros and Mészáros has q = 0 and d = 0 but for rounding; its data stand in unknowns with lb = ub."""
    z = np.array([15.0, 15.0 * (1 + 1e-15)])
    problem = AVI(
        M=np.diag([0.0, 1e-3]),
        q=np.zeros(2),
        C=np.array([[1.0, -1.0]]),
        d=[1e-15],
        lb=[15.0, -np.inf],
        ub=[15.0, np.inf],
    )
    multiplier = -1e-3 * z[1]
    assert problem.residuals(AVIPoint(z=z, mu=[multiplier])).error <= 1e-12
    assert problem.residuals(AVIPoint(z=z + np.array([0.0, 1.0]), mu=[multiplier])).error > 1e-3
