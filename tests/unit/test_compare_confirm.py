"""`cpbench compare --confirm` runs what alarmed again: an alarm that does not come back is none, and is told.

The solver is one whose answers are wrong as long as a file of the problem's name lies in a folder: between the run
and the comparison one of two such files is removed.
"""

from __future__ import annotations

import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from command_line import cpbench as in_process

from cpbench import storage
from cpbench.formulations import LCP

PLUGIN = '''
import os
from pathlib import Path
import numpy as np
from cpbench.formulations import LCPPoint
from cpbench.solvers import Claim, Solver, SolverOutput, SolverSpec, register

@register
class Moody(Solver):
    """Solves identity matrices; gives up where a file says so."""
    spec = SolverSpec(name="moody", node="lcp", summary="moody", method="none", licence="Apache-2.0")
    def solve(self, prepared, budget, options, start=None, record=None):
        if os.environ.get("MOODY") and Path(os.environ["MOODY"], str(prepared.q.size)).exists():
            return SolverOutput(claim=Claim.FAILED, point=None)
        return SolverOutput(claim=Claim.SOLVED, point=LCPPoint(z=np.maximum(-prepared.q, 0.0)))
'''
MANY, FEW = "psor[max_iterations=4000]", "psor[max_iterations=50]"
LOADED = ("--plugin", "moody.py", "--plugin", "builds.toml")


def cpbench(folder: Path, *words: str, rc: int = 0) -> str:
    command = [sys.executable, "-m", "cpbench", *words]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300)
    assert done.returncode == rc, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def altered(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of two problems by few sweeps and by many; few fail on the first, and by a changed row on the second."""
    folder = tmp_path_factory.mktemp("altered")
    storage.save(LCP(M=[[1.0, 0.99], [0.99, 1.0]], q=[-1.0, -1.0], name="p1"), folder / "p1.h5")
    storage.save(LCP(M=np.eye(3), q=-np.ones(3), name="p2"), folder / "p2.h5")
    words = ("-s", MANY, "-s", FEW, "--no-report", "-q", "-o", "run.sqlite")
    done = in_process(folder, "run", "p1.h5", "p2.h5", *words)
    assert done.returncode == 0, done.stderr
    with closing(sqlite3.connect(folder / "run.sqlite")) as db:
        failed = "status = 'failed', claim = 'failed', error = NULL"
        assert db.execute(f"UPDATE rows SET {failed} WHERE problem = 'p2' AND label = ?", (FEW,)).rowcount == 1
        db.commit()
    return folder


@pytest.mark.needs("cpbench_solvers")
def test_an_alarm_that_is_not_confirmed_is_reported(altered: Path) -> None:
    words = ("compare", "run.sqlite", "--a", MANY, "--b", FEW, "--fail-on", "regression")
    said = in_process(altered, *words)
    assert said.returncode == 1
    assert "regressed (2)" in said.stdout
    said = in_process(altered, *words, "--confirm")
    assert said.returncode == 1
    assert "run again: 2 pairs, 4 solves" in said.stdout + said.stderr
    assert "note: run again: 1 of 2 pairs alarmed twice, 1 did not" in said.stdout
    assert f"regressed (1):\n  p1, {FEW}" in said.stdout
    said = in_process(altered, "compare", "run.sqlite", "--a", FEW, "--b", MANY, "--confirm")
    assert "2 pairs improved" in said.stdout.splitlines()[0]
    assert "run again" not in said.stdout + said.stderr


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """Results of three problems (n = 2, 3, 4) by two builds, of which the second fails on two."""
    (tmp_path / "moods").mkdir()
    for n in (2, 3, 4):
        storage.save(LCP(M=np.eye(n), q=-np.arange(1.0, n + 1), name=f"p{n}"), tmp_path / f"p{n}.h5")
    for n in (2, 3):
        (tmp_path / "moods" / str(n)).touch()
    (tmp_path / "moody.py").write_text(PLUGIN)
    env = f'env = {{MOODY = "{tmp_path / "moods"}"}}'
    (tmp_path / "builds.toml").write_text(f'[solver."moody@base"]\nenv = {{}}\n[solver."moody@head"]\n{env}\n')
    solvers = ("-s", "moody@base", "-s", "moody@head", "--no-report", "-q")
    cpbench(tmp_path, "run", "p2.h5", "p3.h5", "p4.h5", *LOADED, *solvers, "-o", "run.sqlite")
    return tmp_path


BUILDS = ("compare", "run.sqlite", "--a", "moody@base", "--b", "moody@head", "--fail-on", "regression")


@pytest.mark.nightly
def test_two_builds(run: Path) -> None:
    assert "regressed (2)" in cpbench(run, *BUILDS, rc=1)
    (run / "moods" / "2").unlink()
    said = cpbench(run, *BUILDS, "--confirm", *LOADED, rc=1)
    assert "run again: 2 pairs, 4 solves" in said
    assert "note: run again: 1 of 2 pairs alarmed twice, 1 did not" in said
    assert "regressed (1):\n  p3, moody@head" in said
    assert "p2, moody@head: solved → failed; not when it was run again" in said
    (run / "moods" / "3").unlink()
    said = cpbench(run, *BUILDS, "--confirm", *LOADED, "-o", "out.md")
    assert "0 of 2 pairs alarmed twice, 2 did not" in said
    assert said.startswith("inconclusive: ")
    assert "0 of 2 pairs alarmed twice" in (run / "out.md").read_text()


@pytest.mark.nightly
def test_two_files(run: Path) -> None:
    """The new side is run again, by what is installed now; the base is what its file says."""
    moods = [run / "moods" / str(n) for n in (2, 3)]
    words = ("run", "p2.h5", "p3.h5", "p4.h5", *LOADED, "-s", "moody@head", "--no-report", "-q")
    cpbench(run, *words, "-o", "new.sqlite")
    for mood in moods:
        mood.unlink()
    cpbench(run, *words, "-o", "old.sqlite")
    moods[1].touch()
    compared = ("compare", "old.sqlite", "new.sqlite", "--confirm", "--fail-on", "failed")
    said = cpbench(run, *compared, *LOADED, rc=1)
    assert "1 of 2 pairs alarmed twice, 1 did not" in said
    assert "1 new failed (--fail-on)" in said
    assert "unknown solver 'moody@head'" in cpbench(run, *compared, rc=2)


@pytest.mark.nightly
def test_nothing_is_run_where_nothing_alarms(run: Path) -> None:
    said = cpbench(run, "compare", "run.sqlite", "--a", "moody@head", "--b", "moody@base", "--confirm")
    assert "2 pairs improved" in said.splitlines()[0]
    assert "run again" not in said
