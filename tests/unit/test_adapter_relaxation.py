"""The convex contact relaxation: exact on separated and sticking contacts, its own law on sliding ones."""

from __future__ import annotations

import numpy as np
import pytest

from cpbench.formulations.contact import FCPoint
from cpbench.formulations.local_contact import FrictionContact
from cpbench.foundation import cones
from cpbench.solvers import Budget, Claim, solvers
from cpbench.verification import judge

RELAXATION = solvers.get("clarabel-relaxation")
pytestmark = pytest.mark.skipif(not RELAXATION.availability().ok, reason="needs clarabel")


def planted(
    nc: int,
    d: int,
    seed: int,
    *,
    states: tuple[str, ...] = ("stick", "free"),
    rank: int | None = None,
    unit: float = 1.0,
    frictionless: bool = False,
) -> tuple[FrictionContact, FCPoint]:
    """Contacts whose states are drawn first; q = u − Wr. `unit` scales W, hence r against u."""
    rng = np.random.default_rng(seed)
    n = nc * d
    F = rng.normal(size=(n, rank or n))
    W = unit * F @ F.T / n
    mu = rng.uniform(0.2, 0.9, nc)
    if frictionless:
        mu[::2] = 0.0
    r, u = np.zeros((nc, d)), np.zeros((nc, d))
    for c in range(nc):
        t = rng.normal(size=d - 1)
        t /= np.linalg.norm(t)
        state = states[c % len(states)]
        if state == "free":
            u[c, 1:] = 0.3 * t
            u[c, 0] = rng.uniform(0.5, 1.0) + mu[c] * 0.3  # inside K*, so also a solution of the relaxation
        else:
            r[c, 0] = rng.uniform(0.5, 1.0)
            r[c, 1:] = mu[c] * r[c, 0] * t * (0.5 if state == "stick" else 1.0)
            if state == "slide":
                u[c, 1:] = -t
    return FrictionContact(W=W, q=u.ravel() - W @ r.ravel(), mu=mu, dimension=d), FCPoint(r=r.ravel())


def relaxed_error(problem: FrictionContact, r: np.ndarray) -> float:
    """Energy norm of the natural map of K* ∋ Wr + q ⟂ r ∈ K, the law without De Saxcé's term, over its scale."""
    root = np.sqrt(problem.rho)[:, None]
    R, U = r.reshape(problem.nc, -1), (problem.W @ r + problem.q).reshape(problem.nc, -1)
    defect = R - cones.project_friction_cone(R - root**2 * U, problem.mu)
    scale = max(np.linalg.norm(R / root), np.linalg.norm(root * U))
    return float(np.linalg.norm(defect / root) / scale)


EXACT = {
    "3d": planted(6, 3, 1),
    "3d-one": planted(1, 3, 1),
    "2d": planted(10, 2, 3),
    "rank-deficient": planted(20, 3, 4, rank=30),
    "frictionless": planted(6, 3, 2, frictionless=True),
    "frictionless-2d": planted(6, 2, 2, frictionless=True),
    "light": planted(10, 3, 5, unit=1e-4),
    "heavy": planted(10, 3, 5, unit=1e4),
}


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize("name", EXACT)
def test_separated_and_sticking_contacts_obey_the_exact_law(name: str, tolerance: float) -> None:
    problem, point = EXACT[name]
    assert problem.residuals(point).error < 1e-12
    output = RELAXATION.run(problem, Budget(tolerance=tolerance))
    assert output.claim is Claim.SOLVED
    assert output.counters["iterations"] > 0
    assert problem.residuals(output.point, tolerance).error <= tolerance
    # separated contacts, beside W = 1e-4 much faster than reactions make any, set the size of the energy norm alone
    assert judge(problem, output.point, tolerance).error <= 100 * tolerance


@pytest.mark.parametrize("rank", [None, 20])
@pytest.mark.parametrize("d", [2, 3])
def test_sliding_contacts_solve_the_relaxation_and_not_the_law(d: int, rank: int | None) -> None:
    problem, _ = planted(9, d, 6, states=("slide", "free", "stick"), rank=rank)
    output = RELAXATION.run(problem)
    assert relaxed_error(problem, output.point.r) <= 1e-6
    verdict = judge(problem, output.point, 1e-6)
    assert not verdict.solved
    assert verdict.error > 1e-2


def test_a_sliding_contact_lifts_off_by_mu_times_its_speed() -> None:
    """One contact with W = I and q = (−1, q_T): the projection of −q on K_μ, since min ½|r|² + qᵀr over K."""
    mu, q = 0.5, np.array([-1.0, 2.0, 0.0])
    problem = FrictionContact(W=np.eye(3), q=q, mu=np.array([mu]))
    r = RELAXATION.run(problem, Budget(tolerance=1e-8)).point.r
    assert np.abs(r - cones.project_friction_cone(-q[None, :], problem.mu)[0]).max() < 1e-6
    u = r + q
    assert abs(u[0] - mu * np.hypot(u[1], u[2])) < 1e-6  # u on the boundary of K*: dilatancy


def test_a_load_without_support_is_unbounded() -> None:
    """W = 0 and a contact that is pushed in: qᵀr decreases without end along the normal."""
    problem = FrictionContact(W=np.zeros((3, 3)), q=np.array([-1.0, 0.0, 0.0]), mu=np.array([0.5]))
    output = RELAXATION.run(problem)
    assert output.claim is Claim.UNBOUNDED
    assert output.point is None


def test_refusals() -> None:
    W = np.eye(3)
    W[0, 1] = 0.25
    skew = FrictionContact(W=W, q=np.ones(3), mu=np.array([0.5]))
    assert "asymmetry = 2.5e-01" in str(RELAXATION.obstacle(skew))
    indefinite = FrictionContact(W=np.diag([1.0, 1.0, -1.0]), q=np.ones(3), mu=np.array([0.5]))
    assert "semidefinite" in str(RELAXATION.obstacle(indefinite))
    empty = FrictionContact(W=np.zeros((0, 0)), q=np.zeros(0), mu=np.zeros(0))
    assert "nc = 0" in str(RELAXATION.obstacle(empty))
    assert RELAXATION.obstacle(EXACT["3d"][0]) is None
