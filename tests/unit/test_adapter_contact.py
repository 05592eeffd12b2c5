"""Contact solvers of robotics: Pinocchio's, on Coulomb's law, judged by us."""

from __future__ import annotations

import numpy as np
import planted
import pytest
import scipy.sparse as sp

from cpbench import storage
from cpbench.formulations import FCPoint, FrictionContact
from cpbench.solvers import Budget, Claim, solvers
from cpbench.verification import judge

ADMM, PGS = (solvers.get(name) for name in ("pinocchio-admm", "pinocchio-pgs"))
with_pinocchio = pytest.mark.skipif(not ADMM.availability().ok, reason="needs pin")


def states(kind: str, nc: int = 6, seed: int = 0, sparse: bool = False) -> FrictionContact:
    """Contacts that separate, graze, stick and slide, planted."""
    return planted.fc(np.random.default_rng(seed), nc, 3, kind, sparse=sparse)[0]


def box(corners: int = 4) -> FrictionContact:
    """A unit cube on a plane, pushed sideways until it slides: `corners` contacts, W of rank 6, h = 1, mass 1, g = 10.

    Its forces are not unique; its velocity is: −10 down against the plane, 8 sideways less μ·10.
    """
    angle = 2 * np.pi * (np.arange(corners) + 0.5) / corners
    arms = np.stack([np.cos(angle) / np.sqrt(2), np.sin(angle) / np.sqrt(2), np.full(corners, -0.1)], axis=1)
    axes = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])  # N, T1, T2
    H = np.vstack([np.hstack([axes, np.cross(arm, axes)]) for arm in arms])
    W = H @ np.diag([1.0, 1, 1, 6, 6, 6]) @ H.T
    q = H @ np.array([8.0, 0, -10, 0, 0, 0])
    return FrictionContact(W=W, q=q, mu=np.full(corners, 0.5))


# --------------------------------------------------------------------------------------- Pinocchio

PLANTED = {
    "definite": states("positive definite"),
    "sparse": states("positive definite", sparse=True),
    "singular": states("singular semidefinite", seed=3),
    "box": box(),
    "hyperstatic": box(12),
}


@with_pinocchio
@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize("problem", [box(3), box(), box(12)], ids=["3", "4", "12"])
def test_pgs_solves_contacts_of_even_tangents(problem, tolerance) -> None:
    output = PGS.run(problem, Budget(tolerance=tolerance))
    assert output.claim is Claim.SOLVED
    assert judge(problem, output.point, tolerance).solved


@with_pinocchio
def test_pgs_does_not_hear_the_later_contacts_of_a_sweep() -> None:
    """Frictionless: contact 1 is open, u_1 = 0.5, at its turn; contact 2 then pushes with 1, and u_1 = −1.5."""
    W = np.zeros((6, 6))
    W[np.ix_([0, 3], [0, 3])] = [[1.0, -2.0], [-2.0, 5.0]]
    q, mu = np.array([0.5, 0.0, 0.0, -5.0, 0.0, 0.0]), np.zeros(2)
    problem = FrictionContact(W=W, q=q, mu=mu)
    output = PGS.run(problem)
    assert output.claim is Claim.SOLVED
    assert output.counters["iterations"] <= 2
    assert judge(problem, output.point, 1e-6).error > 0.1
    assert judge(problem, ADMM.run(problem).point, 1e-6).solved


@pytest.mark.needs("cpbench_solvers")
@with_pinocchio
@pytest.mark.parametrize("name", PLANTED)
def test_velocities_are_those_of_nsgs(name) -> None:
    """Forces need not be unique, but W ⪰ 0 and its factor make velocities comparable where both solve the law."""
    problem = PLANTED[name]
    points = [solvers.get(s).run(problem, Budget(tolerance=1e-9)).point for s in ("nsgs", "pinocchio-admm")]
    one, other = (problem.W @ p.r + problem.q for p in points)
    assert np.abs(one - other).max() <= 1e-6 * np.abs(problem.q).max()


@with_pinocchio
def test_the_sliding_box_has_the_forces_of_newtons_law() -> None:
    problem = box(12)
    r = ADMM.run(problem, Budget(tolerance=1e-9)).point.r.reshape(-1, 3)
    np.testing.assert_allclose(r.sum(axis=0), [10.0, -5.0, 0.0], atol=1e-6)


@with_pinocchio
def test_more_rows_than_a_stack_has_room_for() -> None:
    """1200 rows: PGS would end in a segmentation fault on a stack of 8 MB."""
    problem = FrictionContact(W=sp.eye_array(1200).tocsr(), q=np.tile([-1.0, 0.3, 2.0], 400), mu=np.full(400, 0.5))
    for solver in (ADMM, PGS):
        assert judge(problem, solver.run(problem).point, 1e-6).solved


@with_pinocchio
def test_long_tangential_steps_of_pgs_cycle_and_are_not_claimed() -> None:
    """W_TT = diag(1, 10), a sticking contact: a step with 1/1 overshoots ninefold along the stiff tangent."""
    problem = FrictionContact(W=np.diag([1.0, 1.0, 10.0]), q=np.array([-1.0, -0.1, -1.0]), mu=np.array([0.9]))
    output = PGS.run(problem, options=PGS.spec.options(max_iterations=1000))
    assert output.claim is Claim.MAX_ITER
    assert output.counters["iterations"] == 1000
    assert judge(problem, ADMM.run(problem).point, 1e-6).solved


@with_pinocchio
def test_the_time_limit_is_kept_by_pgs() -> None:
    problem = FrictionContact(W=np.diag([1.0, 1.0, 10.0]), q=np.array([-1.0, -0.1, -1.0]), mu=np.array([0.9]))
    options = PGS.spec.options(max_iterations=10**12)
    assert PGS.run(problem, Budget(seconds=0.2), options).claim is Claim.MAX_ITER


@with_pinocchio
def test_what_pinocchio_does_not_take() -> None:
    plane = FrictionContact(W=np.eye(2), q=-np.ones(2), mu=np.array([0.5]), dimension=2)
    skew = FrictionContact(W=np.eye(3) + np.diag([0.25, 0], 1), q=-np.ones(3), mu=np.array([0.5]))
    for solver in (ADMM, PGS):
        assert "dimension 2" in solver.obstacle(plane)
        assert "asymmetry = 2.5e-01" in solver.obstacle(skew)
        assert solver.run(FrictionContact(W=np.zeros((0, 0)), q=[], mu=[])).claim is Claim.SOLVED


# --------------------------------------------------------------------------------------- real files

REAL = ("mj_box_tower10-nc40", "mj_dm_humanoid-nc6", "siconos_box_stack8-nc32", "siconos_spheres64-nc96")


@with_pinocchio
@pytest.mark.parametrize("name", REAL)
def test_admm_solves_scenes_of_simulators(shared_data, name) -> None:
    problem = storage.load(shared_data / "fc3d_local" / f"{name}.hdf5")
    output = ADMM.run(problem)
    assert output.claim is Claim.SOLVED
    assert judge(problem, output.point, 1e-6).solved
    assert isinstance(output.point, FCPoint)
