"""`cpbench run`: plans, selections, what is run again, and how it ends."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import cpbench, with_plugins

from cpbench import storage
from cpbench.bench import skipped
from cpbench.bench.planning.assembly import Assembly, PlannedSet
from cpbench.bench.planning.plan import Entry, Limits, Pair, exact
from cpbench.bench.planning.run_plan import ProblemSet, RunPlan
from cpbench.bench.results.store import Store
from cpbench.bench.time_limits import GRACE
from cpbench.cli import run_output
from cpbench.formulations import LCP

FLAKY = """
import os
import signal
from pathlib import Path

import numpy as np

from cpbench.formulations import LCPPoint
from cpbench.solvers import Claim, Solver, SolverOutput, SolverSpec, register


@register
class Flaky(Solver):
    spec = SolverSpec(name="flaky", node="lcp", summary="dies once a problem", method="a linear solve")

    def solve(self, prepared, budget, options, start=None, record=None):
        met = Path(f"met-{prepared.q.size}")
        if not met.exists():
            met.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return SolverOutput(claim=Claim.SOLVED, point=LCPPoint(z=np.linalg.solve(prepared.M, -prepared.q)))


@register
class Liar(Solver):
    spec = SolverSpec(name="liar", node="lcp", summary="claims nonsense", method="none")

    def solve(self, prepared, budget, options, start=None, record=None):
        return SolverOutput(claim=Claim.SOLVED, point=LCPPoint(z=-np.ones(prepared.q.size)))
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for n in range(2, 6):
        storage.save(LCP(M=2.0 * np.eye(n), q=-np.ones(n), name=f"p{n}"), tmp_path / f"p{n}.h5")
    (tmp_path / "flaky.py").write_text(FLAKY)
    return tmp_path


def run(folder: Path, *arguments: str, plugin: bool = False, rc: int = 0) -> subprocess.CompletedProcess[str]:
    if plugin:  # `flaky` notes beside the results what it has met
        done = with_plugins(folder, "--plugin", "flaky.py", "run", *arguments)
    else:
        done = cpbench(folder, "run", *arguments)
    assert done.returncode == rc, done.stderr
    return done


def rows(path: Path) -> list[dict[str, Any]]:
    with Store(path) as store:
        return [vars(row) for row in store.rows()]


def meta(path: Path) -> dict[str, Any]:
    with Store(path) as store:
        return store.meta()


PLAN = """
output = "night.sqlite"
report = false

[[set]]
name = "loose"
problems = "p*.h5"
solvers = ["psor[omega=1:1.2:0.1]", "lemke"]
tolerance = [1e-3, 1e-6]
where = "n <= 3"

[[set]]
name = "tight"
problems = ["p4.h5", "p5.h5"]
solvers = "l*e"
timeout = "1m"
tolerance = 1e-9
"""


@pytest.mark.needs("cpbench_solvers")
def test_a_plan_file_is_carried_out_and_kept(folder: Path) -> None:
    (folder / "cpbench.toml").write_text(PLAN)
    told = run(folder)
    assert "plan: cpbench.toml" in told.stderr
    assert "18 pairs: 18 solved" in told.stdout
    found = rows(folder / "night.sqlite")
    assert {(r["set"], r["problem"], r["seconds"]) for r in found} == {
        ("loose", "p2", 10.0), ("loose", "p3", 10.0), ("tight", "p4", 60.0), ("tight", "p5", 60.0),
    }  # fmt: skip
    assert {r["tolerance"] for r in found} == {1e-3, 1e-6, 1e-9}
    assert {r["label"] for r in found} == {"psor[omega=1.0]", "psor[omega=1.1]", "psor[omega=1.2]", "lemke"}
    kept = meta(folder / "night.sqlite")["plan"]
    assert [part["problems"] for part in kept["sets"]] == [["p*.h5"], ["p4.h5", "p5.h5"]]
    assert [sorted(part["found"]) for part in kept["sets"]] == [
        sorted({r["fingerprint"] for r in found if r["set"] == name}) for name in ("loose", "tight")
    ]
    with Store(folder / "night.sqlite") as store:
        features = store.features()
    assert {features[r["fingerprint"]]["n"] for r in found} == {2.0, 3.0, 4.0, 5.0}
    assert features.keys() == {r["fingerprint"] for r in found}
    assert "18 pairs, 18 done before" in run(folder).stderr, "the same command has nothing left to do"
    assert not (folder / "reports").exists()
    alone = run(folder, "--plan", "none", "p2.h5", "-s", "lemke", "--no-report")
    assert "plan:" not in alone.stderr
    assert "results: run.sqlite" in alone.stdout
    over = run(folder, "--timeout", "none", "-t", "1e-2", "-s", "lemke", "-o", "other.sqlite")
    assert "4 pairs: 4 solved" in over.stdout
    assert {(r["seconds"], r["tolerance"]) for r in rows(folder / "other.sqlite")} == {(float("inf"), 1e-2)}


