"""Certificates of the answers of a run: levels, distances, forged rows, the section of the report."""

from __future__ import annotations

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import synthetic_results as synthetic
from certificate_checks import checked
from command_line import cpbench as command

import cpbench as cp
from cpbench.analysis import certainty
from cpbench.analysis.table import normalised
from cpbench.bench.results.store import Store
from cpbench_lab.certifying import certify_first

pytest.importorskip("flint")
EXACT = np.array([1.5, 2.0])


@pytest.fixture
def results(tmp_path: Path) -> Path:
    """A run of two solvers on a problem whose solution is (3/2, 2)."""
    M = np.array([[2.0, 1.0], [1.0, 2.0]])
    cp.save(cp.LCP(M=M, q=-M @ EXACT, name="two"), tmp_path / "two.h5")
    ended = command(
        tmp_path,
        "run",
        "two.h5",
        "-s",
        "lemke,psor",
        "--repeats",
        "1",
        "-o",
        "r.sqlite",
        "--no-report",
    )
    assert ended.returncode == 0, ended.stderr
    certified = command(tmp_path, "certify", "r.sqlite")
    assert certified.returncode == 0, certified.stderr
    assert "two  psor: proved, within" in certified.stdout
    assert command(tmp_path, "report", "r.sqlite", "-o", "rep").returncode == 0
    return tmp_path / "r.sqlite"


