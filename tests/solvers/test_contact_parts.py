"""Contact problems of several connected parts, each of its own size: what methods claim, and what is measured."""

from __future__ import annotations

from typing import Any

import numpy as np
import planted_contact
import pytest
import scipy.sparse as sp
from claims import compiled_error
from test_page import SHOWN, of_contact

from cpbench.formulations.contact import FCPoint
from cpbench.formulations.local_contact import FrictionContact, RollingFrictionContact
from cpbench.solvers.base import Budget, Claim, solvers
from cpbench.verification import judge
from cpbench_solvers.contact.parts import ContactPart, connected_parts
from cpbench_solvers.contact.sweeps import block_rows

METHODS = (
    "auto-fc",
    "nsgs",
    "admm-fc",
    "newton-alart-curnier",
    "proximal-newton",
    "interior-point-fc",
)


def glued(rng: np.random.Generator, count: int, *, sparse: bool = True) -> FrictionContact:
    """Put small scenes with solutions side by side, loads and masses of each a million times apart, in drawn order."""
    W, q, mu = [], [], []
    for _ in range(count):
        nc, load, mass = int(rng.integers(1, 8)), *10.0 ** rng.uniform(-6, 6, 2)
        H = rng.standard_normal((3 * nc, 3 * nc + 6))
        W.append(H @ H.T / mass)
        q.append(load * (rng.standard_normal(3 * nc) - 0.5 * np.tile([1.0, 0.0, 0.0], nc)))
        mu.append(rng.uniform(0.1, 0.9, nc))
    blocks = sp.block_diag(list(map(sp.csr_array, W)), format="csr")
    nc = blocks.shape[0] // 3
    order = rng.permutation(nc)
    rows = (3 * order[:, None] + np.arange(3)).ravel()
    matrix: Any = sp.csr_array(blocks[rows][:, rows])
    matrix = matrix if sparse else matrix.toarray()
    return FrictionContact(W=matrix, q=np.concatenate(q)[rows], mu=np.concatenate(mu)[order], dimension=3)


def glued_rolling(rng: np.random.Generator, count: int) -> RollingFrictionContact:
    """Put as many scenes with rolling friction side by side, loads and masses of each a million times apart."""
    W, q, mu, mu_r = [], [], [], []
    for _ in range(count):
        nc, load, mass = int(rng.integers(1, 6)), *10.0 ** rng.uniform(-6, 6, 2)
        H = rng.standard_normal((5 * nc, 5 * nc + 6))
        W.append(H @ H.T / mass)
        q.append(load * (rng.standard_normal(5 * nc) - 0.5 * np.tile([1.0, 0.0, 0.0, 0.0, 0.0], nc)))
        mu.append(rng.uniform(0.1, 0.9, nc))
        mu_r.append(rng.uniform(0.01, 0.5, nc))
    law: dict[str, Any] = {"mu": np.concatenate(mu), "mu_r": np.concatenate(mu_r)}
    return RollingFrictionContact(W=sp.block_diag(list(map(sp.csr_array, W)), format="csr"), q=np.concatenate(q), **law)


def test_the_error_of_a_part_is_that_of_the_definition() -> None:
    for seed in range(50):
        rng = np.random.default_rng(seed)
        problem, answer, expected = of_contact(rng, int(rng.integers(2, 31)), 10.0 ** rng.uniform(-8, -1))
        part = ContactPart.of(np.arange(problem.q.size), problem, block_rows(problem))
        assert part.error(answer.r) == pytest.approx(expected, rel=2e-3, abs=1e-13), seed


def test_free_velocities_of_sliding_contacts_hide_less_than_a_digit() -> None:
    """By hand: a contact that slides a thousand times faster than the other contact's load. r_N = 1.1 for 1 leaves the
    velocity 0.1, of which a tenth is compared with the largest of the contact's own terms, 1.1."""
    W, mu = np.eye(6), np.full(2, 0.1)
    W[0, 3] = W[3, 0] = 1e-3  # one part
    q = np.array([-1.0, 0.0, 0.0, -1e-3, 1e3, 0.0])
    right = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    problem = FrictionContact(W=W, q=q, mu=mu, dimension=3)
    wrong = right * 1.1
    part = ContactPart.of(np.arange(6), problem, block_rows(problem))
    assert part.error(wrong) == pytest.approx(SHOWN["contact_error"](W, q, mu, wrong), rel=1e-3)
    assert judge(problem, FCPoint(wrong), 1e-6).error == pytest.approx(0.01 / 1.1, rel=1e-6)


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.nightly) for seed in range(2, 12))])
def test_no_claim_fails_on_parts_of_their_own_sizes(name: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = glued(rng, int(rng.integers(2, 30)), sparse=bool(seed % 2))
    for tolerance in (1e-4, 1e-6, 1e-8):
        output = solvers.get(name).run(problem, Budget(tolerance=tolerance, seconds=20.0))
        error = judge(problem, output.point, tolerance).error
        assert error <= tolerance or output.claim is not Claim.SOLVED, f"{tolerance}: {error:.1e}"
        if name == "auto-fc":
            assert output.claim is Claim.SOLVED, output.message


@pytest.mark.parametrize("name", ["auto-rfc", "nsgs-rfc", "admm-rfc"])
@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.nightly) for seed in range(2, 6))])
def test_no_claim_fails_on_parts_with_rolling_friction(name: str, seed: int) -> None:
    problem = glued_rolling(np.random.default_rng(seed), 12)
    for tolerance in (1e-4, 1e-6, 1e-8):
        output = solvers.get(name).run(problem, Budget(tolerance=tolerance, seconds=10.0))
        error = judge(problem, output.point, tolerance).error
        assert error <= tolerance or output.claim is not Claim.SOLVED, f"{tolerance}: {error:.1e}"
        if name == "auto-rfc":
            assert output.claim is Claim.SOLVED, output.message


@pytest.mark.parametrize("dimension", [3, 5])
def test_the_error_of_a_part_with_rolling_friction_is_that_of_the_verdict(dimension: int) -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        problem, point = planted_contact.rfc(rng, int(rng.integers(1, 9)), dimension)
        assert point is not None
        r = point.r * (1.0 + 10.0 ** rng.uniform(-8, -1) * rng.standard_normal(point.r.size))
        expected = judge(problem, FCPoint(r), 1e-6).error
        assert compiled_error(problem, r) == pytest.approx(expected, rel=3e-3, abs=1e-13), seed


def test_parts_are_found_by_entries_that_are_not_0() -> None:
    W = np.kron(np.eye(3), np.eye(2) + 1.0)
    W[0, 4] = W[4, 0] = 0.5
    stored = sp.csr_array((W.ravel(), np.tile(np.arange(6), 6), np.arange(0, 37, 6)), shape=(6, 6))
    for matrix in (W, stored):
        problem = FrictionContact(W=matrix, q=np.ones(6), mu=np.ones(3), dimension=2)
        assert [list(part) for part in connected_parts(problem)] == [[0, 2], [1]]


def test_a_part_that_fails_is_named() -> None:
    problem = glued(np.random.default_rng(6), 5)
    output = solvers.get("nsgs").run(problem, Budget(tolerance=1e-12, iterations=2))
    assert output.claim is Claim.MAX_ITER
    assert "of 5 connected parts" in output.message
