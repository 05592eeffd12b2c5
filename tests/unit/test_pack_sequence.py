"""Sequences from loose files: what is packed is followed by a run, and a run that cannot follow says so."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import cpbench
from cpbench import storage
from cpbench.bench.results.store import Store
from cpbench.cli import main
from cpbench.errors import ProblemError
from cpbench.formulations import LCP, FrictionContact

IDS = ([4, 5], [4, 5, 6], [5, 6], [6, 9, 5])
"""Contacts come and go; every one has a load of its own, so that no two of them have the same reaction."""


def run(monkeypatch: pytest.MonkeyPatch, *words: object) -> int:
    monkeypatch.setattr(sys, "argv", ["cpbench", *map(str, words)])
    try:
        main()
    except SystemExit as leave:
        return int(leave.code or 0)
    return 0


def problem(ids: list[int]) -> FrictionContact:
    """Contacts without coupling: r_N = id, r_T = 0 solves each, for W = I and q = −(id, 0, 0)."""
    q = np.concatenate([[-float(i), 0.0, 0.0] for i in ids])
    return FrictionContact(W=np.eye(3 * len(ids)), q=q, mu=np.full(len(ids), 0.5))


@pytest.fixture
def steps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Files of four steps, numbered so that the order of their names is not that of the numbers."""
    monkeypatch.chdir(tmp_path)
    for k, ids in zip((1, 2, 9, 10), IDS, strict=True):
        made = problem(ids)
        np.save(f"W{k}.npy", made.W)
        np.save(f"q{k}.npy", made.q)
        np.save(f"mu{k}.npy", made.mu)
        np.save(f"ids{k}.npy", np.array(ids))
        np.save(f"half{k}.npy", np.array(ids) + 0.5)
        np.save(f"at{k}.npy", np.array([[float(i), 0.01 * k, 0.0] for i in ids]))
    return tmp_path


def packed(path: Path) -> list[FrictionContact]:
    return [storage.load(address) for address in storage.problem_files([str(path)])]  # type: ignore[misc]


FILES = ["--fc", "W*.npy", "q*.npy", "mu*.npy"]


def started(path: Path) -> list[str]:
    with Store(path) as store:
        rows = sorted(store.rows(), key=lambda row: (row.start, row.step or 0))
        return [str(row.started) for row in rows]


def test_files_in_the_order_of_their_numbers(monkeypatch, capsys, steps) -> None:
    words = ["pack", "scene.h5", "--sequence", "--dt", "0.01", *FILES, "--ids", "ids*.npy"]
    assert run(monkeypatch, *words) == 0
    assert "4 steps, 2 to 3 contacts" in capsys.readouterr().out
    found = packed(steps / "scene.h5")
    assert [step.fingerprint for step in found] == [problem(ids).fingerprint for ids in IDS]
    for k, (step, ids) in enumerate(zip(found, IDS, strict=True)):
        assert step.sequence is not None
        assert step.contacts is not None
        assert (step.sequence.name, step.sequence.step, step.sequence.dt) == ("scene", k, 0.01)
        assert step.sequence.time == pytest.approx(0.01 * k)
        assert step.sequence.previous == (found[k - 1].fingerprint if k else "")
        assert step.contacts.id.tolist() == ids


def test_arrays_with_steps_are_the_same_as_files(monkeypatch, tmp_path) -> None:
    monkeypatch.chdir(tmp_path)
    made = [problem([i, i + 1]) for i in (1, 2, 3)]
    np.save("W.npy", np.array([p.W for p in made]))
    np.save("q.npy", np.array([p.q for p in made]))
    np.save("mu.npy", made[0].mu)
    np.savetxt("ids.csv", [[i, i + 1] for i in (1, 2, 3)], fmt="%d", delimiter=",")
    words = ["--sequence", "--dt", 0.1, "--fc", "W.npy", "q.npy", "mu.npy", "--ids", "ids.csv"]
    assert run(monkeypatch, "pack", "x.h5", *words) == 0
    assert [p.fingerprint for p in packed(tmp_path / "x.h5")] == [p.fingerprint for p in made]


