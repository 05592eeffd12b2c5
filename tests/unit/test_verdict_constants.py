"""Constants of the verdict, each between two small problems by hand: half of it and twice of it fail a test."""

from __future__ import annotations

import numpy as np
import pytest
from planted_nonlinear import graph

from cpbench.formulations import LCP, QP, FrictionContact, MiCP, QPPoint
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.linear import LCPPoint
from cpbench.formulations.nonlinear import MiCPPoint
from cpbench.verification import Verdict, judge
from cpbench.verification.equilibration import equilibrate_apart
from cpbench.verification.sets import Sets
from cpbench.verification.status import Status, status


@pytest.mark.parametrize(("share", "counts"), [(0.06, False), (0.15, True)])
def test_an_idle_constant_counts_from_a_tenth(share: float, counts: bool) -> None:
    """z = (1, 0, 0) has w = (0, 100 + t, −1e-3): the third row is missed by 1e-3, the second is idle with q = 100.

    Without q the sizes of the rows are 1, t and 1, so that the third misses by 1e-3/√t to 1e-3 of them; with q the
    second has the size 100, and the share is at most 1e-3 √t/100.
    """
    t = 100.0 * share
    problem = LCP(M=np.array([[1.0, 1.0, 1.0], [t, 1.0, 1.0], [1.0, 1.0, 1.0]]), q=np.array([-1.0, 100.0, -1.001]))
    error = judge(problem, LCPPoint(z=np.array([1.0, 0.0, 0.0])), 1e-6).error
    assert (error < 1e-4) == counts
    assert (error > 2e-4) != counts


def _two_contacts(share: float, missed: float, *, joined: bool) -> float:
    """Return the error of a contact that closes at `share`, off by `missed` of that, beside a right one that closes at
    1; where they are joined, each reaction moves the other by half of `share`."""
    W, r = np.eye(4), np.array([1.0, 0.0, share, 0.0])
    if joined:
        W[0, 2] = W[2, 0] = r[2] = share / 2.0
    problem = FrictionContact(W=W, q=-W @ r, mu=np.ones(2), dimension=2)
    return judge(problem, FCPoint(r=r - missed * share * np.eye(4)[2]), 1e-6).error


def test_a_contact_that_bears_others_counts_by_its_reaction() -> None:
    """Its free velocity is 1e-3, for the other one presses it: of r/ρ = 0.5 it misses 2e-5, of the largest 1.3e-5."""
    W, r = np.kron(np.array([[1.0, -0.5], [-0.5, 1.0]]), np.eye(2)), np.array([1.0, 0.0, 0.501, 0.0])
    problem = FrictionContact(W=W, q=-W @ r, mu=np.ones(2), dimension=2)
    assert abs(problem.q[2]) < 2e-3
    assert judge(problem, FCPoint(r=r + 1e-5 * np.eye(4)[2]), 1e-6).error < 2e-5


def test_a_contact_counts_by_a_tenth_of_its_own_free_velocity() -> None:
    """A free velocity of 1e-3 is missed by 1e-4 of it: a tenth of that is 1e-5, and the share of the largest 1e-7."""
    assert 7e-6 < _two_contacts(1e-3, 1e-4, joined=True) < 1.4e-5


@pytest.mark.parametrize(("share", "counts"), [(7e-5, False), (1.5e-4, True)])
def test_a_contact_counts_by_its_own_free_velocity_from_1e4_of_the_largest(share: float, counts: bool) -> None:
    """Half of the free velocity is missed: a tenth of that is 0.05, and the share of the largest less than 1e-4."""
    assert (_two_contacts(share, 0.5, joined=True) > 1e-2) == counts


@pytest.mark.parametrize(("bits", "moves"), [(39.5, True), (40.5, False)])
def test_a_part_moves_from_2_to_the_minus_40_of_the_fastest(bits: float, moves: bool) -> None:
    """Nothing holds a contact that closes at 2^-bits, coupled to none: an error of 1 of what moves, else of 2^-bits."""
    assert (_two_contacts(2.0**-bits, 1.0, joined=False) > 0.5) == moves


@pytest.mark.parametrize(("stress", "unknown"), [(3e8, False), (8e8, True)])
def test_eight_roundings_of_the_terms_decide_whether_velocities_are_known(stress: float, unknown: bool) -> None:
    """A contact that closes at 1 between two walls that press with any force on a body: u is right to the last bit.

    Terms of the walls add up to 2 stress; 8 roundings of that are 1.07e-6 and 2.8e-6, the tolerance is 2e-6.
    """
    h = np.array([[1.0, 0.0, -1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 1.0, 0.0]])
    problem = FrictionContact(W=h.T @ h, q=np.array([0.0, 0, 0, 0, -1, 0]), mu=np.full(3, 0.5), dimension=2)
    verdict = judge(problem, FCPoint(r=np.array([stress, 0, stress, 0, 1, 0])), 2e-6)
    assert verdict.error == 0.0
    assert ("unresolvable" in verdict.flags) == unknown


