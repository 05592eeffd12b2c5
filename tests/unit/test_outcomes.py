"""Known hard cases, run by the real runner: each has the right outcome."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from cpbench import graph, storage
from cpbench.bench.planning import plan
from cpbench.bench.results.rows import Outcome
from cpbench.bench.slot import Slot
from cpbench.conversions import make
from cpbench.errors import NoRoute
from cpbench.formulations import LCP

LIMITS = plan.Limits(seconds=20.0, repeats=1)


@pytest.fixture(scope="module")
def slot() -> Iterator[Slot]:
    with Slot() as slot:
        yield slot


def outcome(slot: Slot, address: Path, solver: str, tolerance: float = 1e-6) -> Outcome:
    asked = [plan.exact()]
    survey = slot.survey(str(address), asked)
    (pair,) = plan.pairs([survey], [plan.Entry(solver)], asked, tolerance, LIMITS)
    ended = slot.run(pair, slot.prepare(pair))
    if ended.status in ("solved", "wrong", "inaccurate"):
        assert ended.answer is not None
    return ended


@pytest.mark.needs("cpbench_solvers")
def test_infeasible(slot: Slot, tmp_path: Path) -> None:
    """Pang's isolated solution, perturbed: w₁ = −z₂ − z₃ − 1e-4 < 0. Lemke proves it, bpp through Lemke, and nobody
    claims to solve it."""
    path = tmp_path / "pang.h5"
    storage.save(LCP(M=np.array([[0.0, -1, -1], [1, 0, 0], [-1, 0, 1]]), q=[-1e-4, -1, 1]), path)
    for solver in ("lemke", "bpp"):
        assert outcome(slot, path, solver).status == "infeasible"
    row = outcome(slot, path, "newton-min")
    assert row.status in ("failed", "max_iter")
    assert row.claim != "solved"


@pytest.mark.needs("cpbench_solvers")
def test_singular_equality_block(slot: Slot, shared_data: Path) -> None:
    """diodeBridge: A has rank 2 of 3, so that no Schur complement exists; split, it is solved by Lemke."""
    path = shared_data / "mlcp" / "diodeBridge_mlcp.dat"
    row = outcome(slot, path, "lemke")
    assert (row.status, row.route) == ("solved", "mlcp-lcp-split")
    with pytest.raises(NoRoute, match="rank 2"):
        graph.arrive(storage.load(path), "lcp", via=[make("mlcp-lcp-schur")])


@pytest.mark.nightly
def test_nonsymmetric_delassus(slot: Slot, shared_data: Path) -> None:
    """Capsules-i125-1213: W is not symmetric; a Gauss–Seidel that symmetrises its blocks stalls at 4e-6.

    Here it does not. The contacts are 36 parts of very different loads, and the verdict measures each by itself: an
    answer that meets the tolerance in the energy of all need not be solved, but it is no further off than `inaccurate`.
    """
    path = shared_data / "fc3d_local" / "Capsules-i125-1213.hdf5"
    problem = storage.load(path)
    assert np.abs(problem.W - problem.W.T).max() > 1e-4 * np.abs(problem.W).max()
    row = outcome(slot, path, "nsgs", 1e-8)
    assert row.claim == "solved"
    assert json.loads(row.parts)["energy"] <= 1e-8
    assert row.status in ("solved", "inaccurate")
