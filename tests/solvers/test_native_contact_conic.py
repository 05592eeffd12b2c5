"""Interior points and facets on frictional contact: algebra of Lorentz cones, planted problems, published answers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

from cpbench import storage
from cpbench.formulations import FCPoint, FrictionContact, Kind
from cpbench.foundation import kernel_cache
from cpbench.solvers import Budget, Claim, solvers
from cpbench.solvers.base import parse_options
from cpbench.testing import planted
from cpbench.verification import judge

EXACT = ("interior-point-fc", "facets-lemke")
INTERIOR = ("interior-point-fc", "interior-point-relaxation")
KERNEL = kernel_cache.load("cpbench_solvers.kernels.contact_interior")


def inside(rng: np.random.Generator, count: int, d: int) -> np.ndarray:
    x = rng.standard_normal((count, d))
    x[:, 0] = np.linalg.norm(x[:, 1:], axis=1) + rng.uniform(0.01, 2.0, count)
    return x


def prepared(y: np.ndarray, w: np.ndarray) -> dict[str, np.ndarray]:
    """What the kernel makes of y and w without De Saxcé's term, and a residual of 0; `blocks` is Θ."""
    nc, d = y.shape
    found = {"scaling": np.empty((nc, 2 * d + 1)), "slope": np.empty((nc, d)), "residual": np.empty(nc * d)}
    found["blocks"] = np.empty((nc, d, d))
    KERNEL.prepare(y, w, w, np.zeros(nc * d), 0.1, False, *found.values())
    assert not found["residual"].any()
    return found


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Jordan's."""
    return np.column_stack([np.einsum("ci,ci->c", a, b), a[:, :1] * b[:, 1:] + b[:, :1] * a[:, 1:]])


def depth(x: np.ndarray) -> float:
    """How far the row that is least so lies inside its cone."""
    return float((x[:, 0] - np.linalg.norm(x[:, 1:], axis=1)).min())


@pytest.mark.parametrize("d", [2, 3])
def test_the_scaling_is_nesterovs_and_todds(rng: np.random.Generator, d: int) -> None:
    """Θ is symmetric, positive definite, an automorphism of the cone, and Θy = w."""
    y, w = inside(rng, 20, d), inside(rng, 20, d)
    theta = prepared(y, w)["blocks"]
    np.testing.assert_allclose(np.einsum("cij,cj->ci", theta, y), w, rtol=1e-8)
    np.testing.assert_allclose(theta, theta.swapaxes(1, 2), rtol=1e-12)
    assert (np.linalg.eigvalsh(theta) > 0).all()
    J = np.diag(np.r_[1.0, -np.ones(d - 1)])
    factor = (theta @ J @ theta)[:, 0, 0]
    np.testing.assert_allclose(theta @ J @ theta, factor[:, None, None] * J, atol=1e-7 * factor.max())


