"""What solvers of Siconos say that is not so, and how some of them end, as the real runner shows it."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from one_row import row_of

from cpbench import storage
from cpbench.bench.slot import Slot
from cpbench.formulations import LCP, MLCP, FrictionContact
from cpbench.testing import planted

SADDLE = LCP(M=[[11.0, 0, 10, -1], [0, 11, 10, -1], [10, 10, 21, -1], [1, 1, 1, 0]], q=[50.0, 50, 10, -6])
"""Cottle, Pang and Stone: z = (2, 2, 2, 92); lcp_CPS_4 of Siconos' own tests."""
THREE_CONTACTS = FrictionContact(W=np.eye(9), q=np.tile([-1.0, 1, 3], 3), mu=np.full(3, 0.1), dimension=3)
"""Every contact slides: r = (1, −μ/√10, −3μ/√10), for u_T stays parallel to (1, 3)."""


@pytest.fixture(scope="module")
def slot() -> Iterator[Slot]:
    with Slot() as slot:
        yield slot


@pytest.mark.nightly
def test_the_relaxation_that_is_listed_among_the_solvers_of_the_law(slot: Slot, tmp_path: Path) -> None:
    """SICONOS_FRICTION_3D_SOCLCP drops the De Saxcé term: info 0, own error 1e-8, and the contacts lift off."""
    row = row_of(slot, THREE_CONTACTS, "siconos-fc3d-soclcp", tmp_path)
    assert (row.status, row.claim) == ("wrong", "solved")
    assert row.message.startswith("info 0")
    assert row.error > 0.01
    assert row_of(slot, THREE_CONTACTS, "siconos-fc3d-nsgs", tmp_path).status == "solved"


@pytest.mark.nightly
def test_lemke_in_the_plane_compares_its_error_with_a_number_of_pivots(slot: Slot, tmp_path: Path) -> None:
    """SICONOS_FRICTION_2D_LEMKE: info 0 whatever it found, for its error is tested against iparam[0]."""
    problem, _ = planted.fc(np.random.default_rng(0), 5, 2, "positive definite")
    row = row_of(slot, problem, "siconos-fc2d-lemke", tmp_path)
    assert (row.status, row.claim) == ("wrong", "solved")
    assert row.error > 0.01  # 10⁴ times the tolerance
    assert row_of(slot, problem, "siconos-fc2d-nsgs", tmp_path).status == "solved"


@pytest.mark.nightly
def test_newton_on_a_singular_jacobian_passes_a_test_of_nan(slot: Slot, tmp_path: Path) -> None:
    """SICONOS_LCP_NEWTONMIN: NaN is not greater than the tolerance, hence info 0."""
    row = row_of(slot, SADDLE, "siconos-lcp-newtonmin", tmp_path)
    assert (row.status, row.claim, row.error) == ("wrong", "solved", np.inf)
    assert row.message.endswith("nan")
    assert row_of(slot, SADDLE, "siconos-lcp-lemke", tmp_path).status == "solved"


def test_relaxed_sweeps_overflow_into_a_success(slot: Slot, tmp_path: Path, shared_data: Path) -> None:
    """SICONOS_MLCP_RPGS on diodeBridge: NaN and info 0."""
    problem = storage.load(shared_data / "mlcp" / "diodeBridge_mlcp.dat")
    row = row_of(slot, problem, "siconos-mlcp-rpgs", tmp_path)
    assert (row.status, row.claim, row.error) == ("wrong", "solved", np.inf)
    assert row_of(slot, problem, "siconos-mlcp-enum", tmp_path).status == "solved"


@pytest.mark.nightly
def test_relaxed_sweeps_overflow_on_a_definite_problem_too(slot: Slot, tmp_path: Path) -> None:
    """SICONOS_MLCP_RPSOR with ω = 2 and ρ = 0.5, its defaults."""
    problem, _ = planted.mlcp(np.random.default_rng(1), 6, 8, "positive definite")
    row = row_of(slot, problem, "siconos-mlcp-rpsor", tmp_path)
    assert (row.status, row.claim, row.error) == ("wrong", "solved", np.inf)


@pytest.mark.nightly
def test_a_solver_that_exits_leaves_the_worker_usable(slot: Slot, tmp_path: Path) -> None:
    """SICONOS_FRICTION_3D_NSGSV calls exit(1); the next solve of the same worker has another process."""
    for _ in range(2):
        row = row_of(slot, THREE_CONTACTS, "siconos-fc3d-nsgsv", tmp_path)
        assert (row.status, row.code) == ("crash", 1)
        assert row.claim is None
        (tmp_path / "siconos-fc3d-nsgsv.h5").unlink()


@pytest.mark.nightly
def test_an_assertion_is_a_signal(slot: Slot, tmp_path: Path) -> None:
    """SICONOS_FRICTION_3D_NSGS asserts W_ii > 0; SICONOS_MLCP_LCP_LEMKE an LCP in its MLCP. Both abort."""
    backwards = FrictionContact(W=np.diag([-1.0, 1, 1]), q=[-1.0, 1, 0], mu=[0.5], dimension=3)
    row = row_of(slot, backwards, "siconos-fc3d-nsgs", tmp_path)
    assert (row.status, row.signal) == ("crash", signal.SIGABRT)
    equalities = MLCP(A=np.eye(2), B=np.zeros((0, 0)), C=np.zeros((2, 0)), D=np.zeros((0, 2)), a=[1.0, 2], b=[])
    row = row_of(slot, equalities, "siconos-mlcp-lcp-lemke", tmp_path)
    assert (row.status, row.signal) == ("crash", signal.SIGABRT)
