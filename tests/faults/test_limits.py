"""Hangs in every phase of a run end at the limit of the phase; killed helpers cost no row, or the run says so."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import psutil
import pytest

from cpbench.bench import time_limits
from cpbench.bench.planning.quantities import duration
from cpbench.bench.results.store import Store

HERE = Path(__file__).parent
PROGRAM = HERE / "served_faults.py"
FLOORS = {"START": 4.0, "WARM_UP": 6.0, "LOAD": 2.0}
SHORT = f"""
import sys
from dataclasses import replace
from cpbench import cli
from cpbench.bench import lane, staff, time_limits
for name, floor in {FLOORS!r}.items():
    phase = replace(getattr(time_limits, name), floor=floor)
    for module in (lane, staff):
        if hasattr(module, name):
            setattr(module, name, phase)
cli.main()
"""
"""The command line with the floors of a test: the real ones are minutes."""
HANGS = """
import time
from cpbench.solvers import Solver, SolverSpec, register


def hang(*_):
    time.sleep(600.0)


for phase in ("obstacle", "hand_over", "warmup", "availability"):
    spec = SolverSpec(name=f"{phase}-hang", node="lcp", summary="hangs", method="fault")
    register(type(phase, (Solver,), {"spec": spec, "solve": lambda *_: None, phase: hang}))
"""
HANGING = {  # status, part of the message
    "load-hang": ("error", "loading: not over after 2 s"),
    "obstacle-hang": ("error", "loading: not over after 2 s"),
    "hand_over-hang": ("error", "loading: not over after 2 s"),
    "hello-hang": ("unavailable", "broken: start not over after 4 s"),
    "availability-hang": ("unavailable", "broken: start not over after 4 s"),
    "warmup-hang": ("unavailable", "broken: warm-up not over after 6 s"),
    "served-warmup-hang": ("unavailable", "broken: warm-up not over after 6 s"),
}


SERVED = {"load-hang": "load-hang", "hello-hang": "hello-hang", "served-warmup-hang": "warmup-hang"}
"""Which of them are programs, and their faults."""


@pytest.fixture(scope="module")
def hung(module_bench) -> tuple[pd.DataFrame, float]:
    """Rows of one hang a phase, in a program or in a plugin, and the seconds of all of them."""
    folder = module_bench.folder
    (folder / "hangs.py").write_text(HANGS)
    tables = [
        f'[solver.{name}]\nnode = "lcp"\nmatrices = "dense"\nserve = "{sys.executable} {PROGRAM} {fault}"\n'
        for name, fault in SERVED.items()
    ]
    (folder / "hangs.toml").write_text("\n".join(tables))
    chosen = [word for name in HANGING for word in ("-s", name)]
    command = [sys.executable, "-c", SHORT, "--plugin", "hangs.py", "--plugin", "hangs.toml", "run"]
    command += [module_bench.problem("p", 3), *chosen, "--timeout", "1s", "--no-report", "-q", "-o", "r.sqlite"]
    begun = time.monotonic()
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=600)
    taken = time.monotonic() - begun
    assert done.returncode == 0, done.stderr
    assert module_bench.living() == []
    return module_bench.store().table().set_index("solver"), taken


@pytest.mark.parametrize("name", HANGING)
def test_a_hang_outside_of_solve_has_its_row(hung: tuple[pd.DataFrame, float], name: str) -> None:
    status, told = HANGING[name]
    row = hung[0].loc[name]
    assert row.status == status, row.message
    assert row.message.startswith(told), row.message


def test_each_phase_ends_at_its_limit(hung: tuple[pd.DataFrame, float], module_bench) -> None:
    """By the clock of the row where the phase is part of it; starts and warm-ups are before all rows."""
    rows, taken = hung
    late = rows[rows.status == "error"].wall
    assert (late >= FLOORS["LOAD"]).all()
    assert (late <= FLOORS["LOAD"] + module_bench.grace).all(), dict(late)
    least = 2 * FLOORS["START"] + 2 * FLOORS["WARM_UP"] + 3 * FLOORS["LOAD"]
    assert least <= taken <= least + 60.0


def test_a_phase_has_the_timeout_and_at_least_its_floor() -> None:
    for phase in time_limits.PHASES:
        assert phase.limit(phase.floor / 2) == phase.floor
        assert phase.limit(2 * phase.floor) == 2 * phase.floor


def test_the_limits_are_in_the_help() -> None:
    help_text = subprocess.run(
        [sys.executable, "-m", "cpbench", "run", "--help"], capture_output=True, text=True, timeout=60
    ).stdout
    words = " ".join(help_text.split())
    for phase in time_limits.PHASES:
        assert f"{phase.name} {duration(phase.floor)}" in words


# ---------------------------------------------------------------------------------------- killed helpers


def test_helpers_killed_while_a_run_is_planned_cost_no_row(bench) -> None:
    """Six kills of the forkserver, each as soon as it is there, while everything is imported and read."""
    paths = [bench.problem(f"p{n}", n) for n in (3, 4)]
    running = subprocess.Popen(
        bench.command(paths, ["lemke", "pgs"]), cwd=bench.folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    )
    runner, killed = psutil.Process(running.pid), set[int]()
    while running.poll() is None and len(killed) < 6:
        time.sleep(0.05)
        for child in runner.children() if runner.is_running() else []:
            if child.pid not in killed and "forkserver" in " ".join(child.cmdline()):
                os.kill(child.pid, signal.SIGKILL)
                killed.add(child.pid)
    _, told = running.communicate(timeout=600)
    assert len(killed) == 6
    assert running.returncode == 0, told
    assert list(bench.store().table().status) == ["solved"] * 4


DEADLY = """
import os
from cpbench.storage import formats
from cpbench.storage.base import Format


class Deadly(Format):
    name, summary, suffixes = "deadly", "ends whoever reads it", (".deadly",)

    def recognises(self, path, head):
        return path.suffix == ".deadly"

    def load(self, path, member):
        os._exit(7)


formats.add("deadly", Deadly())
"""


def test_a_run_without_the_rows_of_a_problem_does_not_end_with_0(bench) -> None:
    """Whoever reads one of the files dies: the others are run, what is missing is said, and the end is 1."""
    (bench.folder / "deadly.py").write_text(DEADLY)
    (bench.folder / "p.deadly").write_text("deadly")
    paths = [bench.problem("p3", 3), str(bench.folder / "p.deadly")]
    done = bench.run(paths, ["lemke"], CPBENCH_PLUGINS=str(bench.folder / "deadly.py"))
    assert done.returncode == 1, done.stderr
    last = done.stderr.splitlines()[-1]
    assert last.startswith("cpbench: rows are missing: nobody could say what")
    assert "p.deadly" in last
    with Store(bench.folder / "r.sqlite") as store:
        assert store.counts() == {"solved": 1}
