"""Edges of the contact nodes: Delassus operator, plane contact and facets, planted and against other solvers."""

from __future__ import annotations

import math

import numpy as np
import planted
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from cpbench import graph
from cpbench.conversions import facets
from cpbench.conversions.base import make
from cpbench.errors import NotApplicable
from cpbench.formulations import FCPoint, FrictionContact, GlobalFrictionContact, Kind
from cpbench.foundation import matrices
from cpbench.solvers.base import Budget, Claim, solvers

FACET_EDGES = ("fc-lcp-inner", "fc-lcp-outer", "fc-mlcp-outer")
quick = settings(max_examples=30, deadline=None, derandomize=True)
seeds = st.integers(0, 2**32 - 1)


def solved(target):
    """An answer to a converted facet problem by Lemke's method, through whatever leads to an LCP."""
    arrival = graph.arrive(target, "lcp")
    out = solvers.get("lemke").run(arrival.problem, Budget(tolerance=1e-10))
    assert out.claim == Claim.SOLVED
    return graph.lift(arrival.problem, out.point, len(arrival.route.steps))


# ----------------------------------------------------------------------------------------- Delassus


def test_delassus_stays_sparse_and_mixes_components(rng):
    # forty small bodies and one large one, all in one M: small blocks are inverted, the large one is factored
    small, large = 40, 60
    n = 6 * small + large
    M = np.eye(n)
    for b in range(small):
        at = slice(6 * b, 6 * b + 6)
        M[at, at] = planted.square(rng, 6, "positive definite") + np.eye(6)
    M[6 * small :, 6 * small :] = planted.square(rng, large, "positive definite") + 10 * np.eye(large)
    shuffle = rng.permutation(n)
    H = np.zeros((n, 3 * 50))
    for c in range(50):
        b = int(rng.integers(small))
        H[6 * b : 6 * b + 6, 3 * c : 3 * c + 3] = rng.standard_normal((6, 3))
    H[6 * small + 3, :6] = 1.0
    M, H = M[np.ix_(shuffle, shuffle)], H[shuffle]
    problem = GlobalFrictionContact(
        M=sp.csr_array(M), H=sp.csr_array(H), f=rng.standard_normal(n), w=rng.standard_normal(150), mu=np.full(50, 0.5)
    )
    W = make("gfc-fc").step(problem).W
    assert matrices.is_sparse(W)
    assert matrices.nnz(W) < 0.2 * 150 * 150
    reference = H.T @ np.linalg.solve(M, H)
    assert np.abs(matrices.dense(W) - reference).max() <= 1e-12 * np.abs(reference).max()


# -------------------------------------------------------------------------------------------- facets


@quick
@given(
    seeds,
    st.integers(0, 4),
    st.sampled_from(planted.SQUARE),
    st.booleans(),
    st.sampled_from(FACET_EDGES),
    st.sampled_from([4, 6, 8, 10]),
    st.floats(-4.0, 4.0),
)
def test_facets_are_exact_where_the_polygon_touches_the_circle(seed, nc, kind, sparse, name, count, angle):
    edge = make(name, {"facets": count, "angle": angle})
    directions = facets.directions(count, angle)
    problem, point = planted.fc(np.random.default_rng(seed), nc, 3, kind, sparse=sparse, directions=directions)
    target, _ = planted.both_ways(edge, problem, point)
    assert sum(target.sizes().values()) == nc * {"fc-mlcp-outer": count + 3}.get(name, count + 2)
    assert all(matrices.is_sparse(M) == sparse for M in target.data().values() if M.ndim == 2)
    assert edge.exactness(problem) == Kind.APPROXIMATE