def test_rows_have_the_distance_from_the_exact_solution_until_they_run_again(results: Path) -> None:
    with Store(results) as store:
        rows = {row.label: row for row in store.rows()}
        for row in rows.values():
            assert (row.certainty, row.certificate) == ("proved", "unique: P-matrix")
    answer = cp.solve(cp.load(results.parent / "two.h5"), "psor")
    assert answer.x is not None
    measured = np.abs(answer.x - EXACT).max() / 2.0
    assert rows["psor"].distance == pytest.approx(measured, rel=1e-6)
    folder = results.parent
    assert "Of 1 problems an answer is proved for 1" in (folder / "rep" / "details.md").read_text()
    # what is certified stays, and what runs again does not
    assert command(folder, "certify", "r.sqlite").stdout == ""
    assert command(folder, "run", "two.h5", "-s", "lemke,psor", "--repeats", "1", "-o", "r.sqlite", "--no-report",
                   "--rerun", "all").returncode == 0  # fmt: skip
    assert [row.certainty for row in Store(results).rows()] == [None, None]
    assert command(folder, "certify", "r.sqlite").stdout.count("proved") == 2
    assert command(folder, "certify", "r.sqlite", "-s", "lemke").returncode == 2


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A results file with a proof, an enclosure, refuted claims, and a problem of which all solutions are listed."""
    tmp_path = tmp_path_factory.mktemp("several")
    cp.save(cp.LCP(M=np.array([[1.0, 2.0], [2.0, 1.0]]), q=np.full(2, -3.0), name="three"), tmp_path / "three.h5")
    W, q, mu = np.diag([1.0, 2.0, 1.0]), np.array([-1.0, -1.0, 0.0]), np.array([6.0])
    cp.save(cp.FrictionContact(W=W, q=q, mu=mu, name="stick"), tmp_path / "stick.h5")
    cp.save(cp.QP.build(np.eye(2), np.array([-1.0, -3.0]), lb=np.zeros(2), name="program"), tmp_path / "program.h5")
    names = ("three.h5", "stick.h5", "program.h5")
    done = command(tmp_path, "run", *names, "-s", "lemke,nsgs,auto-qp,pgs", "--repeats", "1", "-o", "r.sqlite",
                   "--no-report")  # fmt: skip
    assert done.returncode == 0, done.stderr
    done = command(tmp_path, "certify", "r.sqlite")
    assert done.returncode == 0, done.stderr
    return tmp_path / "r.sqlite"


@pytest.fixture
def several(run: Path, tmp_path: Path) -> Path:
    """A copy of that file, to be changed."""
    return Path(shutil.copy(run, tmp_path / "r.sqlite"))


def test_rows_are_proved_again_without_cpbench(several: Path) -> None:
    code, told = checked(several)
    assert code == 0, told
    assert "three  lemke: proved" in told
    assert "3 solutions, all listed" in told
    assert "stick  nsgs: enclosed" in told
    assert "program  auto-qp: proved" in told
    with Store(several) as store:
        assert len(told.splitlines()) == sum(row.certainty is not None for row in store.rows())
        assert {kind for _, kind, _ in store.certificates()} == {"answer"}
        problems = {row.fingerprint for row in store.rows() if row.certainty}
        assert {fingerprint for fingerprint, _ in store.proved_problems()} == problems


FORGERIES = {
    "a level": "UPDATE rows SET certainty = 'proved' WHERE label = 'nsgs'",
    "a distance": "UPDATE rows SET distance = 1e-18 WHERE label = 'lemke'",
    "a distance that is gone": "UPDATE rows SET distance = NULL WHERE label = 'lemke'",
    "a fact": "UPDATE rows SET certificate = 'unique: P-matrix' WHERE label = 'lemke'",
    "a number": "UPDATE rows SET certificate = '2 solutions, all listed' WHERE label = 'lemke'",
    "no proof": "DELETE FROM certificates",
    "no problem": "DELETE FROM proved_problems",
    "another problem": "UPDATE rows SET fingerprint = (SELECT max(fingerprint) FROM rows)",
    "another problem's data": "UPDATE proved_problems SET data = (SELECT max(data) FROM proved_problems)",
    "another answer": "UPDATE answers SET answer = (SELECT max(answer) FROM answers)",
    "another proof": "UPDATE certificates SET proof = (SELECT max(proof) FROM certificates)",
    "a bit of a proof": "UPDATE certificates SET proof ="
    " CAST(substr(proof, 1, 2000) || x'ff' || substr(proof, 2002) AS BLOB)",
}


@pytest.mark.parametrize("name", FORGERIES)
def test_forged_rows_are_caught(name: str, several: Path) -> None:
    """By the program without cpbench."""
    with closing(sqlite3.connect(several, isolation_level=None)) as db:
        db.execute(FORGERIES[name])
    code, told = checked(several)
    assert (code, "NOT PROVED" in told) == (1, True), told


def test_levels_are_counted_by_solver_and_problem() -> None:
    same = {"certificate": "unique: P-matrix"}
    table = normalised(
        synthetic.table(
            synthetic.row("a-1", "s", "solved", 1.0, certainty="proved", distance=1e-9, certificate=""),
            synthetic.row("a-2", "s", "solved", 1.0, certainty="enclosed", distance=0.5, certificate=""),
            synthetic.row("a-3", "s", "wrong", 1.0, certainty="refuted", certificate="no solution is within 0.1"),
            synthetic.row("a-1", "t", "wrong", 1.0, certainty="proved", distance=0.1, **same),
            synthetic.row("a-2", "t", "inaccurate", 1.0, certainty="proved", distance=2e-6, **same),
            synthetic.row("a-3", "t", "solved", 1.0),
        )
    )
    found = certainty.by_label(table).set_index("label")
    assert found.loc["s", ["verified", "proved", "enclosed", "false", "disproved"]].tolist() == [2, 1, 1, 1, 1]
    assert found.loc["t", ["verified", "false", "disproved"]].tolist() == [0, 2, 1]  # 2e-6 is not ten tolerances
    levels = certainty.by_problem(table).set_index("problem")["level"]
    assert levels.to_dict() == {"a-1": "proved", "a-2": "proved", "a-3": "refuted"}
    assert certainty.far(table)["problem"].tolist() == ["a-2"]


def test_several_answers_are_looked_at_until_one_is_proved() -> None:
    """The automatic choice's answer to this market is near a solution, and its system is singular there."""
    market = cp.load("builtin/ncp/walras.h5::cobb-douglas-4-3")
    solution, found = certify_first(market)
    assert solution is not None
    assert cp.verify(market, solution).solved
    assert found.level == "proved"
    assert cp.certify(market).level == "proved"


@pytest.mark.parametrize("size", [1e154, 1e300, 1.7e308])
def test_an_absurd_answer_is_measured_or_disproved(size: float) -> None:
    """Sums of rows overflow; that is no reason to fail. The matrix is singular, so that a face is looked for."""
    lcp = cp.LCP(M=np.ones((3, 3)), q=-np.ones(3))
    found = cp.certify(lcp, [size, -size, size])
    assert found.level in ("measured", "distant", "refuted")
