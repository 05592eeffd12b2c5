"""Answers made elsewhere: found by name or fingerprint, judged on the problem that was asked, marked, never ranked."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from judged_again import judged_again
from written_reports import whole, write_report

from cpbench import storage
from cpbench.bench.results.merge import merge
from cpbench.bench.results.rows import unpack_answer
from cpbench.bench.results.store import Store
from cpbench.cli import main
from cpbench.formulations import LCP, MLCP
from cpbench.formulations.exchange import exchanges


def lcp(seed: int, n: int = 4) -> tuple[LCP, np.ndarray]:
    """Planted: w and z complement each other, M is positive definite, so that z is the only solution."""
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((n, n))
    M, z, w = A @ A.T + np.eye(n), np.zeros(n), np.zeros(n)
    half = n // 2
    z[:half], w[half:] = 1 + rng.random(half), 1 + rng.random(n - half)
    return LCP(M=M, q=w - M @ z, name=f"planted-{seed}"), z


PLANTED = {problem.name: (problem, z) for problem, z in map(lcp, range(1, 7))}


@pytest.fixture
def asked(tmp_path: Path) -> Path:
    """The problems: six planted LCPs in a pack, an MLCP beside it."""
    folder = tmp_path / "asked"
    folder.mkdir()
    storage.save_pack({name: problem for name, (problem, _) in PLANTED.items()}, folder / "planted.h5")
    storage.save(
        MLCP(A=[[1.0]], B=[[1.0]], C=[[0.0]], D=[[0.0]], a=[-1.0], b=[-1.0], name="mixed"), folder / "mixed.h5"
    )
    return folder


def run(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    monkeypatch.setattr(sys, "argv", ["cpbench", "results", "import", *map(str, arguments)])
    try:
        main()
    except SystemExit as leave:
        return int(leave.code or 0)
    return 0


def rows(path: Path) -> dict[str, dict[str, Any]]:
    with Store(path) as store:
        return {row.problem: vars(row) for row in store.rows()}


@pytest.fixture
def made(tmp_path: Path) -> Path:
    """A folder with an answer in every form, by names and by a fingerprint; none to planted-6."""
    folder = tmp_path / "made"
    folder.mkdir()
    exchanges.get("npy-dir").write_answer(
        PLANTED["planted-1"][0].point_type(PLANTED["planted-1"][1]), folder / "planted-1"
    )
    np.save(folder / "planted-2.npy", PLANTED["planted-2"][1])
    np.savez(folder / "planted-3.npz", z=PLANTED["planted-3"][1])
    problem, z = PLANTED["planted-4"]
    storage.save_answer(folder / "whatever.h5", problem, problem.point_type(z), {})
    np.savetxt(folder / f"{PLANTED['planted-5'][0].fingerprint[:12]}.csv", PLANTED["planted-5"][1], fmt="%.17g")
    return folder


def test_every_form_is_found_and_judged(monkeypatch, capsys, tmp_path: Path, asked: Path, made: Path) -> None:
    out = tmp_path / "r.sqlite"
    (tmp_path / "t.csv").write_text("problem,seconds,iterations\nplanted-1,0.5,7\nplanted-2,,\nnobody,1,1\n")
    assert (
        run(
            monkeypatch,
            made,
            "-s",
            "abacus",
            "--problems",
            asked,
            "--times",
            tmp_path / "t.csv",
            "-o",
            out,
            "--machine",
            "M1",
        )
        == 0
    )
    told = capsys.readouterr()
    found = rows(out)
    assert {name: row["status"] for name, row in found.items()} == {
        **{f"planted-{k}": "solved" for k in range(1, 6)},
        "planted-6": "failed",
    }
    assert found["planted-6"]["message"] == "no answer in the folder"
    assert (found["planted-6"]["claim"], found["planted-1"]["claim"]) == ("", "solved")
    first = found["planted-1"]
    assert (first["solve"], first["reported"], json.loads(first["counters"])) == (0.5, 0.5, {"iterations": 7})
    assert (first["origin"], first["label"], first["host"]) == ("M1", "abacus@imported", None)
    assert first["error"] < 1e-12
    assert found["planted-2"]["solve"] is None
    assert "5 solved, 1 failed" in told.out
    assert "nobody" in told.err
    assert "no row: mlcp 1" in told.err
    assert "no answer, and a row that says failed: 1 problem" in told.err
    assert "no time (--times not given, or without a line): 4 answers" in told.err
    with Store(out) as store:
        kept = {key: unpack_answer(blob) for key, blob in store.answers()}
    np.testing.assert_array_equal(kept[first["key"]], PLANTED["planted-1"][1])
    assert judged_again(out) == (True, ["5 answers judged again: no change", "1 row has no answer to judge: 1 failed"])


def test_answers_that_are_none_are_rows_too(monkeypatch, capsys, tmp_path: Path, asked: Path) -> None:
    made, out = tmp_path / "made", tmp_path / "r.sqlite"
    made.mkdir()
    np.save(made / "planted-1.npy", np.ones(3))
    np.save(made / "planted-2.npy", np.full(4, np.nan))
    np.save(made / "planted-3.npy", 2 * PLANTED["planted-3"][1])
    np.save(made / "planted-4.npy", 2 * PLANTED["planted-4"][1])
    np.save(made / "planted-5.npy", PLANTED["planted-5"][1])
    (made / "planted-6.h5").write_text("nonsense")
    np.save(made / "unknown.npy", np.ones(3))
    times = tmp_path / "t.csv"
    times.write_text("problem,seconds,claim\nplanted-4,,max_iter\nplanted-5,60,timeout\n")
    assert run(monkeypatch, made, "-s", "abacus", "--problems", asked, "--times", times, "-o", out) == 0
    found = rows(out)
    assert {name: row["status"] for name, row in found.items()} == {
        "planted-1": "error",
        "planted-2": "wrong",
        "planted-3": "wrong",
        "planted-4": "max_iter",
        "planted-5": "timeout",
        "planted-6": "error",
    }
    assert "has 3 numbers, expected 4 (z)" in found["planted-1"]["message"]
    assert found["planted-2"]["flags"] == "not finite"
    assert found["planted-5"]["solve"] == 60.0
    assert found["planted-5"]["claim"] == ""
    assert "no problem is called unknown" in capsys.readouterr().err


def test_a_given_ending_stays(monkeypatch, capsys, tmp_path: Path, asked: Path) -> None:
    """Whatever is in the folder, also when answers are judged again."""
    z = PLANTED["planted-1"][1]
    (tmp_path / "made").mkdir()
    np.save(tmp_path / "made" / "planted-1.npy", z)
    times = tmp_path / "made" / "times.csv"  # beside the answers: a table is no answer
    times.write_text("problem,seconds,claim\nplanted-1,,memout\n")
    options = ["-s", "a", "--problems", asked, "--times", times, "-o", tmp_path / "r.sqlite"]
    assert run(monkeypatch, tmp_path / "made", *options) == 0
    assert rows(tmp_path / "r.sqlite")["planted-1"]["status"] == "memout"
    assert judged_again(tmp_path / "r.sqlite")[1][0] == "1 answer judged again: no change"


@pytest.mark.nightly
def test_imports_stand_beside_our_own_rows(monkeypatch, capsys, tmp_path: Path, asked: Path, made: Path) -> None:
    """Into a file of a run, twice only with --force; merged from a file of its own; and the run keeps its limits."""
    ours, theirs = tmp_path / "ours.sqlite", tmp_path / "theirs.sqlite"
    run_it = [sys.executable, "-m", "cpbench", "run", str(asked / "planted.h5"), "-s", "lemke", "--plan", "none"]
    run_it += ["--no-report", "-q", "--repeats", "1", "--timeout", "5s", "-o", str(ours)]
    assert subprocess.run(run_it, capture_output=True, timeout=600).returncode == 0
    solve = ["-s", "lemke", "--problems", asked / "planted.h5"]
    assert run(monkeypatch, made, *solve, "-o", theirs) == 0
    merge([ours, theirs], tmp_path / "both.sqlite")
    assert len(_all(tmp_path / "both.sqlite")) == 12
    assert run(monkeypatch, made, *solve, "-o", ours) == 0
    capsys.readouterr()
    assert run(monkeypatch, made, *solve, "-o", ours) == 2
    assert "--force" in capsys.readouterr().err
    assert run(monkeypatch, made, *solve, "-o", ours, "--force") == 0
    assert len(_all(ours)) == 12
    other = subprocess.run([*run_it, "-s", "pgs", "--timeout", "7s"], capture_output=True, text=True, timeout=600)
    assert other.returncode == 2, "rows without limits hide that ours had others"
    assert "timeout" in other.stderr


def _all(path: Path) -> list[dict[str, Any]]:
    with Store(path) as store:
        return [vars(row) for row in store.rows()]


@pytest.fixture
def both(monkeypatch, tmp_path: Path, asked: Path, made: Path) -> Path:
    """Imported rows of a solver that is faster than anything here, beside rows that stand for our own."""
    out = tmp_path / "both.sqlite"
    (tmp_path / "t.csv").write_text("problem,seconds\n" + "".join(f"planted-{k},1e-3\n" for k in range(1, 6)))
    for solver in ("quick", "slow"):
        assert run(monkeypatch, made, "-s", solver, "--problems", asked, "--times", tmp_path / "t.csv", "-o", out) == 0
    return out


def _cells(report: str, label: str) -> dict[str, str]:
    """The row of this label in the ranking, by the names of its columns."""
    lines = [[cell.strip() for cell in line.split("|")] for line in report.splitlines() if line.startswith("| ")]
    head = next(k for k, cells in enumerate(lines) if "× fastest" in cells)
    return dict(zip(lines[head], next(cells for cells in lines[head:] if cells[1] == label), strict=True))


@pytest.mark.nightly
def test_times_of_another_machine_are_not_ranked(both: Path, tmp_path: Path) -> None:
    with Store(both) as store:
        table, meta = store.table(), store.meta()
    ours = table["solver"] == "slow"
    table.loc[ours, ["origin", "label", "request"]] = ["", "slow", "exact"]
    table.loc[ours, "solve"] = 0.5
    report = whole(write_report(table, meta, tmp_path / "a", "t", drawn=True))
    found = _cells(report, "`quick@imported`")
    assert (found["solved"], found["stationary"], found["false"]) == ("5 of 6", "·", "·")
    assert (found["fastest"], found["median"], found["× fastest"]) == ("·", "—", "—")
    assert found["remarks"] == "times of another machine"
    assert _cells(report, "`slow`")["fastest"] == "5"
    assert "6 answers made elsewhere: their times are of another machine, and they are not ranked." in report
    assert "| `quick@imported` | another machine |" in report
    assert not (tmp_path / "a" / "answer.svg").exists()  # a curve alone says nothing
    assert "cpbench verify" in report
    report = whole(write_report(table, meta, tmp_path / "b", "t", with_imported=True, drawn=True))
    assert _cells(report, "`slow`")["fastest"] == "·"
    assert "quick" in (tmp_path / "b" / "answer.svg").read_text()


def test_a_report_of_imports_alone_has_no_profile(both: Path, tmp_path: Path) -> None:
    with Store(both) as store:
        report = write_report(store.table(), store.meta(), tmp_path / "a", "t").read_text()
    assert "quick@imported" in report
    assert "Performance profile" not in report


@pytest.mark.parametrize(
    ("table", "says"),
    [
        ("", "expected problem,seconds"),
        ("name,seconds\n", "expected problem,seconds"),
        ("problem,time\n", "expected problem,seconds"),
        ("problem,seconds\nplanted-1\n", "line 2: has 1 cells"),
        ("problem,seconds\nplanted-1,-1\n", "line 2: has seconds '-1'"),
        ("problem,seconds\nplanted-1,nan\n", "expected a number"),
        ("problem,seconds\nplanted-1,fast\n", "'fast'"),
        ("problem,seconds,claim\nplanted-1,1,perhaps\n", "claim 'perhaps'"),
        ("\xff", "expected problem,seconds"),
    ],
)
def test_a_broken_table_is_one_line(
    monkeypatch, capsys, tmp_path: Path, asked: Path, made: Path, table: str, says: str
) -> None:
    (tmp_path / "t.csv").write_text(table)
    out = tmp_path / "r.sqlite"
    assert run(monkeypatch, made, "-s", "a", "--problems", asked, "--times", tmp_path / "t.csv", "-o", out) == 2
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1
    assert _all(out) == []


def test_ambiguous_answers_and_names_are_refused(monkeypatch, capsys, tmp_path: Path, asked: Path, made: Path) -> None:
    np.save(made / "planted-3.npy", np.ones(4))
    assert run(monkeypatch, made, "-s", "a", "--problems", asked, "-o", tmp_path / "r.sqlite") == 2
    assert "answer one problem" in capsys.readouterr().err
    (made / "planted-3.npy").unlink()
    twin = dataclasses.replace(lcp(9)[0], name="planted-3")
    storage.save(twin, asked / "twin.h5")
    assert run(monkeypatch, made, "-s", "a", "--problems", asked, "-o", tmp_path / "r.sqlite") == 2
    assert "name of 2 problems" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("source", "says"),
    [("nowhere", "is no folder of answers"), ("empty", "holds no answer"), ("strange", "none of its")],
)
def test_a_source_without_answers_is_one_line(
    monkeypatch, capsys, tmp_path: Path, asked: Path, source: str, says
) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "strange").mkdir()
    np.save(tmp_path / "strange" / "x.npy", np.ones(1))
    assert run(monkeypatch, tmp_path / source, "-s", "a", "--problems", asked, "-o", tmp_path / "r.sqlite") == 2
    assert says in capsys.readouterr().err


@pytest.mark.nightly
def test_the_built_in_problems_are_the_default(monkeypatch, capsys, tmp_path: Path) -> None:
    from cpbench.generators.collection import builtin_folder

    address = next(a for a in storage.problem_files([builtin_folder() / "relay"]))
    problem, found = storage.load(address), storage.solution(address)
    assert found is not None
    (tmp_path / "made").mkdir()
    np.save(tmp_path / "made" / f"{problem.fingerprint}.npy", np.concatenate(list(found[0].arrays().values())))
    assert run(monkeypatch, tmp_path / "made", "-s", "a", "-o", tmp_path / "r.sqlite") == 0
    counts = [row["status"] for row in _all(tmp_path / "r.sqlite") if row["node"] == "relay"]
    assert counts.count("solved") == 1
    assert set(counts) == {"solved", "failed"}
