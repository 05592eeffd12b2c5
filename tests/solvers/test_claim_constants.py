"""Constants by which solvers of cpbench claim, each between two small problems: half of it and twice of it fail a
test."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from cpbench.formulations.avi import AVI, AVIPoint
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.fc import FrictionContact
from cpbench.formulations.gfc import GlobalFrictionContact
from cpbench.formulations.global_contact import GFCPoint
from cpbench.formulations.lcp import LCP
from cpbench.foundation.kernel_cache import load
from cpbench.solvers.base import Budget, Claim, solvers
from cpbench.testing import planted_contact
from cpbench.verification import judge
from cpbench_solvers.avi.claims import NONE, rows_of
from cpbench_solvers.contact.dynamics_error import DynamicsError
from cpbench_solvers.contact.parts import ContactParts, worst_part
from cpbench_solvers.lcp.claims import conclude


def sliding() -> tuple[FrictionContact, np.ndarray]:
    """One contact that carries 1, and one that slides a thousand times as fast: its velocity is in norms, not in the
    error. With r_N = 1 + x the error is x/((1 + x)√3)."""
    W = np.eye(6)
    W[0, 3] = W[3, 0] = 1e-3
    q = np.array([-1.0, 0.0, 0.0, -1e-3, 1e3, 0.0])
    return FrictionContact(W=W, q=q, mu=np.full(2, 0.1), dimension=3), np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize(("share", "taken"), [(0.98, True), (1.01, False)])
def test_claims_end_just_before_the_tolerance(share: float, taken: bool) -> None:
    """`SURE`: a start is the answer as it is up to 0.995 of the tolerance, for the verdict is known to a thousandth."""
    problem, right = sliding()
    error = share * 1e-4 * np.sqrt(3.0)
    start = FCPoint(right * (1.0 / (1.0 - error)))
    assert worst_part(problem, start.r) == pytest.approx(share * 1e-4, rel=2e-3)
    output = solvers.get("admm-fc").run(problem, Budget(tolerance=1e-4), start=start)
    assert output.claim is Claim.SOLVED
    assert isinstance(output.point, FCPoint)
    assert np.array_equal(output.point.r, start.r) == taken
    assert judge(problem, output.point, 1e-4).error <= 1e-4


@pytest.mark.parametrize(("contacts", "full"), [(33, True), (34, False)])
def test_parts_of_a_hundred_rows_are_full_matrices(contacts: int, full: bool) -> None:
    """`DENSE`, of a sparse problem of two chains."""
    d = sp.diags_array([-np.ones(contacts - 1), 3.0 * np.ones(contacts), -np.ones(contacts - 1)], offsets=[-1, 0, 1])
    W = sp.csr_array(sp.block_diag([sp.kron(d, np.eye(3))] * 2, format="csr"))
    problem = FrictionContact(W=W, q=-np.ones(W.shape[0]), mu=np.full(2 * contacts, 0.5), dimension=3)
    parts = solvers.get("nsgs").setup(problem, Budget(), solvers.get("nsgs").spec.options())
    assert isinstance(parts, ContactParts)
    assert isinstance(parts[0].problem.W, np.ndarray) == full


@pytest.mark.parametrize(("share", "error"), [(0.06, 5.506e-4), (0.15, 1.091e-4)])
def test_free_velocities_of_parts_count_from_a_tenth(share: float, error: float) -> None:
    """`BALANCED`: the velocity 9 of a sliding contact gives a size where the other terms reach that share of it."""
    W = np.eye(6)
    W[0, 4] = W[4, 0] = share * 9.0
    q = np.array([-1.0, 0.0, 0.0, 0.0, 9.0, 0.0])
    problem = FrictionContact(W=W, q=q, mu=np.zeros(2), dimension=3)
    r = np.array([1.001, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert judge(problem, FCPoint(r), 1e-6).error == pytest.approx(error, rel=0.01)
    assert worst_part(problem, r) == pytest.approx(error, rel=0.01)


@pytest.mark.parametrize(("share", "least", "most"), [(0.06, 1e-3, 2e-3), (0.15, 4e-3, 1e-2)])
def test_free_velocities_of_bodies_count_from_a_tenth(share: float, least: float, most: float) -> None:
    """`HEARD`: the same of a global problem, where the constant 9 is that of an idle row."""
    M = np.eye(6)
    M[0, 3] = M[3, 0] = 1e-3
    w, f = np.array([0.0, 0.0, 0.0, 0.0, 9.0, 0.0]), np.array([-1.0, 0.0, 0.0, 0.0, 9.0 * share, 0.0])
    problem = GlobalFrictionContact(M=M, H=np.eye(6), f=f, w=w, mu=np.zeros(2), dimension=3)
    r = np.array([1.01, 0.0, 0.0, 0.0, 0.0, 0.0])
    point = GFCPoint(v=np.linalg.solve(M, r + f), r=r)
    assert least < DynamicsError.of(problem)(point) < most
    assert judge(problem, point, 1e-6).error < DynamicsError.of(problem)(point)


def test_errors_of_bodies_allow_for_their_units() -> None:
    """`UNCERTAIN`: no error of a part is less than that of the verdict; the least is about 1.3 times it."""
    least = np.inf
    for seed in range(30):
        rng = np.random.default_rng(seed)
        problem, point = planted_contact.gfc(rng, int(rng.integers(1, 5)), 4, int(rng.integers(0, 3)), 3)
        assert point is not None
        size = 10.0 ** rng.uniform(-8, -2)
        off = {name: a * (1.0 + size * rng.standard_normal(a.size)) for name, a in point.arrays().items()}
        moved = GFCPoint(**off)
        error = DynamicsError.of(problem)(moved)
        if problem.residuals(moved).error < error:
            least = min(least, error / judge(problem, moved, 1e-6).error)
    assert 1.1 < least < 2.0


@pytest.mark.parametrize(("share", "counts"), [(0.75, False), (1.5, True)])
def test_growth_of_bodies_begins_beyond_16_roundings(share: float, counts: bool) -> None:
    """`ROUNDING`: two velocities of 2³⁰ whose difference closes a contact without friction by a share of 2⁻¹⁷, 16 eps
    of their sum, where its drift is 2⁻¹⁸."""
    H = np.array([[1.0, 2.0**-10], [-1.0, 0.0]])
    v = np.array([2.0**30, 2.0**30 + (0.5 + share) * 2.0**-17])
    w = np.array([2.0**-18, 0.0])
    problem = GlobalFrictionContact(M=np.eye(2), H=H, f=v, w=w, mu=np.zeros(1), dimension=2)
    error = DynamicsError.of(problem)(GFCPoint(v=v, r=np.zeros(2)))
    assert (error > 0.1) == counts
    assert (error > 1e-10) == counts


@pytest.mark.parametrize(("times", "claim"), [(60.0, Claim.INACCURATE), (150.0, Claim.FAILED)])
def test_answers_are_inaccurate_up_to_a_hundred_times_the_tolerance(times: float, claim: Claim) -> None:
    """`CLOSE`: z = 1 + e of z − 1 = 0 has the error e/(1 + e)."""
    problem = LCP(M=np.eye(1), q=-np.ones(1))
    output = conclude(problem, np.array([1.0 + times * 1e-6]), Budget(tolerance=1e-6), {})
    assert output.claim is claim


@pytest.mark.parametrize(("share", "counts"), [(0.06, False), (0.15, True)])
def test_idle_constants_of_box_problems_count_from_a_tenth(share: float, counts: bool) -> None:
    """`BALANCED` of the rows of affine inequalities: the problem by which the verdict's own is pinned."""
    t = 100.0 * share
    M = np.array([[1.0, 1.0, 1.0], [t, 1.0, 1.0], [1.0, 1.0, 1.0]])
    problem = AVI(M=M, q=np.array([-1.0, 100.0, -1.001]), lb=np.zeros(3))
    point = AVIPoint(np.array([1.0, 0.0, 0.0]))
    error = load("cpbench_solvers.kernels.linear_error").largest_error(rows_of(problem), point.z, NONE)
    assert error == pytest.approx(judge(problem, point, 1e-6).error, rel=0.01)
    assert (error < 1e-4) == counts
