"""Gauss–Seidel by colours: a proper colouring, the iterates of the same order, and threads that change no bit."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from cpbench.formulations.fc import FrictionContact
from cpbench.solvers import Budget, Claim, solvers
from cpbench.verification import judge
from cpbench_solvers.contact.nsgs_coloured import Coloured, ColouredOptions, ColouredSweeps
from cpbench_solvers.contact.sweeps import Sweeps, block_rows


def packing(dimension: int, nc: int = 60, seed: int = 0) -> FrictionContact:
    """Contacts between twenty bodies, W = HᵀH with some blocks of one side left out: its pattern is not symmetric."""
    rng = np.random.default_rng(seed)
    H = np.zeros((60, dimension * nc))
    for c in range(nc):
        for body in rng.choice(20, 2, replace=False):
            H[3 * body : 3 * body + 3, dimension * c : dimension * (c + 1)] = rng.standard_normal((3, dimension))
    W = (H.T @ H + 0.5 * np.eye(dimension * nc)).reshape(nc, dimension, nc, dimension)
    one_sided = rng.random((nc, nc)) < 0.1
    W[np.triu(one_sided, 1)[:, None, :, None].repeat(dimension, 1).repeat(dimension, 3)] = 0.0
    W = sp.csr_array(W.reshape(dimension * nc, dimension * nc))
    return FrictionContact(
        W=W, q=rng.standard_normal(dimension * nc), mu=rng.uniform(0.1, 0.9, nc), dimension=dimension
    )


@pytest.mark.parametrize("dimension", [2, 3])
def test_contacts_of_a_colour_share_no_block(dimension: int) -> None:
    problem = packing(dimension)
    coloured = Coloured.of(problem)
    joined = abs(problem.W.toarray()).reshape(problem.nc, dimension, problem.nc, dimension).sum(axis=(1, 3)) > 0
    assert 2 < coloured.bounds.size - 1 < problem.nc
    assert sorted(coloured.contacts) == list(range(problem.nc))
    for first, last in zip(coloured.bounds[:-1], coloured.bounds[1:], strict=True):
        members = coloured.contacts[first:last]
        assert joined[np.ix_(members, members)].sum() == members.size > 0


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("threads", [1, 2, 5])
def test_the_iterates_are_those_of_the_order_for_any_number_of_threads(dimension: int, threads: int) -> None:
    problem = packing(dimension)
    coloured = Coloured.of(problem)
    rows = (dimension * coloured.contacts[:, None] + np.arange(dimension)).ravel()
    same = FrictionContact(
        W=sp.csr_array(problem.W.toarray()[np.ix_(rows, rows)]),
        q=problem.q[rows],
        mu=problem.mu[coloured.contacts],
        dimension=dimension,
    )
    expected = np.zeros(problem.q.size)
    Sweeps(block_rows(same)).sweep(expected, 7, 0.0)
    solver, options = solvers.get("nsgs-coloured"), ColouredOptions(threads=threads)
    output = solver.run(problem, Budget(tolerance=1e-15, iterations=7), options)
    method = ColouredSweeps(coloured, np.zeros(problem.q.size), 1, None)
    method.step(7, 1.0, 1.0)
    assert np.abs(expected).max() > 0.1
    np.testing.assert_allclose(method.r, expected, rtol=1e-12, atol=1e-14)
    np.testing.assert_array_equal(output.point.r, coloured.by_contact(method.r))


@pytest.mark.parametrize("threads", [1, 2])
def test_it_solves_with_threads_and_starts_warm(threads: int) -> None:
    problem, solver, options = packing(3, seed=2), solvers.get("nsgs-coloured"), ColouredOptions(threads=threads)
    output = solver.run(problem, Budget(tolerance=1e-10), options)
    assert output.claim is Claim.SOLVED, output.message
    assert judge(problem, output.point, 1e-10).solved
    assert solver.run(problem, Budget(tolerance=1e-10), options, output.point).counters["iterations"] == 0


def test_a_run_takes_it_only_when_asked() -> None:
    assert not solvers.get("nsgs-coloured").spec.by_default
    assert ColouredOptions().threads == 1


@pytest.mark.parametrize("threads", [1, 2])
def test_no_contact_is_solved(threads: int) -> None:
    none = FrictionContact(W=sp.csr_array((0, 0)), q=np.zeros(0), mu=np.zeros(0))
    output = solvers.get("nsgs-coloured").run(none, Budget(), ColouredOptions(threads=threads))
    assert output.claim is Claim.SOLVED
