"""ADMM and Alart–Curnier Newton on frictional contact: their pieces against plain NumPy, planted and real problems."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp

from cpbench import cones, kernel_cache, storage
from cpbench.formulations import FCPoint, FrictionContact
from cpbench.solvers import Budget, Claim, solvers
from cpbench.solvers.native.alart_curnier_newton import AlartCurnier
from cpbench.solvers.native.contact_sweeps import Sweeps, block_rows, scaled_contacts
from cpbench.testing import planted
from cpbench.verification import judge

NEW = ("admm-contact", "alart-curnier-newton", "auto-contact")


def hyperstatic(rng: np.random.Generator, nc: int, bodies: int, dimension: int, *, sparse: bool) -> FrictionContact:
    """W = HᵀH of rank 3·bodies, q in its range and pushing: solvable, with a family of reactions."""
    H = rng.standard_normal((3 * bodies, dimension * nc))
    W = H.T @ H
    if sparse:
        H[np.abs(H) < 0.8] = 0.0
        W = sp.csr_array(H.T @ H)
    return FrictionContact(W=W, q=H.T @ rng.standard_normal(3 * bodies), mu=np.full(nc, 0.4), dimension=dimension)


@pytest.mark.parametrize("dimension", [2, 3])
def test_an_iteration_of_admm_is_that_of_plain_numpy(rng: np.random.Generator, dimension: int) -> None:
    kernel = kernel_cache.load("cpbench.solvers.kernels.contact_splitting")
    nc, alpha, rho = 40, 1.6, 0.3
    x, z, xi = rng.standard_normal((3, nc * dimension))
    mu = np.where(rng.random(nc) < 0.2, 0.0, rng.uniform(0, 1, nc))
    mixed = alpha * x + (1 - alpha) * z
    expected = cones.project_friction_cone((mixed + xi).reshape(nc, dimension), mu).ravel()
    dual = xi + mixed - expected
    sizes = [np.sum((x - expected) ** 2), np.sum((z - expected) ** 2), np.sum(x**2), np.sum(dual**2)]
    shift, measured = np.zeros(nc), np.zeros(4)
    kernel.advance(x, mu, rho, alpha, dimension, z, xi, shift, measured)
    np.testing.assert_allclose(z, expected, atol=1e-14)
    np.testing.assert_allclose(xi, dual, atol=1e-14)
    np.testing.assert_allclose(shift, mu * rho * cones.tangential_norm(dual.reshape(nc, dimension)), atol=1e-14)
    np.testing.assert_allclose(measured, sizes, rtol=1e-12)


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("dimension", [2, 3])
def test_the_jacobian_is_the_slope_of_the_function(rng: np.random.Generator, dimension: int, sparse: bool) -> None:
    """Central differences at random points, where all four states of a contact occur."""
    nc = 12
    band = np.kron(np.abs(np.subtract.outer(np.arange(nc), np.arange(nc))) < 2, np.ones((dimension, dimension)))
    W = band * rng.standard_normal((nc * dimension, nc * dimension)) + 5 * np.eye(nc * dimension)
    q, mu = 10 * rng.standard_normal(nc * dimension), np.r_[0.0, rng.uniform(0.1, 1, nc - 1)]
    problem = FrictionContact(W=sp.csr_array(W) if sparse else W, q=q, mu=mu, dimension=dimension)
    function = AlartCurnier(scaled_contacts(problem))
    assert function._dense is not (sparse and nc > 11)
    x, h = rng.standard_normal(q.size), 1e-6
    J = function.jacobian(function.at(x)[1], 0.0)
    J = J.toarray() if sp.issparse(J) else J
    for k, e in enumerate(np.eye(q.size)):
        slope = (function.at(x + h * e)[0] - function.at(x - h * e)[0]) / (2 * h)
        np.testing.assert_allclose(J[:, k], slope, atol=1e-5)


def test_sweeps_in_pieces_are_those_of_one_run(rng: np.random.Generator) -> None:
    problem, _ = planted.fc(rng, 12, 3, "positive definite")
    r, sweeps = np.zeros(problem.q.size), Sweeps(block_rows(problem))
    for count in (3, 4):
        error = sweeps.sweep(r, count, 1e-300)
    whole = solvers.get("nsgs").run(problem, Budget(tolerance=1e-300, iterations=7)).point
    np.testing.assert_allclose(r, whole.r, rtol=1e-12, atol=1e-14)
    assert error == pytest.approx(problem.residuals(FCPoint(r)).error, rel=1e-9)
    assert sweeps.done == 7


@pytest.mark.parametrize("name", NEW)
@pytest.mark.parametrize("dimension", [2, 3])
def test_planted_contacts_are_solved(name: str, dimension: int) -> None:
    for seed in range(4):
        problem, _ = planted.fc(np.random.default_rng(seed), 8, dimension, "positive definite")
        output = solvers.get(name).run(problem, Budget(tolerance=1e-8))
        assert output.claim is Claim.SOLVED, output.message
        assert judge(problem, output.point, 1e-8).solved


@pytest.mark.parametrize("name", NEW)
@pytest.mark.parametrize("sparse", [False, True])
def test_a_singular_delassus_operator_is_no_obstacle(rng: np.random.Generator, name: str, sparse: bool) -> None:
    problem = hyperstatic(rng, 24, 8, 3, sparse=sparse)
    output = solvers.get(name).run(problem, Budget(tolerance=1e-6))
    assert output.claim is Claim.SOLVED, output.message
    assert judge(problem, output.point, 1e-6).solved


@pytest.mark.parametrize("name", NEW)
def test_a_warm_start_costs_nothing(rng: np.random.Generator, name: str) -> None:
    problem, answer = planted.fc(rng, 12, 3, "positive definite")
    output = solvers.get(name).run(problem, Budget(tolerance=1e-8), start=answer)
    assert output.claim is Claim.SOLVED
    assert output.counters["iterations"] == 0


@pytest.mark.parametrize("name", NEW)
def test_no_contact_is_no_work(name: str) -> None:
    output = solvers.get(name).run(FrictionContact(W=np.zeros((0, 0)), q=[], mu=[]))
    assert output.claim is Claim.SOLVED


@pytest.mark.parametrize("name", NEW)
def test_void_blocks_raise_nothing(name: str) -> None:
    """An answer or an honest word, no NaN, no warning."""
    for D in (np.zeros((3, 3)), np.diag([0.0, 1, 1]), np.ones((3, 3)), -np.eye(3)):
        for q in ([-1.0, 0.5, 0], [1.0, 0.5, 0], [0.0, 0, 0]):
            problem = FrictionContact(W=D, q=q, mu=[0.5], dimension=3)
            output = solvers.get(name).run(problem, Budget(iterations=100))
            assert np.isfinite(output.point.r).all()
            assert output.claim is not Claim.SOLVED or judge(problem, output.point, 1e-6).solved


@pytest.mark.parametrize(
    ("name", "file"),
    [
        ("alart-curnier-newton", "Confeti-ex03-Fc3D-SBM.dat"),
        ("alart-curnier-newton", "Capsules-i125-1213.hdf5"),
        ("admm-contact", "BoxesStack1-i100000-32.hdf5.dat"),
        ("auto-contact", "BoxesStack1-i100000-32.hdf5.dat"),
    ],
)
def test_real_files(shared_data: Path, name: str, file: str) -> None:
    problem = storage.load(shared_data / "fc3d_local" / file)
    output = solvers.get(name).run(problem, Budget(tolerance=1e-6, seconds=60.0))
    assert output.claim is Claim.SOLVED, output.message
    assert judge(problem, output.point, 1e-6).solved
