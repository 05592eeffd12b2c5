"""Constants by which solvers of cpbench claim, each between two small problems: half of it and twice of it fail a
test."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from claims import compiled_error

from cpbench.formulations.contact import FCPoint
from cpbench.formulations.global_contact import GFCPoint, GlobalFrictionContact
from cpbench.formulations.linear import AVI, LCP, AVIPoint
from cpbench.formulations.local_contact import FrictionContact
from cpbench.solvers.base import Budget, Claim, solvers
from cpbench.verification import judge
from cpbench_solvers.avi.claims import NONE, rows_of
from cpbench_solvers.contact.parts import ContactParts
from cpbench_solvers.kernels import linear_error
from cpbench_solvers.lcp.claims import conclude


@pytest.mark.parametrize(("share", "taken"), [(0.99, True), (0.999, False)])
@pytest.mark.parametrize("name", ["admm-fc", "admm-gfc"])
def test_claims_end_just_before_the_tolerance(name: str, share: float, taken: bool) -> None:
    """`SURE`: a start is the answer as it is up to 0.995 of the tolerance, for the verdict is known to a thousandth.

    One contact carries 1; with r_N = 1 + x it opens with x of its free velocity 1."""
    law = {"mu": np.full(1, 0.1), "dimension": 3}
    free, r = np.array([-1.0, 0.0, 0.0]), np.array([1.0 + share * 1e-4, 0.0, 0.0])
    problem = FrictionContact(W=np.eye(3), q=free, **law)
    assert compiled_error(problem, r) == pytest.approx(share * 1e-4, rel=1e-9)
    start = FCPoint(r)
    if name == "admm-gfc":
        problem, start = GlobalFrictionContact(M=np.eye(3), H=np.eye(3), f=free, **law), GFCPoint(v=free + r, r=r)
    output = solvers.get(name).run(problem, Budget(tolerance=1e-4), start=start)
    assert output.claim is Claim.SOLVED
    assert isinstance(output.point, FCPoint | GFCPoint)
    assert np.array_equal(output.point.r, r) == taken
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


@pytest.mark.parametrize(("fast", "error"), [(0.8e4, 1e-3), (1.2e4, 1e-2 / 1.2e4)])
def test_a_contact_counts_by_its_own_free_velocity_from_a_share_of_the_largest(fast: float, error: float) -> None:
    """`SMALL`, `OWN`: a tenth of the miss 0.01 of a contact over its own 1, beside a contact that slides `fast`."""
    W = np.eye(6)
    W[0, 3] = W[3, 0] = 1e-9  # one part
    q = np.array([-1.0, 0.0, 0.0, 1.0, fast, 0.0])
    problem = FrictionContact(W=W, q=q, mu=np.zeros(2), dimension=3)
    r = np.array([1.01, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert judge(problem, FCPoint(r), 1e-6).error == pytest.approx(error, rel=0.01)
    assert compiled_error(problem, r) == pytest.approx(error, rel=0.01)


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
    error = linear_error.largest_error(rows_of(problem), point.z, NONE)
    assert error == pytest.approx(judge(problem, point, 1e-6).error, rel=0.01)
    assert (error < 1e-4) == counts
