"""`cpbench recommend`: what it says, that its command works, older files, and what it refuses in one line."""

from __future__ import annotations

import json
import math
import shlex
import sqlite3
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tiers import some_by_day

from cpbench import storage
from cpbench.bench.planning import plan
from cpbench.bench.planning.features import features
from cpbench.bench.planning.plan import Entry, Pair
from cpbench.bench.results.problem_features import problem_features
from cpbench.bench.results.rows import Outcome
from cpbench.bench.results.store import Store
from cpbench.cli import main
from cpbench.formulations import LCP

SOLVERS = ("lemke", "psor", "pgs")


def cpbench(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    """Exit code of the command line, run in this process."""
    monkeypatch.setattr(sys, "argv", ["cpbench", *map(str, arguments)])
    try:
        main()
    except SystemExit as leave:
        return int(leave.code or 0)
    return 0


ORIGINS = {"p2": "chains", "p3": "stacks", "p4": "walls"}


def write_lcp(folder: Path, n: int) -> Path:
    path = folder / f"p{n}.h5"
    storage.save(LCP(M=np.eye(n), q=-np.ones(n), name=f"p{n}"), path)
    return path


def results(
    path: Path, problems: list[Path], seconds: Mapping[str, float], start: str = "cold", noted: bool = True
) -> Path:
    """A results file in which every solver came to the same time on all problems, ∞ for a failure, NaN for not run."""
    with Store(path, create=True) as store:
        for address in problems:
            problem = storage.load(address)
            for name, took in seconds.items():
                pair = Pair(
                    str(address), problem.name, problem.fingerprint, "lcp", ORIGINS.get(problem.name, problem.name),
                    problem.sizes(), plan.exact(), Entry(name), "lcp", 1e-6, start=start,
                )  # fmt: skip
                store.plan([pair])
                told = {"status": "solved" if math.isfinite(took) else "failed", "solve": took, "kind": "equivalent"}
                if not math.isnan(took):
                    store.finish(pair.key, Outcome(**told, started=start, host="here"))
            if noted:
                store.note_features({problem.fingerprint: features(problem)})
    return path


@pytest.fixture
def problems(tmp_path: Path) -> list[Path]:
    return [write_lcp(tmp_path, n) for n in (2, 3, 4)]


@pytest.fixture
def measured(tmp_path: Path, problems: list[Path]) -> Path:
    return results(tmp_path / "r.sqlite", problems[:2], {"lemke": 1.0, "psor": 0.1, "pgs": math.inf})


def told(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *arguments: object) -> Any:
    assert cpbench(monkeypatch, "recommend", *arguments, "--json") == 0
    return json.loads(capsys.readouterr().out)


# --------------------------------------------------------------------------------------------- what is said


def test_what_is_recommended_runs_and_solves(monkeypatch, capsys, problems: list[Path], measured: Path) -> None:
    found = told(monkeypatch, capsys, problems[2], "--results", measured, "--top", 2)
    first, second = found["recommended"]
    assert (first["label"], first["route"], first["similar"], first["solved"]) == ("psor", "direct", 2, 2)
    assert second["label"] == "lemke"
    assert found["checked"] | {"problems": 2, "solved": 2, "within": 2} == found["checked"]
    assert found["similar"] == found["measured"] == 2
    words = shlex.split(first["command"])
    assert cpbench(monkeypatch, *words[1:], "--json") == 0
    assert json.loads(capsys.readouterr().out)["status"] == "solved"


def test_one_tolerance_is_gone_by_and_asked_for(monkeypatch, capsys, problems: list[Path], measured: Path) -> None:
    first = told(monkeypatch, capsys, problems[2], "--results", measured, "-t", "1e-6")["recommended"][0]
    assert first["command"].endswith("--tolerance 1e-06")
    assert first["similar"] == 2
    assert cpbench(monkeypatch, "recommend", problems[2], "--results", measured, "-t", "1e-4") == 2
    assert "nothing was measured at --tolerance 0.0001, but at 1e-06" in capsys.readouterr().err
    assert cpbench(monkeypatch, "recommend", problems[2], "-t", "1e-6") == 2
    assert "give --tolerance with --results of runs" in capsys.readouterr().err


@pytest.mark.nightly
def test_by_the_shipped_table(monkeypatch, capsys, problems: list[Path]) -> None:
    assert cpbench(monkeypatch, "recommend", "builtin/lcp/lcp-classics.h5::murty-10", "--any") == 0
    said = capsys.readouterr().out
    assert "run it     cpbench solve builtin/lcp/lcp-classics.h5::murty-10 -s " in said
    assert "this very problem" in said
    assert "cross-validation by origin: the recommended solver solved" in said


def test_a_problem_unlike_all_is_told_so(monkeypatch, capsys, tmp_path: Path, measured: Path) -> None:
    rng = np.random.default_rng(1)
    M = rng.standard_normal((150, 150)) - 20 * np.eye(150)
    path = tmp_path / "far.h5"
    storage.save(LCP(M=M, q=rng.standard_normal(150), name="far"), path)
    assert cpbench(monkeypatch, "recommend", path, "--results", measured) == 0
    said = capsys.readouterr().out
    assert "nothing like it was measured: of 2 lcp problems the nearest is p" in said
    assert "passed     psor: " in said, "it needs a positive diagonal, and says so"
    assert "1. lemke" in said


def test_warm_goes_by_warm_rows_and_says_when_there_are_none(
    monkeypatch, capsys, tmp_path: Path, problems: list[Path]
) -> None:
    measured = results(tmp_path / "cold.sqlite", problems[:2], {"enumeration-lcp": 0.1, "psor": 0.2, "pgs": 1.0})
    cold = told(monkeypatch, capsys, problems[2], "--results", measured, "--warm")
    assert cold["recommended"][0]["label"] == "psor"
    assert "enumeration-lcp" not in {one["label"] for one in cold["recommended"]}, "it takes no starting point"
    assert any("no warm start was measured" in remark for remark in cold["remarks"])
    assert "the file has no starting point (guesses), so the command starts cold" in cold["remarks"]
    assert "--start" not in cold["recommended"][0]["command"]
    warm = results(tmp_path / "warm.sqlite", problems[:2], {"psor": 1.0, "pgs": 0.1}, start="file")
    found = told(monkeypatch, capsys, problems[2], "--results", measured, "--results", warm, "--warm")
    assert found["recommended"][0]["label"] == "pgs"
    assert not any("no warm" in remark for remark in found["remarks"])


@pytest.mark.nightly
def test_a_solver_that_is_not_installed_is_passed_over(tmp_path: Path, problems: list[Path]) -> None:
    plugin = tmp_path / "guests.py"
    plugin.write_text(
        "from cpbench.solvers.base import Claim, Solver, SolverOutput, SolverSpec, register\n\n"
        "@register\nclass Absent(Solver):\n"
        '    spec = SolverSpec(name="guest-absent-here", node="lcp", summary="none", method="none",'
        ' requires=("no_such_guest",), install="pip install no-such-guest")\n\n'
        "    def solve(self, prepared, budget, options, start=None, record=None):\n"
        "        return SolverOutput(claim=Claim.FAILED)\n"
    )
    path = results(tmp_path / "r.sqlite", problems[:2], {"guest-absent-here": 0.1, "lemke": 1.0, "unknown-here": 0.2})

    def run(*more: str) -> str:
        command = [sys.executable, "-m", "cpbench", "--plugin", str(plugin), "recommend", str(problems[2]), *more]
        return subprocess.run([*command, "--results", str(path)], capture_output=True, text=True, check=True).stdout

    assert "passed     guest-absent-here: missing: pip install no-such-guest" in run()
    assert "1. lemke" in run()
    every = run("--any")
    assert "1. guest-absent-here" in every
    assert "cannot run here: missing: pip install no-such-guest" in every


def test_the_evaluation(monkeypatch, capsys, measured: Path) -> None:
    assert cpbench(monkeypatch, "recommend", "--evaluate", "--results", measured) == 0
    said = capsys.readouterr().out
    assert [line.split()[:5] for line in said.splitlines()[3:5]] == [
        ["lcp", "2", "2", "2", "2"],
        ["all", "2", "2", "2", "2"],
    ]
    rows = told(monkeypatch, capsys, "--evaluate", "--results", measured)["rates"]
    assert (rows[0]["single"], rows[0]["single_within"]) == ("psor", 2)


def test_a_table_is_made_and_used(monkeypatch, capsys, tmp_path: Path, problems: list[Path], measured: Path) -> None:
    """Solvers whose figures may not be published are not in it; what may be is used as the results are."""
    with Store(measured, create=True) as store:
        store.set_meta(solvers={"lemke": {"name": "lemke", "publishing": "ask first"}})
    table = tmp_path / "table.json"
    assert cpbench(monkeypatch, "recommend", "--make", table, "--results", measured) == 0
    assert "may not be published: lemke" in capsys.readouterr().out
    assert "lemke" not in table.read_text()
    assert cpbench(monkeypatch, "recommend", "--make", table, "--results", measured) == 2
    assert "--force" in capsys.readouterr().err
    found = told(monkeypatch, capsys, problems[2], "--results", table)
    assert found["recommended"][0]["label"] == "psor"
    both = told(monkeypatch, capsys, problems[2], "--results", table, "--results", measured)
    assert both["measured"] == 2, "the same problems"


# -------------------------------------------------------------------------------------------- older files


def test_features_of_an_older_file_are_read_again(monkeypatch, capsys, tmp_path: Path, problems: list[Path]) -> None:
    """Where a problem is gone, or another one, only the sizes of its rows are known."""
    path = results(tmp_path / "old.sqlite", problems, {"lemke": 1.0}, noted=False)
    there, changed = storage.load(problems[0]), storage.load(problems[1])
    problems[2].unlink()
    storage.save(LCP(M=2 * np.eye(3), q=-np.ones(3), name="p3"), problems[1], force=True)
    with Store(path) as store:
        assert store.features() == {}
        found, lost = problem_features(store)
    assert (set(found), lost) == ({there.fingerprint}, 2)
    assert changed.fingerprint not in found
    assert found[there.fingerprint] == features(there)
    remarks = told(monkeypatch, capsys, problems[0], "--results", path)["remarks"]
    assert any("of 2 problems not where they were" in remark for remark in remarks)


# ---------------------------------------------------------------------------------------------- bad input


@pytest.mark.parametrize(
    ("case", "word"),
    some_by_day([
        ("absent", "no such results file"),
        ("empty", "is empty, not a results file"),
        ("text", "not a results file"),
        ("newer", "update cpbench"),
        ("no table", "no table of recommendations"),
        ("no rows", "it has no finished problem"),
        ("not run", "it has no finished problem"),
        ("all failed", "nobody solved any of its 2 problems"),
        ("no problem", "no such file"),
        ("nothing", "give a PROBLEM, or --evaluate, or --make TABLE"),
        ("both", "give a PROBLEM, or --evaluate, or --make TABLE"),
        ("one family", "there is nothing to leave out"),
        ("make of nothing", "--results FILE"),
    ], 5),
)  # fmt: skip
def test_bad_input_is_one_line(
    monkeypatch, capsys, tmp_path: Path, problems: list[Path], measured: Path, case: str, word: str
) -> None:
    file = tmp_path / ("bad.json" if case == "no table" else "bad.sqlite")
    arguments: list[object] = [problems[2], "--results", file]
    if case == "empty":
        file.write_bytes(b"")
    elif case in ("text", "no table"):
        file.write_text("hello")
    elif case == "newer":
        file = results(file, [], {})
        db = sqlite3.connect(file)
        db.execute("PRAGMA user_version=99")
        db.commit()
        db.close()
    elif case in ("no rows", "not run", "all failed", "one family"):
        took = {"all failed": math.inf, "not run": math.nan}.get(case, 1.0)
        some = {"no rows": [], "one family": problems[:1]}.get(case, problems[:2])
        results(file, some, {"lemke": took})
        if case == "one family":
            arguments[0] = "--evaluate"
    elif case == "no problem":
        arguments = [tmp_path / "absent.h5"]
    elif case == "nothing":
        arguments = []
    elif case == "both":
        arguments = [problems[0], "--evaluate"]
    elif case == "make of nothing":
        arguments = ["--make", tmp_path / "t.json"]
    assert cpbench(monkeypatch, "recommend", *arguments) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert len(said.err.splitlines()) == 1
    assert word in said.err


def test_one_solver_alone_is_told(monkeypatch, capsys, tmp_path: Path, problems: list[Path]) -> None:
    path = results(tmp_path / "one.sqlite", problems[:2], {"lemke": 1.0})
    remarks = told(monkeypatch, capsys, problems[2], "--results", path)["remarks"]
    assert remarks == ["only lemke was measured: it is the best of one"]


def test_a_problem_of_another_formulation_goes_by_what_reaches_it(
    monkeypatch, capsys, tmp_path: Path, measured: Path
) -> None:
    """No qp was measured; a quadratic program in a box reaches the solvers of the LCP."""
    assert cpbench(monkeypatch, "recommend", "builtin/qp/qp-planted.h5::bounds-50", "--results", measured) == 0
    said = capsys.readouterr().out
    assert "nothing like it was measured: no qp problem at all" in said
    assert "checked    not at all: no qp problem was measured" in said


def test_solvers_of_a_plugin_that_is_not_loaded_leave_those_that_were_never_measured(
    monkeypatch, capsys, tmp_path: Path, problems: list[Path]
) -> None:
    found = results(tmp_path / "plugin.sqlite", problems[:2], {"unknown-here": 1.0, "another": 2.0})
    assert cpbench(monkeypatch, "recommend", problems[2], "--results", found) == 0
    said = capsys.readouterr().out
    assert "no solver that was measured takes this problem; these were never measured" in said
    assert "times the fastest" not in said
