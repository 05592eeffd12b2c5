"""De Saxcé's fixed point around Clarabel and SCS, and SCS on cone programs: planted problems, judged by residuals."""

from __future__ import annotations

from typing import Any

import numpy as np
import planted_contact
import pytest

from cpbench import graph
from cpbench.conversions.base import make
from cpbench.formulations import GlobalFrictionContact
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.local_contact import FrictionContact
from cpbench.solvers import Budget, Claim, solvers
from cpbench.verification import judge


@pytest.fixture(params=["clarabel-de-saxce", "scs-de-saxce"])
def desaxce(request: pytest.FixtureRequest) -> Any:
    return solvers.get(request.param)


def sliding(nc: int, d: int, seed: int, *, skew: float = 0.0, rank: int | None = None) -> FrictionContact:
    """Contacts that slide, stick and leave in turn; q = u − Wr, and a part of W that is skew."""
    rng = np.random.default_rng(seed)
    n = nc * d
    F, S = rng.normal(size=(n, rank or n)), rng.normal(size=(n, n))
    W = F @ F.T / n
    W += skew * np.abs(W).max() * (S - S.T) / np.abs(S - S.T).max()
    mu = rng.uniform(0.2, 0.9, nc)
    r, u = np.zeros((nc, d)), np.zeros((nc, d))
    for c in range(nc):
        t = rng.normal(size=d - 1)
        t /= np.linalg.norm(t)
        if c % 3 == 2:
            u[c] = 1.0, *t
        else:
            r[c] = 1.0, *(mu[c] * t * (1.0 if c % 3 == 0 else 0.5))
            u[c, 1:] = -t if c % 3 == 0 else 0.0
    problem = FrictionContact(W=W, q=u.ravel() - W @ r.ravel(), mu=mu, dimension=d)
    assert judge(problem, FCPoint(r.ravel()), 1e-12).solved
    return problem


PROBLEMS = {
    "3d": sliding(6, 3, 1),
    "2d": sliding(9, 2, 2),
    "rank-deficient": sliding(12, 3, 3, rank=24),
    "a-little-skew": sliding(6, 3, 4, skew=4e-4),
}


@pytest.mark.parametrize("tolerance", [1e-4, 1e-7])
@pytest.mark.parametrize("name", PROBLEMS)
def test_sliding_contacts_obey_the_law(desaxce: Any, name: str, tolerance: float) -> None:
    """It ends by the energy of all contacts; the verdict takes the largest velocity of one."""
    output = desaxce.run(PROBLEMS[name], Budget(tolerance=tolerance))
    assert output.claim is Claim.SOLVED
    assert judge(PROBLEMS[name], output.point, 10 * tolerance).solved
    assert output.counters["inner_iterations"] > output.counters["iterations"] > 1


def test_the_first_step_is_the_convex_relaxation(desaxce: Any) -> None:
    """One contact, W = I: the projection of −q on K_μ, which lifts off with u_N = μ‖u_T‖."""
    problem = FrictionContact(W=np.eye(3), q=np.array([-1.0, 2.0, 0.0]), mu=np.array([0.5]))
    output = desaxce.run(problem, Budget(tolerance=1e-8, iterations=1))
    assert output.claim is Claim.MAX_ITER
    r = output.point.r
    u = r + problem.q
    assert abs(u[0] - 0.5 * np.hypot(u[1], u[2])) < 1e-6


def test_a_load_without_support_has_no_fixed_point(desaxce: Any) -> None:
    problem = FrictionContact(W=np.zeros((3, 3)), q=np.array([-1.0, 0.0, 0.0]), mu=np.array([0.5]))
    output = desaxce.run(problem)
    assert output.claim is Claim.FAILED
    assert output.message.startswith("convex program 1: ")


def test_refusals(desaxce: Any) -> None:
    W = np.eye(3)
    W[0, 1] = 0.25
    skew = FrictionContact(W=W, q=np.ones(3), mu=np.array([0.5]))
    assert "asymmetry = 2.5e-01" in str(desaxce.obstacle(skew))
    indefinite = FrictionContact(W=np.diag([1.0, 1.0, -1.0]), q=np.ones(3), mu=np.array([0.5]))
    assert "semidefinite" in str(desaxce.obstacle(indefinite))


def answered(problem, *edges: str, by: str):
    """The answer of the solver `by` to the problem at the end of the edges, lifted to the problem."""
    there = problem
    for name in edges:
        there = make(name).step(there)
    output = solvers.get(by).run(there, Budget(tolerance=1e-11))
    assert output.point is not None, output.message
    return graph.lift(there, output.point)


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("seed", range(4))
def test_friction_without_condensation_by_the_fixed_point_on_de_saxce(seed):
    """min ½vᵀMv − fᵀv over Hᵀv + w + s e_N ∈ K* with s := μ‖u_T‖ until it stays, against the condensed problem."""
    problem, _ = planted_contact.gfc(np.random.default_rng(seed), 5, 3, 1, 3)
    mild = GlobalFrictionContact(
        M=problem.M, H=problem.H, G=problem.G, f=problem.f, w=problem.w, b=problem.b, mu=np.full(3, 0.3), dimension=3
    )
    slip = np.zeros(3)
    for _ in range(200):
        target = make("gfc-coneqp", {"slip": tuple(slip)}).step(mild)
        output = solvers.get("clarabel-coneqp").run(target, Budget(tolerance=1e-11))
        point = graph.lift(target, output.point)
        u = mild.slacks(point)["u"].reshape(-1, 3)
        before, slip = slip, mild.mu * np.linalg.norm(u[:, 1:], axis=1)
        if np.abs(slip - before).max() <= 1e-11:
            break
    assert mild.residuals(point).error <= 1e-8
    condensed = answered(mild, "gfc-fc", by="nsgs")
    assert mild.residuals(condensed).error <= 1e-8
    np.testing.assert_allclose(condensed.v, point.v, atol=1e-6)