def _error_below_a_bound(bound: float, share: float) -> float:
    """Return the error of z = (10, (1 − share) bound), where (10, bound) minimizes a program with z₂ ≥ bound.

    Both rows of Q are 1 on average, so that the largest unknown is 10, and the price of the bound is small.
    """
    Q, z = np.array([[1.0, 1e-2], [1e-2, 1.0]]), np.array([10.0, bound])
    problem = QP.build(Q, np.array([0.0, 1e-3]) - Q @ z, lb=np.array([-np.inf, bound]))
    z[1] -= share * bound
    none = np.zeros(0)
    return judge(problem, QPPoint(z=z, lam=none, mu=none, nu=np.array([0.0, (Q @ z + problem.p)[1]])), 1e-6).error


def test_a_bound_counts_by_a_tenth_of_its_own_terms() -> None:
    """The bound 0.1 is missed by 1e-5, which is 5e-5 of |z₂| + 0.1 and 1e-6 of the largest unknown."""
    assert 4e-6 < _error_below_a_bound(0.1, 1e-4) < 6e-6


@pytest.mark.parametrize(("bound", "counts"), [(3.5e-5, False), (7.5e-5, True)])
def test_a_bound_counts_by_its_own_terms_from_1e5_of_the_largest(bound: float, counts: bool) -> None:
    """Half of the bound is missed, a third of its terms, which are 5e-6 and 1.1e-5 of the largest."""
    assert (_error_below_a_bound(bound, 0.5) > 1e-3) == counts


@pytest.mark.parametrize(("z", "at_bound"), [(1.4, True), (1.6, False)])
def test_an_unknown_is_at_its_bound_within_half_of_it(z: float, at_bound: bool) -> None:
    """z ≥ 1 beside w = z²: only the bound gives a size, where z is at it, |z − 1| ≤ ½."""
    problem = MiCP(F=graph(1, lambda z: z**2), lb=[1.0], ub=[np.inf], start=np.ones(1))
    verdict = judge(problem, MiCPPoint(z=np.array([z])), 1e-6)
    assert ("absolute" not in verdict.flags) == at_bound


@pytest.mark.parametrize(("bound", "finite"), [(7e18, True), (1.5e19, False)])
def test_bounds_from_1e19_on_are_none(bound: float, finite: bool) -> None:
    box = Sets.of((1, -bound, bound))
    assert bool(np.isfinite(box.lb).all()) == bool(np.isfinite(box.ub).all()) == finite


@pytest.mark.parametrize(("degrees", "flagged"), [(3.0, False), (7.0, True)])
def test_a_direction_off_by_5_degrees_is_flagged(degrees: float, flagged: bool) -> None:
    """One contact slides with u_T = (−1, 0); its r_T of ½ is turned by the angle from (1, 0)."""
    angle = np.radians(degrees)
    r, u = np.array([1.0, 0.5 * np.cos(angle), 0.5 * np.sin(angle)]), np.array([0.0, -1.0, 0.0])
    problem = FrictionContact(W=np.eye(3), q=u - r, mu=np.array([0.5]))
    verdict = judge(problem, FCPoint(r=r), 0.5)
    assert verdict.within
    assert ("direction" in verdict.flags) == flagged


@pytest.mark.parametrize(("error", "expected"), [(7e-5, Status.INACCURATE), (1.5e-4, Status.WRONG)])
def test_a_claim_is_wrong_beyond_a_hundred_tolerances(error: float, expected: Status) -> None:
    assert status(Verdict(1e-6, False, error), "solved") == expected


def test_slow_sweeps_end_as_near_to_the_limit_as_fast_ones() -> None:
    """How far log D is from its limit, in the median of 60 matrices: 1.2e-3, where rows are off by 1e-4 at the end."""
    found = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        n = int(rng.integers(8, 30))
        A = (np.eye(n) + np.eye(n, k=1) + (rng.random((n, n)) < 0.1)) * np.abs(rng.standard_normal((n, n)))
        D, C = equilibrate_apart(A)
        pattern, right = A > 0, D.copy()
        for _ in range(2000):
            right = pattern.sum(axis=1) / (A @ C)
            C = pattern.sum(axis=0) / (right @ A)
        found.append(np.ptp(np.log(D / right)))
    assert np.median(found) < 2e-3
