"""`cpbench collection scene`: both forms of every step, bit for bit the same again, and what it refuses."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import cpbench

from cpbench import graph, storage
from cpbench.foundation import matrices
from cpbench.verification import judge

pytestmark = pytest.mark.needs("cpbench_solvers")

SPHERES = ("collection", "scene", "spheres", "--size", "6", "--steps", "4", "--seed", "3")


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("scene") / "spheres.h5"
    done = cpbench(file.parent, *SPHERES, "--mu", "0.25", "-o", str(file))
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.startswith("spheres: 4 steps of 0.005 s, 6 bodies, ")
    assert "solved by auto-gfc: all steps to 1e-06" in done.stdout
    return file


def test_the_twins_are_one_problem_with_its_answer(written: Path) -> None:
    addresses = storage.problem_files([written])
    assert [a.partition("::")[2] for a in addresses] == [f"{form}-{k:03d}" for form in ("fc", "gfc") for k in range(4)]
    for local, whole in zip(addresses[:4], addresses[4:], strict=True):
        one: Any = storage.load(local)
        other: Any = storage.load(whole)
        condensed: Any = graph.arrive(other, "fc").problem
        np.testing.assert_array_equal(matrices.dense(condensed.W), matrices.dense(one.W))
        np.testing.assert_array_equal(condensed.q, one.q)
        np.testing.assert_array_equal(one.mu, np.full(one.nc, 0.25))
        np.testing.assert_array_equal(one.contacts.id, other.contacts.id)
        for address, problem in ((local, one), (whole, other)):
            found = storage.solution(address)
            assert found is not None
            assert judge(problem, found[0], 1e-6).solved


def test_the_steps_are_two_sequences(written: Path) -> None:
    """Each step names the one before by its fingerprint, and the two forms have names of their own."""
    addresses = storage.problem_files([written])
    for form, name in ((addresses[:4], "spheres"), (addresses[4:], "spheres-global")):
        previous = ""
        for k, address in enumerate(form):
            problem: Any = storage.load(address)
            place = problem.sequence
            assert (place.name, place.step, place.dt, place.previous) == (name, k, 0.005, previous)
            assert place.time == pytest.approx(k * 0.005)
            previous = problem.fingerprint


def test_the_source_makes_the_same_file_again(written: Path, tmp_path: Path) -> None:
    source = storage.load(storage.problem_files([written])[0]).info.source
    again = tmp_path / "again.h5"
    done = cpbench(tmp_path, *source.removeprefix("cpbench ").split(), "-o", str(again))
    assert done.returncode == 0, done.stdout + done.stderr
    assert again.read_bytes() == written.read_bytes()
    other = tmp_path / "other.h5"
    assert cpbench(tmp_path, *SPHERES[:-1], "4", "-o", str(other)).returncode == 0
    assert other.read_bytes() != written.read_bytes()


def test_joints_and_rolling_friction_have_their_formulations(tmp_path: Path) -> None:
    for name, nodes in (("chain", {"fc", "gfc"}), ("rolling-heap", {"rfc", "grfc"})):
        file = tmp_path / f"{name}.h5"
        done = cpbench(tmp_path, "collection", "scene", name, "--size", "2", "--steps", "1", "-o", str(file))
        assert done.returncode == 0, done.stdout + done.stderr
        assert {storage.load(address).node for address in storage.problem_files([file])} == nodes


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (("towr",), "unknown scene 'towr': did you mean tower"),
        (("tower", "-s", "no-such"), "unknown solver 'no-such'"),
    ],
)
def test_what_makes_no_scene_is_refused_and_nothing_written(given: tuple[str, ...], said: str, tmp_path: Path) -> None:
    done = cpbench(tmp_path, "collection", "scene", *given, "--steps", "1", "-o", "s.h5")
    assert done.returncode == 2
    assert said in done.stdout + done.stderr
    assert not list(tmp_path.iterdir())
