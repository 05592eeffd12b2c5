"""The fault table where the system offers less (no control groups; spawned processes, as on other systems), and with
a process for every solve."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from cpbench.bench.results.store import Store

LIMIT, SPAWNED_LIMIT, AMPLE = 2.0, 6.0, 60.0
GROUP = {
    "faulty-abort": "crash",
    "faulty-hang": "timeout",
    "faulty-stop": "timeout",
    "faulty-orphan": "crash",
    "faulty-burst": "solved",
    "faulty-daemon": "solved",
    "faulty-crowd": "timeout",
    "faulty-parent": "crash",
    "faulty-numpy": "memout",
    "lemke": "solved",
}
SPAWN = {
    "faulty-abort": "crash",
    "faulty-segfault": "crash",
    "faulty-exit": "crash",
    "faulty-hang": "timeout",
    "faulty-stop": "timeout",
    "faulty-children": "timeout",
    "faulty-burst": "solved",
    "faulty-half": "crash",
    "faulty-page": "memout",
    "faulty-raise": "error",
    "faulty-nan": "wrong",
    "lemke": "solved",
}
FEW = ("faulty-abort", "faulty-hang", "faulty-burst", "lemke")
FRESH = {
    "faulty-abort": "crash",
    "faulty-exit-0": "crash",
    "faulty-hang": "timeout",
    "faulty-half": "crash",
    "faulty-parent": "crash",
    "faulty-burst": "solved",
    "faulty-twin": "solved",
    "faulty-numpy": "memout",
    "faulty-raise": "error",
    "faulty-overwrite": "solved",
    "faulty-then-abort": "solved",
    "faulty-then-raise": "solved",
    "lemke": "solved",
}


def _table(bench, expected: dict[str, str], *options: str, limit: float = LIMIT, **environment: str):
    """Rows of two runs: those that only the clock ends, and all others, whose end must not depend on how busy the
    machine is."""
    path, tables = bench.problem("p", 3), []
    for seconds, hangs in ((limit, True), (AMPLE, False)):
        chosen = [name for name, status in expected.items() if (status == "timeout") == hangs]
        limits = ("--timeout", f"{seconds}s", "--memory", "512M", "-o", f"{seconds:g}.sqlite")
        done = bench.run([path], chosen, *limits, *options, **environment)
        assert done.returncode == 0, done.stderr
        with Store(bench.folder / f"{seconds:g}.sqlite") as store:
            tables.append(store.table())
    table = pd.concat(tables).set_index("solver")
    assert table.status.to_dict() == expected, table.message.to_dict()
    assert table.signal["faulty-abort"] == 6
    late = table[table.status == "timeout"]
    assert (late.wall - late.load <= limit + bench.grace).all(), late.wall.to_dict()
    assert "children" in table["flags"]["faulty-burst"]
    assert bench.living() == []
    return table


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize(
    ("isolation", "expected", "limit"),
    [
        ("group", {name: GROUP[name] for name in FEW}, LIMIT),
        pytest.param("group", GROUP, LIMIT, marks=pytest.mark.nightly),
        # every process imports everything; memory that is watched is seen late
        pytest.param("spawn", SPAWN, SPAWNED_LIMIT, marks=pytest.mark.nightly),
    ],
    ids=["few", "group", "spawn"],
)
def test_other_systems(bench, isolation: str, expected: dict[str, str], limit: float) -> None:
    _table(bench, expected, limit=limit, CPBENCH_ISOLATION=isolation)


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize(
    "faults",
    [
        ("faulty-abort", "faulty-hang", "faulty-burst", "faulty-then-abort", "faulty-then-raise", "lemke"),
        pytest.param(tuple(FRESH), marks=pytest.mark.nightly),
    ],
    ids=["few", "all"],
)
def test_a_process_a_solve(bench, faults: tuple[str, ...]) -> None:
    """What a solver keeps for its next call is not there: it has no next call."""
    table = _table(bench, {name: FRESH[name] for name in faults}, "--isolate", "fresh")
    assert list(table["flags"][["faulty-then-abort", "faulty-then-raise", "lemke"]]) == ["", "", ""]
    assert table.repeats["faulty-then-abort"] == 3


@pytest.mark.needs("cpbench_solvers")
def test_an_unknown_isolation_is_refused(bench) -> None:
    done = bench.run([bench.problem("p", 3)], ["lemke"], CPBENCH_ISOLATION="chroot")
    assert done.returncode == 2
    assert "unknown isolation in CPBENCH_ISOLATION 'chroot'" in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.nightly
def test_modules_of_the_folder_are_not_taken_for_others(bench) -> None:
    """A `numpy.py` where the run is started is the user's affair, and nobody's import."""
    for name in ("numpy", "json", "cpbench"):
        (bench.folder / f"{name}.py").write_text("raise RuntimeError('the wrong module')\n")
    problem = bench.problem("p", 3)
    script = str(Path(sys.executable).with_name("cpbench"))
    command = [script, "run", problem, "-s", "lemke", "--no-report", "-q", "-o", "r.sqlite"]
    done = subprocess.run(command, cwd=bench.folder, capture_output=True, text=True, timeout=600)
    assert (done.returncode, done.stderr) == (0, "")
    assert list(bench.store().table().status) == ["solved"]
