"""Fixed points, projection and first-order methods on contact: their kernels against plain NumPy, planted problems."""

from __future__ import annotations

import numpy as np
import planted
import pytest

from cpbench.formulations import FCPoint, FrictionContact
from cpbench.foundation import cones
from cpbench.solvers import Budget, Claim, solvers
from cpbench.solvers.base import parse_options
from cpbench.verification import judge
from cpbench_solvers.contact.frozen_law import FrozenProblem, block_csr
from cpbench_solvers.contact.proximal_newton import ProximalNewtonOptions, ProximalSteps
from cpbench_solvers.contact.sweeps import scaled_contacts
from cpbench_solvers.kernels import contact_projection, frozen_contact

FIXED_POINTS = ("tresca-fixed-point", "aclm-fixed-point")
SETS = ("CONE", "CYLINDER")


def project(kind: str, y: np.ndarray, mu: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """The projection of the kernels, by `cones`; by contacts."""
    if kind == "CONE":
        return cones.project_friction_cone(y, mu)
    return cones.project_cylinder(y, radius)


def data(rng: np.random.Generator, dimension: int) -> tuple[FrictionContact, np.ndarray, np.ndarray]:
    problem, _ = planted.fc(rng, 12, dimension, "positive definite")
    return problem, rng.standard_normal(problem.q.size), rng.uniform(0.0, 2.0, 12)


@pytest.mark.parametrize("kind", SETS)
@pytest.mark.parametrize("dimension", [2, 3])
def test_nesterovs_method_is_that_of_plain_numpy(rng: np.random.Generator, dimension: int, kind: str) -> None:
    problem, x, radius = data(rng, dimension)
    contacts = scaled_contacts(problem)
    kernel = frozen_contact
    W, p, shape = contacts.W, contacts.q, (-1, dimension)
    code, state = getattr(kernel, kind), np.array([1.0, 4.0])
    moved = [x.copy(), W @ x, x.copy(), W @ x]
    kernel.accelerate(*block_csr(contacts), code, p, problem.mu, radius, dimension, *moved, state, 12)
    z, theta, step = x, 1.0, 4.0
    for _ in range(12):
        gradient, step = W @ z + p, 1.05 * step
        while True:
            new = project(kind, (z - step * gradient).reshape(shape), problem.mu, radius).ravel()
            change = new - z
            if step * change @ W @ change <= change @ change:
                break
            step /= 2
        beta, old = 0.0, theta
        theta = 1.0
        if gradient @ (new - x) <= 0:
            theta = 0.5 * (-(old**2) + old * np.sqrt(old**2 + 4))
            beta = old * (1 - old) / (old**2 + theta)
        x, z = new, new + beta * (new - x)
    np.testing.assert_allclose(moved[0], x, atol=1e-10)
    np.testing.assert_allclose(moved[1], W @ x, atol=1e-10)
    np.testing.assert_allclose(state, [theta, step], rtol=1e-10)


@pytest.mark.parametrize("momentum", [False, True])
@pytest.mark.parametrize("kind", SETS)
@pytest.mark.parametrize("dimension", [2, 3])
def test_frozen_problems_are_solved(rng: np.random.Generator, dimension: int, kind: str, momentum: bool) -> None:
    """The natural map of the convex problem vanishes, evaluated with the projections of `cones`."""
    problem, x, radius = data(rng, dimension)
    contacts = scaled_contacts(problem)
    frozen = FrozenProblem(contacts, x, momentum=momentum)
    shift = rng.uniform(0.0, 1.0, 12)
    kernel = frozen_contact
    frozen.minimize(getattr(kernel, kind), shift, radius, 1e-12, 20_000, np.inf)
    p = contacts.q.copy()
    p[::dimension] += shift
    X = frozen.x.reshape(-1, dimension)
    G = (contacts.W @ frozen.x + p).reshape(X.shape)
    np.testing.assert_allclose(project(kind, X - G, problem.mu, radius), X, atol=1e-9)


@pytest.mark.parametrize("dimension", [2, 3])
def test_projection_steps_are_those_of_plain_numpy(rng: np.random.Generator, dimension: int) -> None:
    problem, x, _ = data(rng, dimension)
    contacts = scaled_contacts(problem)
    kernel = contact_projection
    law = (*block_csr(contacts), contacts.q, problem.mu, dimension)
    rho = 1e-3  # short enough that it is never reduced, and raised once

    def F(x: np.ndarray) -> np.ndarray:
        return cones.de_saxce((contacts.W @ x + contacts.q).reshape(-1, dimension), problem.mu).ravel()

    def P(x: np.ndarray) -> np.ndarray:
        return cones.project_friction_cone(x.reshape(-1, dimension), problem.mu).ravel()

    y = P(x - rho * F(x))
    expected = {"FIXED_POINT": y, "EXTRAGRADIENT": P(x - rho * F(y))}
    for name, after in expected.items():
        mine, step = x.copy(), np.array([rho])
        kernel.iterate(*law, getattr(kernel, name), mine, step, 1)
        np.testing.assert_allclose(mine, after, atol=1e-12)
        np.testing.assert_allclose(step, 1.5 * rho)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_proximal_point_solves_the_problem_that_it_is_of(rng: np.random.Generator, dimension: int) -> None:
    """r is judged on the contact problem of W + αR⁻¹ and q − αR⁻¹r₀, written out."""
    H = rng.standard_normal((8, 12 * dimension))
    q, mu, before = H.T @ rng.standard_normal(8), np.full(12, 0.4), rng.standard_normal(12 * dimension)
    problem = FrictionContact(W=H.T @ H, q=q, mu=mu, dimension=dimension)
    alpha = 0.3
    steps = ProximalSteps(scaled_contacts(problem), ProximalNewtonOptions(alpha=alpha, share=1e-13), before)
    assert steps.step()
    weight = alpha / np.repeat(problem.rho, dimension)
    near = FrictionContact(W=problem.W + np.diag(weight), q=q - weight * before, mu=mu, dimension=dimension)
    assert judge(near, FCPoint(steps.r), 1e-10).solved
    assert not judge(problem, FCPoint(steps.r), 1e-10).solved


def test_proximal_points_stop_at_their_limits(rng: np.random.Generator) -> None:
    H = rng.standard_normal((24, 72))
    problem = FrictionContact(W=H.T @ H, q=H.T @ rng.standard_normal(24), mu=np.full(24, 0.4), dimension=3)
    steps = ProximalSteps(scaled_contacts(problem), ProximalNewtonOptions(share=1e-13), np.zeros(72))
    assert steps.step(most=1)
    assert steps.newton_steps <= 1
    before = steps.newton_steps
    assert steps.step(deadline=0.0)
    assert steps.newton_steps == before


@pytest.mark.parametrize("name", FIXED_POINTS)
def test_gauss_seidel_does_for_nesterov(rng: np.random.Generator, name: str) -> None:
    """Where W is not symmetric it is taken by itself."""
    solver = solvers.get(name)
    problem, _ = planted.fc(rng, 8, 3, "positive definite")
    options = parse_options(solver.spec, {"momentum": "false"})
    assert solver.run(problem, Budget(tolerance=1e-8), options).claim is Claim.SOLVED
    skew = rng.standard_normal(problem.W.shape) * 0.05
    tilted = FrictionContact(W=problem.W + skew - skew.T, q=problem.q, mu=problem.mu, dimension=3)
    assert solver.run(tilted, Budget(tolerance=1e-8)).claim is Claim.SOLVED
