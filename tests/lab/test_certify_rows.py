"""Certificates of the answers of a run: levels, distances, the section of the report."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import synthetic_results as synthetic
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
    with Store(results) as store:
        assert [row.certainty for row in store.rows()] == [None, None]
    assert command(folder, "certify", "r.sqlite").stdout.count("proved") == 2
    assert command(folder, "certify", "r.sqlite", "-s", "lemke").returncode == 2


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
    assert found.loc["t", ["verified", "false", "disproved"]].tolist() == [0, 2, 1]  # 2e-6 is not far
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
