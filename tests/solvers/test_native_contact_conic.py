"""Interior points on frictional contact: algebra of Lorentz cones, published answers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

from cpbench import storage
from cpbench.solvers import Budget, Claim, solvers
from cpbench.verification import judge
from cpbench_solvers.kernels import contact_interior

KERNEL = contact_interior


def inside(rng: np.random.Generator, count: int, d: int) -> np.ndarray:
    x = rng.standard_normal((count, d))
    x[:, 0] = np.linalg.norm(x[:, 1:], axis=1) + rng.uniform(0.01, 2.0, count)
    return x


def prepared(y: np.ndarray, w: np.ndarray) -> dict[str, np.ndarray]:
    """What the kernel makes of y and w, with Θ of its scaling as `blocks`."""
    nc, d = y.shape
    found = {"scaling": np.empty((nc, 2 * d + 1)), "slope": np.empty((nc, d)), "residual": np.empty(nc * d)}
    found["blocks"] = np.empty((nc, d, d))
    KERNEL.prepare(y, w, w, np.zeros(nc * d), 0.1, *found.values())
    f, scale = found["scaling"][:, :d], found["scaling"][:, -1]
    J = np.diag(np.r_[1.0, -np.ones(d - 1)])
    found["blocks"] = scale[:, None, None] * (2.0 * np.einsum("ci,cj->cij", f, f) - J)
    return found


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


@pytest.mark.parametrize("file", ["Capsules-i125-1213.hdf5", "siconos_mix96_NONSYM-nc185.hdf5"])
def test_real_files(shared_data: Path, file: str) -> None:
    """The first has 36 parts that share nothing, with loads that are 700 times apart."""
    problem: Any = storage.load(shared_data / "fc3d_local" / file)
    assert sp.issparse(problem.W)
    output = solvers.get("interior-point-fc").run(problem, Budget(tolerance=1e-8, seconds=60.0))
    assert output.claim is Claim.SOLVED, output.message
    assert judge(problem, output.point, 1e-8).solved
