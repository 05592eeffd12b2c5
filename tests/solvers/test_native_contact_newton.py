"""Newton methods and ADMM on frictional contact: their pieces against plain NumPy, planted and real problems."""

from __future__ import annotations

import numpy as np
import planted
import pytest
import scipy.sparse as sp

from cpbench.formulations import FCPoint, FrictionContact
from cpbench.foundation import cones
from cpbench.solvers import Budget, Claim, solvers
from cpbench_solvers.contact.newton_equation import ContactEquation, ContactFunction
from cpbench_solvers.contact.semismooth_newton import ContactNewtonOptions
from cpbench_solvers.contact.sweeps import scaled_contacts
from cpbench_solvers.kernels import contact_newton

NEWTON = ("newton-alart-curnier", "newton-natural-map")
FUNCTIONS = list(ContactFunction)


def banded(rng: np.random.Generator, nc: int, dimension: int, *, sparse: bool) -> FrictionContact:
    """A nonsymmetric W whose contacts touch their neighbours; the first contact has no friction."""
    near = np.abs(np.subtract.outer(np.arange(nc), np.arange(nc))) < 2
    W = np.kron(near, np.ones((dimension, dimension))) * rng.standard_normal((nc * dimension, nc * dimension))
    W += 5 * np.eye(nc * dimension)
    q, mu = 10 * rng.standard_normal(nc * dimension), np.r_[0.0, rng.uniform(0.1, 1, nc - 1)]
    return FrictionContact(W=sp.csr_array(W) if sparse else W, q=q, mu=mu, dimension=dimension)


def plain(function: ContactFunction, x: np.ndarray, v: np.ndarray, mu: float, rho: np.ndarray) -> np.ndarray:
    """φ of one contact from its definition."""
    K = np.array([mu])
    hat = cones.de_saxce(v[None], K)[0]
    y = x - np.r_[rho[0], np.full(x.size - 1, rho[1])] * v
    if function is ContactFunction.NATURAL_MAP:
        return x - cones.project_friction_cone((x - rho[0] * hat)[None], K)[0]
    return x - cones.project_cylinder(y[None], np.array([mu * max(y[0], 0.0)]))[0]


@pytest.mark.parametrize("function", FUNCTIONS)
@pytest.mark.parametrize("dimension", [2, 3])
def test_the_functions_are_those_of_their_definitions(
    rng: np.random.Generator, dimension: int, function: ContactFunction
) -> None:
    kernel = contact_newton
    nc = 50
    x, v = rng.standard_normal((2, nc, dimension))
    mu, rho = np.where(rng.random(nc) < 0.2, 0.0, rng.uniform(0.1, 1, nc)), rng.uniform(0.5, 2, (nc, 2))
    phi, moves = np.empty(nc * dimension), np.empty(nc, dtype=bool)
    A, B = np.empty((2, nc, dimension, dimension))
    kernel.evaluate(int(function), x.ravel(), v.ravel(), mu, rho, phi, A, B, moves)
    expected = [plain(function, x[c], v[c], mu[c], rho[c]) for c in range(nc)]
    np.testing.assert_allclose(phi.reshape(nc, -1), expected, atol=1e-12)


@pytest.mark.parametrize("function", FUNCTIONS)
@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("alpha", [0.0, 0.7])
def test_the_jacobian_is_the_slope_of_the_function(
    rng: np.random.Generator, alpha: float, dimension: int, sparse: bool, function: ContactFunction
) -> None:
    """Central differences at random points, where all states of a contact occur; the direction solves with it."""
    problem = banded(rng, 14, dimension, sparse=sparse)
    equation = ContactEquation(scaled_contacts(problem), function).near(rng.standard_normal(problem.q.size), alpha)
    x, h = rng.standard_normal(problem.q.size), 1e-6
    at = equation.at(x)
    J = equation.jacobian(at, 0.0, np.arange(problem.nc))
    assert sp.issparse(J) is sparse
    J = J.toarray() if sp.issparse(J) else np.asarray(J)
    for k, e in enumerate(np.eye(x.size)):
        slope = (equation.at(x + h * e).phi - equation.at(x - h * e).phi) / (2 * h)
        np.testing.assert_allclose(J[:, k], slope, atol=1e-5)
    d = np.asarray(np.linalg.solve(J, -at.phi), dtype=np.float64)
    found = equation.direction(at, 0.0)
    assert found is not None
    np.testing.assert_allclose(found, d, rtol=1e-8, atol=1e-10)


def test_the_regularization_is_that_of_the_operator(rng: np.random.Generator) -> None:
    problem = banded(rng, 6, 3, sparse=False)
    equation = ContactEquation(scaled_contacts(problem), ContactFunction.ALART_CURNIER)
    at, everything = equation.at(rng.standard_normal(18)), np.arange(6)
    change = np.asarray(equation.jacobian(at, 0.3, everything)) - np.asarray(equation.jacobian(at, 0.0, everything))
    scaled = scaled_contacts(problem)
    mobility = np.diag(np.asarray(scaled.W)).reshape(6, 3)
    R = np.stack([mobility[:, 0], *2 * [mobility[:, 1:].mean(axis=1)]], axis=1)
    expected = np.zeros((18, 18))
    for c in range(6):
        expected[3 * c : 3 * c + 3, 3 * c : 3 * c + 3] = 0.3 * at.B[c] * R[c]
    np.testing.assert_allclose(change, expected, atol=1e-12)


def test_at_the_apex_the_derivatives_are_numbers() -> None:
    """x = v = 0, where no function is smooth."""
    for function in FUNCTIONS:
        for mu in (0.0, 0.5):
            problem = FrictionContact(W=np.eye(3), q=np.zeros(3), mu=np.array([mu]))
            equation = ContactEquation(scaled_contacts(problem), function)
            at = equation.at(np.zeros(3))
            assert at.size == 0.0
            assert np.isfinite(at.A).all()
            assert np.isfinite(at.B).all()


def test_newton_alone_ends_with_a_word(rng: np.random.Generator) -> None:
    """Without sweeps: solved by a few steps from near, and never an endless loop."""
    problem, solution = planted.fc(rng, 8, 3, "positive definite")
    start = FCPoint(solution.r * (1 + 1e-3 * rng.standard_normal(solution.r.size)))
    for name in NEWTON:
        solver = solvers.get(name)
        near = solver.run(problem, Budget(tolerance=1e-9), ContactNewtonOptions(sweeps=0), start=start)
        assert near.counters["sweeps"] == 0
        far = solver.run(problem, Budget(tolerance=1e-9), ContactNewtonOptions(sweeps=0))
        for output in (near, far):
            assert output.claim is Claim.SOLVED or output.message
        assert near.claim is Claim.SOLVED
        assert near.counters["newton_steps"] <= 10
        assert near.message.startswith("regularized by τ = ")