@quick
@given(seeds, st.sampled_from([4, 6, 8, 16]), st.floats(-4.0, 4.0))
def test_polygon_coordinates(seed, count, angle):
    # against the projection on the polygon {x : c_iᵀx ≤ bound cos(π/ν)} by its variational inequality
    rng = np.random.default_rng(seed)
    D = facets.directions(count, angle)
    x = rng.standard_normal((20, 2)) * rng.uniform(0.1, 3.0, (20, 1))
    bound = rng.uniform(0.0, 2.0, 20)
    free = facets.coordinates(x, D)
    assert (free >= 0.0).all()
    np.testing.assert_allclose(free @ D.T, x, atol=1e-12)
    beta = facets.coordinates(x, D, bound)
    assert (beta >= 0.0).all()
    assert (beta.sum(axis=1) <= bound + 1e-12).all()
    projected = beta @ D.T
    towards = np.einsum("ci,cij->cj", x - projected, bound[:, None, None] * D[None] - projected[:, :, None])
    assert (towards <= 1e-12).all()


@pytest.mark.parametrize(
    ("knobs", "reason"),
    [
        ({"facets": 5}, "facets = 5"),
        ({"facets": 2}, "facets = 2"),
        ({"facets": 0}, "at least 4"),
        ({"angle": math.nan}, "no angle"),
    ],
)
@pytest.mark.parametrize("name", FACET_EDGES)
def test_facet_knobs_are_checked(rng, name, knobs, reason):
    problem, _ = planted.fc(rng, 1, 3)
    with pytest.raises(NotApplicable, match=reason):
        make(name, knobs).step(problem)


def test_dimensions_point_to_each_other(rng):
    plane, _ = planted.fc(rng, 2, 2)
    space, _ = planted.fc(rng, 2, 3)
    for name in FACET_EDGES:
        assert "use fc-lcp-2d" in str(make(name).obstacle(plane))
    assert "use fc-lcp-inner" in str(make("fc-lcp-2d").obstacle(space))


def sliding(theta: float, speed: float = 1.0) -> tuple[FrictionContact, FCPoint]:
    """One contact on W = 1 that slides along theta; its solution is unique: u_T ∥ q_T."""
    mu, way = 0.5, np.array([math.cos(theta), math.sin(theta)])
    r = np.concatenate([[1.0], -mu * way])
    u = np.concatenate([[0.0], speed * way])
    return FrictionContact(W=np.eye(3), q=u - r, mu=np.array([mu])), FCPoint(r=r)


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("name", FACET_EDGES)
def test_facet_error_falls_with_their_number(name):
    # one direction may be exact by luck at any number, so it is the worst direction that falls
    worst_error, worst_angle = [], []
    for count in (4, 8, 16, 32, 64):
        errors, angles = [], []
        for theta in np.linspace(0.0, 2 * math.pi / count, 14):
            problem, point = sliding(theta)
            assert problem.residuals(point).error <= 1e-15
            target = make(name, {"facets": count}).step(problem)
            lifted = graph.lift(target, solved(target))
            measured = problem.residuals(lifted)
            errors.append(measured.error)
            angles.append(measured.parts["slip_angle [deg]"])
        worst_error.append(max(errors))
        worst_angle.append(max(angles))
        assert 0.8 * 180 / count <= worst_angle[-1] <= 1.01 * 180 / count
    ratios = np.array(worst_error[1:]) / np.array(worst_error[:-1])
    assert (ratios < 0.65).all()
    assert worst_error[-1] < 0.03


# -------------------------------------------------------------------------------------- compliance


@pytest.mark.needs("cpbench_solvers")
def test_a_compliant_contact_sinks_by_its_compliance() -> None:
    """One frictionless contact, W = 2, q = −1, R = κW: r = 1/(2 + 2κ), and the rigid velocity is −Rr."""
    problem = FrictionContact(W=2.0 * np.eye(3), q=np.array([-1.0, 0, 0]), mu=np.zeros(1))
    target = make("fc-coneqp-compliant", {"compliance": 0.25}).step(problem)
    r = graph.lift(target, solvers.get("interior-point-coneqp").run(target, Budget(tolerance=1e-10)).point).r
    np.testing.assert_allclose(r, [1 / 2.5, 0, 0], atol=1e-9)
    np.testing.assert_allclose((problem.W @ r + problem.q)[0], -0.5 * r[0], atol=1e-9)
    with pytest.raises(NotApplicable, match="compliance is 0"):
        make("fc-coneqp-compliant", {"compliance": 0.0}).step(problem)