@pytest.mark.nightly
def test_a_run_follows_ids_positions_or_nothing_and_says_so(monkeypatch, capsys, steps) -> None:
    """The first step and those without a match are cold; the terminal, the row and the report say it."""
    base = ["--sequence", "--dt", "0.01", *FILES]
    assert run(monkeypatch, "pack", "ids.h5", *base, "--ids", "ids*.npy") == 0
    assert run(monkeypatch, "pack", "at.h5", *base, "--positions", "at*.npy") == 0
    capsys.readouterr()
    assert run(monkeypatch, "pack", "none.h5", *base) == 0
    assert "no ids and no positions" in capsys.readouterr().err
    follow = ["-s", "nsgs", "--start", "previous", "--repeats", 1, "-q"]
    for name in ("ids", "at", "none"):
        assert run(monkeypatch, "run", f"{name}.h5", *follow, "-o", f"{name}.sqlite") == 0
    out = capsys.readouterr().out
    assert started(steps / "ids.sqlite") == ["cold: first step", *["previous"] * 3]
    assert started(steps / "at.sqlite") == ["cold: first step", *["previous, contacts matched by position"] * 3]
    told = started(steps / "none.sqlite")
    assert told[1] == "cold: 2 contacts before, 3 now, and no ids to match them by"
    assert "start previous: 3 of 4 rows started so; 1 cold: first step" in out
    assert "3 warm, contacts matched by position; 1 cold: first step" in out
    line = "start previous: 0 of 4 rows started so; 3 cold: 2 contacts before, 3 now, and no ids to match them by"
    assert f"{line} (and alike); 1 cold: first step" in out
    assert line in "".join((steps / "reports" / "none" / "report.md").read_text().splitlines()[:12])
    assert line in (steps / "reports" / "none" / "report.html").read_text()


@pytest.mark.needs("cpbench_solvers")
def test_problems_of_no_sequence_do_not_start_from_a_step_before(monkeypatch, capsys, steps) -> None:
    """Packed one by one they have no place; packed with --problems they have."""
    (steps / "cases").mkdir()
    for k, ids in enumerate(IDS):
        storage.save(problem(ids), steps / "cases" / f"s{k}.h5")
    follow = ["-s", "nsgs", "--start", "previous", "--repeats", 1, "-q"]
    assert run(monkeypatch, "run", "cases", *follow, "-o", "cases.sqlite", "--no-report") == 0
    out = capsys.readouterr().out
    assert "0 of 4 rows started so; 4 unsupported: start previous: the problem is no step of a sequence" in out
    words = ["--sequence", "--dt", 0.01, "--problems", "cases", "--ids", "ids*.npy"]
    assert run(monkeypatch, "pack", "scene.h5", *words) == 0
    assert [p.fingerprint for p in packed(steps / "scene.h5")] == [problem(ids).fingerprint for ids in IDS]


@pytest.mark.nightly
def test_a_start_that_no_file_has_is_reported(monkeypatch, capsys, steps) -> None:
    storage.save(problem([1]), steps / "s.h5")
    words = ["-s", "nsgs", "--start", "file", "--repeats", 1, "-q", "--no-report", "-o", "s.sqlite"]
    assert run(monkeypatch, "run", "s.h5", *words) == 0
    assert "start file: 0 of 1 rows started so; 1 unsupported: start file: the file has no" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([*FILES], "--sequence needs the size of a step"),
        ([*FILES, "--dt", "0.01", "--problems", "x"], "takes one of --fc, --gfc, --problems"),
        (["--dt", "0.01", "--lcp", "W1.npy", "q1.npy"], "a sequence has contact problems"),
        (["--dt", "0.01", "--fc", "W*.npy", "q1.npy", "mu*.npy"], "W2.npy: W: is 9 x 9, expected 6 x 6"),
        (["--dt", "0.01", "--fc", "W*.npy", "q[12].npy", "mu*.npy"], "q[12].npy: q: has 2 steps, W*.npy has 4 of W"),
        (["--dt", "0.01", "--fc", "W1.npy", "q1.npy", "mu1.npy"], "has no steps"),
        (["--dt", "0.01", *FILES, "--ids", "half*.npy"], "not whole"),
        (["--dt", "0.01", *FILES, "--ids", "ids1.npy"], "step 1: fc.contacts: describe 2 contacts"),
        (["--dt", "0.01", *FILES, "--positions", "q*.npy"], "expected a matrix"),
    ],
)
def test_what_does_not_fit_is_refused(monkeypatch, capsys, steps, words, said) -> None:
    assert run(monkeypatch, "pack", "scene.h5", "--sequence", *words) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1
    assert not (steps / "scene.h5").exists()


def test_options_of_sequences_need_one(monkeypatch, capsys, steps) -> None:
    assert run(monkeypatch, "pack", "x.h5", "--fc", "W1.npy", "q1.npy", "mu1.npy", "--ids", "ids1.npy") == 2
    assert "--ids goes with --sequence" in capsys.readouterr().err


def test_a_recorder_writes_the_same_file(tmp_path) -> None:
    recorder = cpbench.Recorder("scene", dt=0.01)
    for ids in IDS:
        recorder.add(problem(ids), ids=ids)
    recorder.save(tmp_path / "scene.h5")
    found = packed(tmp_path / "scene.h5")
    assert [step.sequence.step for step in found] == [0, 1, 2, 3]  # type: ignore[union-attr]
    assert [step.contacts.id.tolist() for step in found] == list(IDS)  # type: ignore[union-attr]


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