@pytest.mark.parametrize("d", [2, 3])
def test_de_saxces_term_is_in_the_residual_and_with_its_slope_in_the_blocks(rng: np.random.Generator, d: int) -> None:
    y, w, q, Wy = inside(rng, 20, d), inside(rng, 20, d), rng.standard_normal((20, d)), rng.standard_normal(20 * d)
    scaling, slope, residual = np.empty((20, 2 * d + 1)), np.empty((20, d)), np.empty(20 * d)
    blocks, epsilon = np.empty((20, d, d)), 0.3
    KERNEL.prepare(y, w, q, Wy, epsilon, True, scaling, slope, residual, blocks)
    phi = np.sqrt((w[:, 1:] ** 2).sum(1) + epsilon**2)
    expected = Wy.reshape(20, d) + q - w
    expected[:, 0] += phi
    np.testing.assert_allclose(residual.reshape(20, d), expected, rtol=1e-12, atol=1e-13)
    gradient = np.column_stack([np.zeros(20), w[:, 1:] / phi[:, None]])
    reduced = np.eye(d) - np.einsum("i,cj->cij", np.eye(d)[0], gradient)
    np.testing.assert_allclose(blocks, reduced @ prepared(y, w)["blocks"], rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("d", [2, 3])
def test_the_corrector_is_mehrotras(rng: np.random.Generator, d: int) -> None:
    """λ∘(Θ^½dy + Θ^-½dw) = σγe − λ∘λ − (Θ^½dy′)∘(Θ^-½dw′) with the predictor (dy′, dw′), roots by eigenvectors."""
    y, w, predicted = inside(rng, 20, d), inside(rng, 20, d), rng.standard_normal((20, d))
    found = prepared(y, w)
    scaling, slope, residual, theta = found.values()
    c, right = np.empty((20, d)), np.empty(20 * d)
    KERNEL.predict(w, slope, residual, c, right)
    np.testing.assert_allclose(right.reshape(20, d), -w)
    gap = float((y * w).sum()) / 20
    KERNEL.correct(y, w, scaling, slope, residual, predicted.ravel(), gap, c, right)
    dw = -w - np.einsum("cij,cj->ci", theta, predicted)
    lengths = np.linspace(0, 1, 200_001)  # by trial: the last one with all rows inside
    low, high = 0, len(lengths)
    while high - low > 1:
        t = lengths[middle := (low + high) // 2]
        inner = depth(y + t * predicted) >= 0 and depth(w + t * dw) >= 0
        low, high = (middle, high) if inner else (low, middle)
    ahead = float(((y + lengths[low] * predicted) * (w + lengths[low] * dw)).sum()) / 20
    sigma = min(max(ahead / gap, 0.0), 1.0) ** 3
    values, vectors = np.linalg.eigh(theta)
    root = vectors * np.sqrt(values)[:, None, :] @ vectors.swapaxes(1, 2)
    inverse = np.linalg.inv(root)
    apply = lambda P, x: np.einsum("cij,cj->ci", P, x)  # noqa: E731
    lam = apply(root, y)
    wanted = -product(lam, lam) - product(apply(root, predicted), apply(inverse, dw))
    wanted[:, 0] += sigma * gap
    np.testing.assert_allclose(product(lam, apply(inverse, c)), wanted, rtol=1e-4, atol=1e-4 * abs(wanted).max())


@pytest.mark.parametrize("d", [2, 3])
def test_a_step_of_all_the_way_ends_on_the_boundary(rng: np.random.Generator, d: int) -> None:
    short = 0
    for _ in range(50):
        y, w, c = inside(rng, 3, d), inside(rng, 3, d), rng.standard_normal((3, d))
        scaling, dy = prepared(y, w)["scaling"], rng.standard_normal((3, d))
        dw = c - np.einsum("cij,cj->ci", prepared(y, w)["blocks"], dy)
        new_y, new_w = y.copy(), w.copy()
        length = KERNEL.move(new_y, new_w, scaling, c, dy.ravel(), 1.0, 1e-8)
        np.testing.assert_allclose(new_y, y + length * dy, rtol=1e-12, atol=1e-14)
        np.testing.assert_allclose(new_w, w + length * dw, rtol=1e-6, atol=1e-9)
        size = 1e-6 * (1 + abs(new_w).max())
        assert min(depth(new_y), depth(new_w)) >= -size
        if length < 1.0:
            short += 1
            assert min(depth(new_y), depth(new_w)) <= size
    assert short > 10, "most steps would leave the cones"


def test_a_step_that_is_not_finite_is_not_taken(rng: np.random.Generator) -> None:
    y, w = inside(rng, 3, 3), inside(rng, 3, 3)
    before, step = y.copy(), np.full(9, np.nan)
    assert np.isnan(KERNEL.move(y, w, prepared(y, w)["scaling"], -w, step, 0.9, 1e-8))
    assert (y == before).all()


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("dimension", [2, 3])
def test_planted_contacts_are_solved(dimension: int, sparse: bool) -> None:
    for seed in range(3):
        problem, _ = planted.fc(np.random.default_rng(seed), 8, dimension, "positive definite", sparse=sparse)
        output = solvers.get("interior-point-fc").run(problem, Budget(tolerance=1e-8))
        assert output.claim is Claim.SOLVED, output.message
        assert judge(problem, output.point, 1e-8).solved


def test_the_relaxation_is_solved_to_its_optimum(rng: np.random.Generator) -> None:
    """K ∋ r ⟂ Wr + q ∈ K* holds, and sliding contacts open: u_N = μ‖u_T‖, which the law forbids."""
    solver = solvers.get("interior-point-relaxation")
    assert solver.spec.kind is Kind.RELAXATION
    mu, q = 0.5, np.array([-1.0, 2.0, 0.0])
    output = solver.run(FrictionContact(W=np.eye(3), q=q, mu=np.array([mu])), Budget(tolerance=1e-8))
    assert output.claim is Claim.SOLVED, output.message
    # the projection of −q on the cone: r_N = (1 + 2μ)/(1 + μ²), r_T = −μ r_N
    normal = (1 + 2 * mu) / (1 + mu**2)
    point: Any = output.point
    np.testing.assert_allclose(point.r, [normal, -mu * normal, 0.0], atol=1e-6)
    u = point.r + q
    assert u[0] == pytest.approx(mu * abs(u[1]), abs=1e-6)
    assert not judge(FrictionContact(W=np.eye(3), q=q, mu=np.array([mu])), output.point, 1e-4).solved


@pytest.mark.parametrize("name", INTERIOR)
def test_a_singular_delassus_operator_is_no_obstacle(rng: np.random.Generator, name: str) -> None:
    H = rng.standard_normal((24, 72))
    problem = FrictionContact(W=H.T @ H, q=H.T @ rng.standard_normal(24), mu=np.full(24, 0.4), dimension=3)
    assert solvers.get(name).run(problem, Budget(tolerance=1e-6)).claim is Claim.SOLVED


@pytest.mark.parametrize("name", [*INTERIOR, "facets-lemke"])
def test_what_has_no_answer_is_not_claimed(name: str) -> None:
    solver = solvers.get(name)
    assert solver.run(FrictionContact(W=np.zeros((0, 0)), q=np.zeros(0), mu=np.zeros(0))).claim is Claim.SOLVED
    for D in (np.zeros((3, 3)), np.diag([0.0, 1, 1]), -np.eye(3)):
        problem = FrictionContact(W=D, q=np.array([-1.0, 0.5, 0]), mu=np.array([0.5]))
        output = solver.run(problem)
        solved = output.claim is Claim.SOLVED
        assert not solved or solver.spec.kind is Kind.RELAXATION or judge(problem, output.point, 1e-6).solved


def test_facets_are_exact_in_the_plane(rng: np.random.Generator) -> None:
    for seed in range(3):
        problem, _ = planted.fc(np.random.default_rng(seed), 8, 2, "positive definite")
        output = solvers.get("facets-lemke").run(problem, Budget(tolerance=1e-9))
        assert output.claim is Claim.SOLVED, output.message
        assert output.counters["iterations"] == 1


@pytest.mark.parametrize("outer", ["true", "false"])
def test_facets_err_by_their_radius_and_finer_ones_do_not(outer: str) -> None:
    """One sliding contact between two vertices: r_T = −Dβ is on the polygon; then the error falls with the rounds."""
    solver, mu = solvers.get("facets-lemke"), 0.5
    way = np.array([np.cos(0.3), np.sin(0.3)])  # between two of eight vertices, and not half way
    problem = FrictionContact(W=np.eye(3), q=np.r_[-1.0, 5.0 * way], mu=np.array([mu]))
    plain = parse_options(solver.spec, {"facets": "8", "rounds": "0", "outer": outer})
    output = solver.run(problem, Budget(tolerance=1e-6), plain)
    assert output.claim is Claim.INACCURATE
    point: Any = output.point
    size = np.linalg.norm(point.r[1:])
    # a vertex or the edge between two: not shorter than the inscribed edge, not longer than the outer vertex
    assert mu * np.cos(np.pi / 8) - 1e-9 <= size <= mu / np.cos(np.pi / 8) + 1e-9
    fine = solver.run(problem, Budget(tolerance=1e-6), parse_options(solver.spec, {"outer": outer}))
    assert fine.claim is Claim.SOLVED, fine.message
    point = fine.point
    np.testing.assert_allclose(point.r, np.r_[1.0, -mu * way], atol=1e-5)


def test_odd_facets_are_refused_in_words() -> None:
    solver = solvers.get("facets-lemke")
    problem = FrictionContact(W=np.eye(3), q=np.array([-1.0, 1.0, 0]), mu=np.array([0.5]))
    output = solver.run(problem, options=parse_options(solver.spec, {"facets": "7"}))
    assert output.claim is Claim.FAILED
    assert "even" in output.message


@pytest.mark.parametrize("name", EXACT)
def test_a_right_start_is_returned(rng: np.random.Generator, name: str) -> None:
    problem, answer = planted.fc(rng, 6, 3, "positive definite")
    output = solvers.get(name).run(problem, Budget(tolerance=1e-8), start=FCPoint(answer.r))
    assert (output.claim, output.counters["iterations"]) == (Claim.SOLVED, 0)


@pytest.mark.parametrize("file", ["Capsules-i125-1213.hdf5", "siconos_mix96_NONSYM-nc185.hdf5"])
def test_real_files(shared_data: Path, file: str) -> None:
    """The first has 36 parts that share nothing, with loads that are 700 times apart."""
    problem: Any = storage.load(shared_data / "fc3d_local" / file)
    assert sp.issparse(problem.W)
    output = solvers.get("interior-point-fc").run(problem, Budget(tolerance=1e-8, seconds=60.0))
    assert output.claim is Claim.SOLVED, output.message
    assert judge(problem, output.point, 1e-8).solved
