"""Recorded sequences: a run follows them, and a run that cannot follow says so."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import exit_code

import cpbench
from cpbench import storage
from cpbench.bench.results.store import Store
from cpbench.errors import ProblemError
from cpbench.formulations import LCP, FrictionContact

IDS = ([4, 5], [4, 5, 6], [5, 6], [6, 9, 5])
"""Contacts come and go; every one has a load of its own, so that no two of them have the same reaction."""


def problem(ids: list[int]) -> FrictionContact:
    """Contacts without coupling: r_N = id, r_T = 0 solves each, for W = I and q = −(id, 0, 0)."""
    q = np.concatenate([[-float(i), 0.0, 0.0] for i in ids])
    return FrictionContact(W=np.eye(3 * len(ids)), q=q, mu=np.full(len(ids), 0.5))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def record(name: str, **known: Sequence[Any]) -> None:
    """Write the four steps to NAME.h5, with what is known of the contacts of each."""
    recorder = cpbench.Recorder(name, dt=0.01)
    for k, ids in enumerate(IDS):
        recorder.add(problem(ids), **{what: values[k] for what, values in known.items()})
    recorder.save(f"{name}.h5")


def packed(path: Path) -> list[FrictionContact]:
    return [storage.load(address) for address in storage.problem_files([str(path)])]  # type: ignore[misc]


def started(path: Path) -> list[str]:
    with Store(path) as store:
        rows = sorted(store.rows(), key=lambda row: (row.start, row.step or 0))
        return [str(row.started) for row in rows]


@pytest.mark.nightly
def test_a_run_follows_ids_or_nothing_and_says_so(monkeypatch, capsys, folder) -> None:
    """The first step and those without a match are cold; the terminal, the row and the report say it."""
    record("ids", ids=IDS)
    record("none")
    follow = ["-s", "nsgs", "--start", "previous", "--repeats", 1, "-q"]
    for name in ("ids", "none"):
        assert exit_code(monkeypatch, "run", f"{name}.h5", *follow, "-o", f"{name}.sqlite") == 0
    out = capsys.readouterr().out
    assert started(folder / "ids.sqlite") == ["cold: first step", *["previous"] * 3]
    told = started(folder / "none.sqlite")
    assert told[1] == "cold: 2 contacts before, 3 now, and no ids to match them by"
    assert "start previous: 3 of 4 rows started so; 1 cold: first step" in out
    line = "start previous: 0 of 4 rows started so; 3 cold: 2 contacts before, 3 now, and no ids to match them by"
    assert f"{line} (and alike); 1 cold: first step" in out
    assert line in "".join((folder / "reports" / "none" / "report.md").read_text().splitlines()[:12])
    assert line in (folder / "reports" / "none" / "report.html").read_text()


@pytest.mark.needs("cpbench_solvers")
def test_problems_of_no_sequence_do_not_start_from_a_step_before(monkeypatch, capsys, folder) -> None:
    """They have no place in one."""
    (folder / "cases").mkdir()
    for k, ids in enumerate(IDS):
        storage.save(problem(ids), folder / "cases" / f"s{k}.h5")
    follow = ["-s", "nsgs", "--start", "previous", "--repeats", 1, "-q"]
    assert exit_code(monkeypatch, "run", "cases", *follow, "-o", "cases.sqlite", "--no-report") == 0
    out = capsys.readouterr().out
    assert "0 of 4 rows started so; 4 unsupported: start previous: the problem is no step of a sequence" in out


def test_a_recorder_writes_steps_that_know_their_place(folder: Path) -> None:
    record("scene", ids=IDS)
    found = packed(folder / "scene.h5")
    assert [step.fingerprint for step in found] == [problem(ids).fingerprint for ids in IDS]
    for k, (step, ids) in enumerate(zip(found, IDS, strict=True)):
        assert step.sequence is not None
        assert step.contacts is not None
        assert (step.sequence.name, step.sequence.step, step.sequence.dt) == ("scene", k, 0.01)
        assert step.sequence.time == pytest.approx(0.01 * k)
        assert step.sequence.previous == (found[k - 1].fingerprint if k else "")
        assert step.contacts.id.tolist() == ids


def test_a_recorder_refuses_what_is_no_step() -> None:
    recorder = cpbench.Recorder("scene", dt=0.01)
    with pytest.raises(ProblemError, match="has no steps"):
        recorder.save("never.h5")
    with pytest.raises(ProblemError, match="contact problems"):
        recorder.add(LCP(M=np.eye(1), q=[1.0]))  # type: ignore[arg-type]
    recorder.add(problem([1, 2]), ids=[1, 2])
    with pytest.raises(ProblemError, match="one number twice"):
        recorder.add(problem([1, 2]), ids=[1, 1])
    with pytest.raises(ProblemError, match="the step before at 0 s"):
        recorder.add(problem([1, 2]), ids=[1, 2], time=0.0)
    plane = FrictionContact(W=np.eye(2), q=[1.0, 0.0], mu=[0.5], dimension=2)
    with pytest.raises(ProblemError, match="2 rows a contact"):
        recorder.add(plane)
    with pytest.raises(ProblemError, match="above 0"):
        cpbench.Recorder("scene", dt=0.0)
