"""Hangs in every phase of a run end at the limit of the phase; killed helpers cost no row, or the run says so."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest
from click.testing import CliRunner

from cpbench.bench import time_limits
from cpbench.bench.planning.quantities import duration
from cpbench.bench.results.store import Store
from cpbench.cli import cli

HERE = Path(__file__).parent
PROGRAM = HERE / "served_faults.py"
FLOORS = {"START": 4.0, "WARM_UP": 4.0, "LOAD": 2.0}
SHORT = """
import sys
from dataclasses import replace
from cpbench import cli
from cpbench.bench import slot, time_limits, worker_pool
name, floor = sys.argv[1], float(sys.argv[2])
phase = replace(getattr(time_limits, name), floor=floor)
for module in (slot, worker_pool):
    if hasattr(module, name):
        setattr(module, name, phase)
del sys.argv[1:3]
cli.main()
"""
"""The command line with the floor of one phase as a test needs it, for it is a minute or more; what must not end by the
clock has the others."""
HANGS = """
import time
from cpbench.solvers import Solver, SolverSpec, register


def hang(*_):
    time.sleep(600.0)


for phase in ("obstacle", "hand_over", "warmup", "availability"):
    spec = SolverSpec(name=f"{phase}-hang", node="lcp", summary="hangs", method="fault")
    register(type(phase, (Solver,), {"spec": spec, "solve": lambda *_: None, phase: hang}))
"""
HANGING = {  # the phase that hangs, status, part of the message
    "obstacle-hang": ("LOAD", "error", "loading: not over after 2 s"),
    "load-hang": ("LOAD", "error", "loading: not over after 2 s"),
    "hand_over-hang": ("LOAD", "error", "loading: not over after 2 s"),
    "hello-hang": ("START", "unavailable", "broken: start not over after 4 s"),
    "availability-hang": ("START", "unavailable", "broken: start not over after 4 s"),
    "warmup-hang": ("WARM_UP", "unavailable", "broken: warm-up not over after 4 s"),
    "served-warmup-hang": ("WARM_UP", "unavailable", "broken: warm-up not over after 4 s"),
}
SERVED = {"load-hang": "load-hang", "hello-hang": "hello-hang", "served-warmup-hang": "warmup-hang"}
"""Which of them are programs, and their faults."""


@pytest.mark.parametrize(
    "name", [name if name == "obstacle-hang" else pytest.param(name, marks=pytest.mark.nightly) for name in HANGING]
)
def test_a_hang_outside_of_solve_has_its_row(bench, name: str) -> None:
    """In a program or in a plugin; it ends at the limit of its phase, by the clock of the row where that is part of it:
    starts and warm-ups are before all rows."""
    phase, status, told = HANGING[name]
    if name in SERVED:
        served = f"{sys.executable} {PROGRAM} {SERVED[name]}"
        (bench.folder / "plugin.toml").write_text(
            f'[solver.{name}]\nnode = "lcp"\nmatrices = "dense"\nserve = "{served}"\n'
        )
    else:
        (bench.folder / "plugin.py").write_text(HANGS)
    (plugin,) = bench.folder.glob("plugin.*")
    command = [sys.executable, "-c", SHORT, phase, str(FLOORS[phase]), "--plugin", plugin.name, "run"]
    command += [bench.problem("p", 3), "-s", name, "--timeout", "1s", "--no-report", "-q", "-o", "r.sqlite"]
    begun = time.monotonic()
    done = subprocess.run(command, cwd=bench.folder, capture_output=True, text=True, timeout=600)
    taken = time.monotonic() - begun
    assert done.returncode == (status == "unavailable"), done.stderr
    assert bench.living() == []
    (row,) = bench.store().table().itertuples()
    assert row.status == status, row.message
    assert row.message.startswith(told), row.message
    assert taken >= FLOORS[phase]
    if phase == "LOAD":
        assert FLOORS[phase] <= row.wall <= FLOORS[phase] + bench.grace


def test_a_phase_has_the_timeout_and_at_least_its_floor() -> None:
    for phase in time_limits.PHASES:
        assert phase.limit(phase.floor / 2) == phase.floor
        assert phase.limit(2 * phase.floor) == 2 * phase.floor


def test_the_limits_are_in_the_help() -> None:
    words = " ".join(CliRunner().invoke(cli, ["run", "--help"], catch_exceptions=False).output.split())
    for phase in time_limits.PHASES:
        assert f"{phase.name} {duration(phase.floor)}" in words


# ---------------------------------------------------------------------------------------- killed helpers


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("kills", [1, pytest.param(6, marks=pytest.mark.nightly)])
def test_helpers_killed_while_a_run_is_planned_cost_no_row(bench, kills: int) -> None:
    """Kills of the forkserver, each as soon as it is there, while everything is imported and read."""
    paths = [bench.problem(f"p{n}", n) for n in (3, 4)]
    running = subprocess.Popen(
        bench.command(paths, ["lemke", "pgs"]), cwd=bench.folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    )
    runner, killed = psutil.Process(running.pid), set[int]()
    while running.poll() is None and len(killed) < kills:
        time.sleep(0.05)
        for child in runner.children() if runner.is_running() else []:
            if child.pid not in killed and "forkserver" in " ".join(child.cmdline()):
                os.kill(child.pid, signal.SIGKILL)
                killed.add(child.pid)
    _, told = running.communicate(timeout=600)
    assert len(killed) == kills
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


@pytest.mark.needs("cpbench_solvers")
def test_a_run_without_the_rows_of_a_problem_does_not_end_with_0(bench) -> None:
    """Whoever reads one of the files dies: the others are run, what is missing is said, and the end is 1."""
    (bench.folder / "deadly.py").write_text(DEADLY)
    (bench.folder / "p.deadly").write_text("deadly")
    paths = [bench.problem("p3", 3), str(bench.folder / "p.deadly")]
    done = bench.run(paths, ["lemke"], CPBENCH_PLUGINS=str(bench.folder / "deadly.py"))
    assert done.returncode == 1, done.stderr
    lines = done.stderr.splitlines()
    assert any(line.startswith("cpbench: rows are missing: the content of") and "p.deadly" in line for line in lines)
    with Store(bench.folder / "r.sqlite") as store:
        assert store.counts() == {"solved": 1}
