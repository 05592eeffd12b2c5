"""The recorded scene: every step has its answer, obeys Newton's law from the step before, and its contacts keep ids."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from generated import instances

from cpbench import storage
from cpbench.cli.collection_command import generate
from cpbench.formulations.transfer import transfer
from cpbench.foundation import matrices
from cpbench.generators import generators
from cpbench.solvers import Budget, solvers
from cpbench.verification import judge
from cpbench_problems.generators.contact_sequence import DT, SPIN

LOCAL, GLOBAL = "contact-sequence", "contact-sequence-global"
SPHERES = 18


def test_every_step_has_its_answer() -> None:
    assert len(instances(LOCAL)) == len(instances(GLOBAL)) == 32
    for instance in (*instances(LOCAL), *instances(GLOBAL)):
        verdict = judge(instance.problem, instance.solution, 1e-13)
        assert verdict.solved, (instance.name, verdict)
        assert verdict.flags == ()


def test_contacts_come_go_and_keep_their_ids() -> None:
    came = went = jumped = 0
    for before, after in pairwise(instances(LOCAL)):
        old, new = before.problem.contacts, after.problem.contacts
        assert 10 <= after.problem.nc <= 40
        common, i, j = np.intersect1d(old.id, new.id, return_indices=True)
        came, went = came + len(new.id) - len(common), went + len(old.id) - len(common)
        np.testing.assert_array_equal(old.bodies[i], new.bodies[j])
        np.testing.assert_allclose(
            np.einsum("cik,cjk->cij", new.frame, new.frame), np.tile(np.eye(3), (len(new.id), 1, 1)), atol=1e-15
        )
        walls = old.bodies[i, 1] >= SPHERES
        turn = np.einsum("cik,cik->c", old.frame[i], new.frame[j])[walls]  # tr(F'Fᵀ) = 1 + 2 cos of the angle
        np.testing.assert_allclose(turn, 1 + 2 * np.cos(SPIN * DT), atol=1e-14)
        jumped += int((np.einsum("ck,ck->c", old.frame[i, 1], new.frame[j, 1])[~walls] < 0.9).sum())
    assert came >= 5
    assert went >= 5
    assert jumped >= 1, "no tangent of two spheres jumps: the scene does not test the turning of frames"
    states = [i.properties for i in instances(LOCAL)]
    assert all(0 < s["sliding"] < s["pushing"] < s["contacts"] for s in states)
    assert {bool(matrices.rank(i.problem.W) < 3 * i.problem.nc) for i in instances(LOCAL)[::31]} == {True}


def test_steps_are_chained() -> None:
    for steps in (instances(LOCAL), instances(GLOBAL)):
        assert len({i.problem.sequence.name for i in steps}) == 1
        for k, instance in enumerate(steps):
            place = instance.problem.sequence
            assert (instance.name, place.step, place.dt) == (f"step-{k:03d}", k, DT)
            assert place.previous == (steps[k - 1].problem.fingerprint if k else "")
            assert k == 0 or place.time - steps[k - 1].problem.sequence.time == DT
    assert instances(LOCAL)[0].problem.sequence.name != instances(GLOBAL)[0].problem.sequence.name


def test_written_as_a_pack_and_read_again(tmp_path: Path) -> None:
    run = CliRunner().invoke(generate, [str(tmp_path), "--family", "contact-sequence"])
    assert run.exit_code == 0, run.output
    pack = tmp_path / "fc" / "contact-sequence.h5"
    assert storage.problem_files([pack]) == [f"{pack}::step-{k:03d}" for k in range(32)]
    for k in (0, 31):
        problem = storage.load(f"{pack}::step-{k:03d}")
        assert problem.fingerprint == instances(LOCAL)[k].problem.fingerprint
        assert problem.sequence == instances(LOCAL)[k].problem.sequence
        for part in ("id", "bodies", "position", "frame"):
            np.testing.assert_array_equal(
                getattr(problem.contacts, part), getattr(instances(LOCAL)[k].problem.contacts, part)
            )
        found = storage.solution(f"{pack}::step-{k:03d}")
        assert found is not None
        np.testing.assert_array_equal(found[0].r, instances(LOCAL)[k].solution.r)


def test_the_scene_is_not_shipped(tmp_path: Path) -> None:
    assert not generators.get("contact-sequence").builtin
    refused = CliRunner().invoke(generate, ["--family", "contact-sequence"])
    assert refused.exit_code == 2
    assert "needs a FOLDER" in refused.output


@pytest.mark.needs("cpbench_solvers")
def test_warm_starts_save_sweeps() -> None:
    """nsgs from its own last answer against nsgs from 0, step by step."""
    nsgs, budget = solvers.get("nsgs"), Budget(tolerance=1e-6)
    last, saved = None, 0
    warm_sweeps = cold_sweeps = 0
    for instance in instances(LOCAL):
        problem = instance.problem
        start = None if last is None else transfer(last[0], last[1], problem).point
        warm, cold = nsgs.run(problem, budget, start=start), nsgs.run(problem, budget)
        for output in (warm, cold):
            assert judge(problem, output.point, 1e-6).solved
        last = problem.contacts, warm.point
        warm_sweeps, cold_sweeps = warm_sweeps + warm.counters["iterations"], cold_sweeps + cold.counters["iterations"]
        saved += warm.counters["iterations"] < cold.counters["iterations"]
    assert warm_sweeps < 0.9 * cold_sweeps
    assert saved >= 20
