"""Solvers that write into the results: kept from it where the system can, found where it cannot."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from cpbench.bench.processes import landlock
from cpbench.bench.results.store import Store

PLUGIN = Path(__file__).with_name("forging_solvers.py")
SOLVERS = ("statuses", "verdicts", "answers", "tolerances", "nothing")


def _run(bench, isolation: str, problems: list[str], *solvers: str) -> subprocess.CompletedProcess[str]:
    chosen = [text for name in solvers for text in ("-s", name)]
    command = [sys.executable, "-m", "cpbench", "--plugin", str(PLUGIN), "run", *problems, *chosen]
    return subprocess.run(
        [*command, "-o", "r.sqlite", "--no-report", "-q", "--repeats", "1"],
        cwd=bench.folder,
        env={**os.environ, "CPBENCH_ISOLATION": isolation, "FORGED": str(bench.folder / "r.sqlite")},
        capture_output=True,
        text=True,
        timeout=600,
    )


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize(
    ("forger", "sizes"),
    [("statuses", (3, 4)), *(pytest.param(name, (3, 4, 5), marks=pytest.mark.nightly) for name in SOLVERS[:-1])],
)
def test_a_forger_is_found_at_the_end_of_his_run(bench, forger: str, sizes: tuple[int, ...]) -> None:
    """Named, with exit code 1, by the run and by whoever reads the file; then run again."""
    problems = [bench.problem(f"p{n}", n) for n in sizes]
    done = _run(bench, "open", problems, f"forges-{forger}", "lemke", "forges-nothing")
    assert done.returncode == 1, done.stderr
    assert "r.sqlite: " in done.stderr
    assert "of its rows cannot be believed: " in done.stderr
    with Store(bench.folder / "r.sqlite") as store:
        broken = store.audit().broken
    assert broken
    again = _run(bench, "open", problems, "lemke", "forges-nothing")
    assert again.returncode == 1, again.stderr
    assert again.stderr.count("removed, to be run again where it is planned: ") == len(broken)
    last = _run(bench, "open", problems, "lemke", "forges-nothing")
    assert last.returncode == 0, last.stderr
    with Store(bench.folder / "r.sqlite") as store:
        assert not store.audit().broken
        rows = {(row.solver, row.problem): row.status for row in store.rows()}
    assert {status for (solver, _), status in rows.items() if solver == "lemke"} == {"solved"}
    assert {status for (solver, _), status in rows.items() if solver == "forges-nothing"} == {"wrong"}


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.skipif(landlock.version() == 0, reason="does not apply: this system has no Landlock")
def test_a_confined_forger_can_do_nothing(bench) -> None:
    """Nothing is written, and the key is not read."""
    problems = [bench.problem("p3", 3)]
    done = _run(bench, "", problems, "lemke", *(f"forges-{name}" for name in SOLVERS))
    assert done.returncode == 0, done.stderr
    with Store(bench.folder / "r.sqlite") as store:
        assert not store.audit().broken
        rows = list(store.rows())
    forgers = [row for row in rows if row.solver != "lemke"]
    assert len(forgers) == len(SOLVERS)
    assert {row.status for row in forgers} == {"wrong"}
    assert all("could not: " in row.message for row in forgers), [row.message for row in forgers]
    assert {row.status for row in rows if row.solver == "lemke"} == {"solved"}
