"""Reduced problems on which solvers of ours failed once (`tests/regressions`, a sheet beside each): they solve them."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from cpbench import storage
from cpbench.solvers.base import Budget, Claim, solvers
from cpbench.verification import judge

SHEETS = sorted((Path(__file__).parents[1] / "regressions").glob("*.toml"))
FAILED = [(sheet, solver) for sheet in SHEETS for solver in tomllib.loads(sheet.read_text("utf-8"))["failed"]]


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize(("sheet", "solver"), FAILED, ids=[f"{sheet.stem}-{solver}" for sheet, solver in FAILED])
def test_a_solver_that_failed_solves_it(sheet: Path, solver: str) -> None:
    """With two digits more than were asked for: an answer at the tolerance was the failure."""
    problem = storage.load(sheet.with_suffix(".h5"))
    output = solvers.get(solver).run(problem, Budget(tolerance=1e-6))
    assert output.claim is Claim.SOLVED
    assert judge(problem, output.point, 1e-8).solved


@pytest.mark.parametrize("sheet", SHEETS, ids=[sheet.stem for sheet in SHEETS])
def test_the_sheet_describes_the_file(sheet: Path) -> None:
    described, problem = tomllib.loads(sheet.read_text("utf-8")), storage.load(sheet.with_suffix(".h5"))
    assert (described["name"], described["node"], described["fingerprint"]) == (
        problem.name,
        problem.node,
        problem.fingerprint,
    )
    assert {symbol: described[symbol] for symbol in problem.sizes()} == problem.sizes()
    assert described["summary"] == problem.info.title