@pytest.mark.needs("cpbench_solvers")
def test_a_dry_run_tells_the_problems_the_grids_and_what_is_done(folder: Path) -> None:
    (folder / "cpbench.toml").write_text(PLAN)
    run(folder, "p4.h5", "p5.h5", "-s", "lemke", "-t", "1e-9", "--timeout", "1m")
    before = {path: path.read_bytes() for path in folder.iterdir()}
    told = run(folder, "--dry-run", "-o", "new.sqlite").stdout
    rows = [line.split() for line in told.splitlines()]
    assert ["lcp", "p2", "1", "2", "8"] in rows
    assert ["lcp", "p5", "1", "1", "1"] in rows
    assert "pairs by solver: lemke " in told
    assert "set loose: 2 problems x 4 solvers with options, routes exact, tolerance 0.001, 1e-06: 16 pairs" in told
    assert "18 pairs to run: worst case 6 min" in told
    told = run(folder, "--dry-run").stdout
    assert "night.sqlite has 2 of the 18 pairs; 16 to be run" in told
    assert {path: path.read_bytes() for path in folder.iterdir()} == before, "nothing is written"
    assert "18 pairs to run" in run(folder, "--dry-run", "--rerun", "all").stdout
    assert "shard 1 of 2" in run(folder, "--dry-run", "--shard", "1/2").stdout


def test_failures_end_with_1(folder: Path) -> None:
    path = folder / "r.sqlite"
    command = ("p2.h5", "p3.h5", "-s", "flaky", "-s", "liar", "--no-report", "-o", "r.sqlite")
    failed = run(folder, *command, "--fail-on", "crash,wrong", plugin=True, rc=1)
    assert "2 crash, 2 wrong (--fail-on)" in failed.stderr
    assert {(r["status"], r["attempts"]) for r in rows(path)} == {("crash", 1), ("wrong", 1)}


@pytest.mark.nightly
def test_what_is_run_again(folder: Path) -> None:
    """A solver that is killed the first time it sees a problem: one attempt, two, and what --rerun makes of it."""
    path = folder / "r.sqlite"
    command = ("p2.h5", "p3.h5", "-s", "flaky", "-s", "liar", "--no-report", "-o", "r.sqlite")
    run(folder, *command, plugin=True)
    again = run(folder, *command, "--rerun", "failed", "--fail-on", "crash", plugin=True)
    assert "2 solved" in again.stdout
    assert sorted((r["status"], r["attempts"]) for r in rows(path)) == [("solved", 2)] * 2 + [("wrong", 2)] * 2
    run(folder, *command, "--rerun", "timeouts", plugin=True)
    assert {r["attempts"] for r in rows(path)} == {2}


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["p9*.h5"], "nothing matches p9*.h5"),
        (["p2.h5", "-s", "neuton-*"], "'--solver': unknown solver 'neuton-*'"),
        (["p2.h5", "--where", "nc >> 3"], "'--where': 'nc >> 3': at 'nc >> 3'"),
        (["p2.h5", "--where", "n > 3"], "none of 1 problems is what the plan selects"),
        (["p2.h5", "--shard", "5/4"], "'5/4' is no shard; write 1/4 to 4/4"),
        (["p2.h5", "-t", "1e-4,-1"], "'--tolerance': the tolerance -1 is not positive"),
        (["p2.h5", "--fail-on", "wrong,crashed"], "did you mean crash"),
        (["--plan", "absent.toml"], "absent.toml: cannot be read"),
    ],
)
def test_what_cannot_be_planned_is_one_line(folder: Path, arguments: list[str], word: str) -> None:
    before = set(folder.iterdir())
    told = run(folder, *arguments, rc=2).stderr
    assert word in told
    assert len(told.splitlines()) == 1, told
    assert set(folder.iterdir()) == before, "nothing is written"


