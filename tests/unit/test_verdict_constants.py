"""Constants of the verdict, each between two small problems by hand: half of it and twice of it fail a test."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from cpbench.formulations import LCP, MLCP, QP, FrictionContact, MLCPPoint, QPPoint, Relay
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.lcp import LCPPoint
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


@pytest.mark.parametrize(("bits", "missed", "unknown"), [(45, 0.125, True), (44, 0.0625, False), (44, 0.125, False)])
def test_rounding_of_a_tenth_of_a_constant_hides_it(bits: int, missed: float, unknown: bool) -> None:
    """z₁ − z₂ − 1 and z₂ − z₁ + 1 with z₁ = 2ᵇ: the terms add up to 2 · 2ᵇ, whose 8 roundings are 2^(b − 48).

    They are an eighth of the constants 1 for b = 45, a sixteenth for b = 44; the rows are off by `missed`, a multiple
    of the last place of z.
    """
    problem = LCP(M=np.array([[1.0, -1.0], [-1.0, 1.0]]), q=np.array([-1.0, 1.0]))
    z = np.array([2.0**bits, 2.0**bits - 1.0 + missed])
    verdict = judge(problem, LCPPoint(z=z), 1e-6)
    assert ("unresolvable" in verdict.flags) == unknown


def _error_below_a_bound(bound: float, share: float) -> float:
    """Return the error of z = (10, (1 − share) bound), where (10, bound) minimizes a program with z₂ ≥ bound.

    Both rows of Q are 1 on average, so that the size of the part is 10, and the price of the bound is small.
    """
    Q, z = np.array([[1.0, 1e-2], [1e-2, 1.0]]), np.array([10.0, bound])
    problem = QP.build(Q, np.array([0.0, 1e-3]) - Q @ z, lb=np.array([-np.inf, bound]))
    z[1] -= share * bound
    none = np.zeros(0)
    return judge(problem, QPPoint(z=z, lam=none, mu=none, nu=np.array([0.0, (Q @ z + problem.p)[1]])), 1e-6).error


def test_a_bound_counts_by_a_tenth_of_its_own_terms() -> None:
    """The bound 0.1 is missed by 1e-5, which is 5e-5 of |z₂| + 0.1 and 1e-6 of the part."""
    assert 4e-6 < _error_below_a_bound(0.1, 1e-4) < 6e-6


@pytest.mark.parametrize(("bound", "counts"), [(3.5e-5, False), (7.5e-5, True)])
def test_a_bound_counts_by_its_own_terms_from_1e5_of_the_largest(bound: float, counts: bool) -> None:
    """Half of the bound is missed, a third of its terms, which are 5e-6 and 1.1e-5 of the part."""
    assert (_error_below_a_bound(bound, 0.5) > 1e-3) == counts


@pytest.mark.parametrize(("z", "at_bound"), [(1.4, True), (1.6, False)])
def test_an_unknown_is_at_its_bound_within_half_of_it(z: float, at_bound: bool) -> None:
    """z ≥ 1 beside w = z (1e20 is no bound): only the bound gives a size, where z is at it, |z − 1| ≤ ½."""
    problem = Relay(M=np.eye(1), q=np.zeros(1), lb=np.ones(1), ub=np.full(1, 1e20))
    verdict = judge(problem, LCPPoint(z=np.array([z])), 1e-6)
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


@pytest.mark.parametrize(("velocity", "flagged"), [(0.07, False), (0.15, True)])
def test_a_loaded_contact_that_misses_its_law_by_a_tenth_is_flagged(velocity: float, flagged: bool) -> None:
    """r = 1 and u > 0 without friction, W = 1: r − P(r − u) = u, a share u of the contact's own r = 1."""
    problem = FrictionContact(W=np.eye(2), q=np.array([velocity - 1.0, 0.0]), mu=np.zeros(1), dimension=2)
    verdict = judge(problem, FCPoint(r=np.array([1.0, 0.0])), 0.5)
    assert verdict.within
    assert ("contact" in verdict.flags) == flagged


@pytest.mark.parametrize(("error", "expected"), [(7e-5, Status.INACCURATE), (1.5e-4, Status.WRONG)])
def test_a_claim_is_wrong_beyond_a_hundred_tolerances(error: float, expected: Status) -> None:
    assert status(Verdict(1e-6, False, error), "solved") == expected


def test_means_of_rows_are_right_to_a_twentieth_of_a_percent() -> None:
    """What rows are off by at the end, in the root mean square over the entries, of 40 matrices over eight decades.

    Sizes are compared by these units, so that an error of 5e-4 of them is one of 5e-4 of a verdict's number, which has
    to be right to 1e-2 (`tests/truth/test_page.py`). More digits would cost further sweeps.
    """
    worst = 0.0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        A = sp.random_array((30, 30), density=0.2, rng=rng).toarray() + np.diag(rng.uniform(0.5, 2.0, 30))
        A *= 10.0 ** rng.uniform(-4, 4, A.shape)
        D, C = equilibrate_apart(A)
        counts = (A > 0).sum(axis=1)
        off = (D[:, None] * A * C).sum(axis=1) - counts
        worst = max(worst, float(np.sqrt((off**2 / counts).sum() / counts.sum())))
    assert 3e-4 < worst < 6e-4


def test_slow_sweeps_end_as_near_to_the_limit_as_fast_ones() -> None:
    """How far log D is from its limit, in the median of 60 matrices: 6e-4, and 1.9e-3 without SLOWEST."""
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
    assert np.median(found) < 1.2e-3


@pytest.mark.parametrize(("v", "solved"), [(1.2e-14, True), (2e-14, False)])
def test_equalities_have_at_least_root_eps_of_the_size_of_others(v: float, solved: bool) -> None:
    """u + v ≥ 1 beside −v = 0, of which nothing is left but rounding of v = 0: its size is √eps = 1.5e-8 of u."""
    one = np.ones((1, 1))
    problem = MLCP(A=0.0 * one, B=one, C=-one, D=one, a=np.zeros(1), b=-np.ones(1))
    assert judge(problem, MLCPPoint(u=np.ones(1), v=np.array([v])), 1e-6).solved == solved