@pytest.mark.needs("cpbench_solvers")
def test_limits_do_not_mix(folder: Path) -> None:
    """Neither in one pair of two sets, nor in a file that is gone on with."""
    two = '[[set]]\nname="a"\nproblems="p2.h5"\nsolvers="lemke"\n[[set]]\nname="b"\nproblems="p2.h5"\nsolvers="l*e"\n'
    (folder / "two.toml").write_text(f'{two}timeout="1m"\n')
    told = run(folder, "--plan", "two.toml", "-q", rc=2)
    assert "sets 'a' and 'b' both ask for lemke on p2.h5, with other limits" in told.stderr
    (folder / "two.toml").write_text(two)
    run(folder, "--plan", "two.toml", "--no-report")
    assert len(rows(folder / "two.sqlite")) == 1
    told = run(folder, "--plan", "two.toml", "--timeout", "5s", rc=2)
    assert "with timeout 10, now 5" in told.stderr.splitlines()[-1]


@pytest.mark.needs("cpbench_solvers")
def test_a_solver_that_was_environment_and_cannot_run_is_named(folder: Path) -> None:
    told = run(folder, "p2.h5", "-s", "lemke", "-s", "nsgs", "--dry-run")
    assert "no route leads to nsgs: no row" in told.stderr


# ------------------------------------------------------------------------------------------ the dry run


def _assembly(limits: Limits, problems: int = 3, solver: str = "lemke") -> Assembly:
    pairs = [
        Pair(f"{i}.h5", f"p{i}", str(i), "lcp", "few", {}, exact(), Entry(solver), "lcp", 1e-6, limits)
        for i in range(problems)
    ]
    part = PlannedSet(ProblemSet(), [Entry(solver)], problems={p.fingerprint: p.address for p in pairs}, pairs=pairs)
    return Assembly([part], pairs, {}, [], [], [], [])


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize(
    ("limits", "asked", "seconds"),
    [
        (Limits(10.0, repeats=1), RunPlan(), 3 * (10 + GRACE)),
        (Limits(10.0, repeats=5), RunPlan(), 3 * (10 + GRACE + 4 * 1.0)),
        (Limits(0.5, repeats=5), RunPlan(), 3 * (0.5 + GRACE + 4 * 0.5)),
        (Limits(10.0, repeats=1), RunPlan(jobs=3), 10 + GRACE),
        (Limits(10.0, repeats=1, history=True), RunPlan(), 3 * (10 + GRACE)),  # lemke has none
    ],
)
def test_the_bound_is_what_the_limits_allow(limits: Limits, asked: RunPlan, seconds: float) -> None:
    told = list(run_output.plan_lines(asked, _assembly(limits), {}))[-1]
    assert told.startswith(f"3 pairs to run: worst case {run_output.duration(seconds)}")
    recorded = _assembly(Limits(10.0, repeats=1, history=True), solver="pgs")
    told = list(run_output.plan_lines(RunPlan(), recorded, {}))[-1]
    assert f"worst case {run_output.duration(6 * (10 + GRACE))}" in told
    assert "without limit" in list(run_output.plan_lines(asked, _assembly(Limits(float("inf"))), {}))[-1]


def test_many_problems_are_counted_by_family() -> None:
    told = list(run_output.plan_lines(RunPlan(), _assembly(Limits(), run_output.ROWS + 1), {}))
    assert [line.split() for line in told[:2]] == [
        ["formulation", "family", "problems", "solvers", "pairs"],
        ["lcp", "few", "61", "1", "61"],
    ]


def test_a_file_that_is_not_there_has_no_rows(tmp_path: Path) -> None:
    assert skipped.statuses_of(tmp_path / "absent.sqlite") == {}
    assert not list(tmp_path.iterdir())
