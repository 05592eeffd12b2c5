"""Real Dask on loopback: workers that die, come late, or are of another version; and pairs that kill."""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import platform
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import psutil
import pytest
from recorded import write_sequence

import cpbench
from cpbench import storage
from cpbench.bench.block import Block
from cpbench.bench.planning import plan
from cpbench.bench.planning.plan import Limits, Pair
from cpbench.bench.results.store import Store
from cpbench.bench.run import Executor, execute
from cpbench.bench.slot import Slot
from cpbench.bench.worker_pool import Setting
from cpbench.errors import CpbenchError
from cpbench.formulations import LCP
from cpbench_lab.cluster import connect, executor
from cpbench_lab.cluster.dask_worker import RemoteWorker
from cpbench_lab.cluster.executor import DaskExecutor

PLUGIN = Path(__file__).with_name("cluster_solvers.py")
DASK = [sys.executable, "-m", "dask"]
SAME = ["status", "claim", "error", "message", "route", "kind", "parts", "counters", "repeats", "version", "started"]
"""Columns that do not depend on when and where a pair was run."""


@dataclass
class Loopback:
    """A scheduler and workers, each a process of its own, started as a user would."""

    folder: Path
    processes: list[subprocess.Popen[bytes]] = field(default_factory=list)

    def scheduler(self) -> None:
        file = self.folder / "scheduler.json"
        self.start("scheduler", "--port", "0", "--host", "127.0.0.1", "--no-dashboard", "--scheduler-file", str(file))
        until(lambda: file.exists() and file.read_text().rstrip().endswith("}"))
        self.address = json.loads(file.read_text())["address"]

    def worker(self, *options: str, **environment: str) -> subprocess.Popen[bytes]:
        return self.start("worker", self.address, "--nthreads", "2", "--no-dashboard", *options, **environment)

    def start(self, *command: str, **environment: str) -> subprocess.Popen[bytes]:
        with (self.folder / "dask.log").open("ab") as log:
            process = subprocess.Popen(
                [*DASK, *command],
                cwd=self.folder,
                env={**os.environ, "CLUSTER_TEST": str(self.folder), **environment},
                stdout=log,
                stderr=log,
            )
        self.processes.append(process)
        return process

    def command(self, *arguments: str) -> list[str]:
        run = [sys.executable, "-m", "cpbench", "--plugin", str(PLUGIN), "run", "--no-report", "-q"]
        return [*run, "--repeats", "1", "--timeout", "60s", *arguments]

    def run(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        command = self.command(*arguments)
        return subprocess.run(command, cwd=self.folder, capture_output=True, text=True, timeout=600)

    def close(self) -> None:
        """End them all, with what they started."""
        for process in self.processes:
            with contextlib.suppress(psutil.Error):
                for child in psutil.Process(process.pid).children(recursive=True):
                    with contextlib.suppress(psutil.Error):
                        child.kill()
            process.kill()
            process.wait()


def until(what: Callable[[], object], seconds: float = 600.0) -> None:
    deadline = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.02)


@pytest.fixture
def loopback(tmp_path: Path) -> Iterator[Loopback]:
    made = Loopback(tmp_path)
    try:
        made.scheduler()
        yield made
    finally:
        made.close()


def _problems(folder: Path, orders: range) -> None:
    """Strictly diagonally dominant M with the planted solution z = e: q = -Me."""
    folder.mkdir()
    for n in orders:
        M = np.diag(np.full(n, 4.0)) - np.diag(np.ones(n - 1), 1) - np.diag(np.ones(n - 1), -1)
        storage.save(LCP(M=M, q=-(M @ np.ones(n)), name=f"p{n}"), folder / f"p{n}.h5")


def _results(path: Path) -> tuple[dict[str, dict[str, object]], dict[str, bytes]]:
    """Rows by key, and the kept answers."""
    with Store(path) as store:
        return {row.key: vars(row) for row in store.rows()}, dict(store.answers())


def _remote_workers(**wanted: object) -> list[psutil.Process]:
    """Remote workers that live, by their folder (`cwd`) or their parent (`ppid`)."""
    found: list[psutil.Process] = []
    for process in psutil.process_iter(["cmdline", "status", "cwd", "ppid"]):
        info = process.info
        living = (
            "cpbench_lab.cluster.remote_worker" in " ".join(info["cmdline"] or ())
            and info["status"] != psutil.STATUS_ZOMBIE
        )
        if living and all(info[name] == value for name, value in wanted.items()):
            found.append(process)
    return found


@pytest.mark.nightly
def test_a_worker_dies_and_one_comes_late(loopback: Loopback) -> None:
    """Three workers, one of them killed in the middle of a solve, one that joins then and gets work: the results are
    those of a local run but for times."""
    _problems(loopback.folder / "p", range(2, 26))
    chosen = ["p", "-s", "gate", "-s", "lemke", "-s", "pgs"]
    victim, *_ = (loopback.worker("--no-nanny"), loopback.worker(), loopback.worker())
    running = subprocess.Popen(
        loopback.command(*chosen, "-o", "dask.sqlite", "--cluster", loopback.address),
        cwd=loopback.folder,
        stderr=subprocess.PIPE,
        text=True,
    )
    until(lambda: len([*loopback.folder.glob("entered-*")]) == 3)
    assert (loopback.folder / f"entered-{victim.pid}").exists()
    victim.kill()
    late = loopback.worker("--no-nanny")
    until((loopback.folder / f"entered-{late.pid}").exists)
    (loopback.folder / "open").touch()
    told = running.communicate(timeout=600)[1]
    assert running.returncode == 0, told
    assert "a Dask worker was lost" in told
    until(lambda: not _remote_workers(cwd=str(loopback.folder)))

    assert loopback.run(*chosen, "-o", "local.sqlite").returncode == 0
    (there, answers), (here, expected) = (_results(loopback.folder / f"{name}.sqlite") for name in ("dask", "local"))
    assert len(here) == 24 * 3
    assert {row["status"] for row in here.values()} == {"solved"}
    assert _alike(there) == _alike(here)
    assert answers == expected
    assert {row["jobs"] for row in there.values()} <= {1, 2, 3}


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["kills-worker", "kills-remote-worker"])
def test_a_pair_that_kills_twice_has_its_row(loopback: Loopback, name: str) -> None:
    """It is tried once more, alone; those that were at work beside it lose nothing."""
    _problems(loopback.folder / "p", range(2, 10))
    loopback.worker()
    done = loopback.run("p", "-s", name, "-s", "lemke", "-o", "r.sqlite", "--cluster", loopback.address)
    assert done.returncode == 0, done.stderr
    rows, _ = _results(loopback.folder / "r.sqlite")
    assert len(rows) == 16
    (guilty,) = [row for row in rows.values() if row["status"] != "solved"]
    assert (guilty["solver"], guilty["problem"], guilty["status"]) == (name, "p5", "crash")
    assert "died twice" in str(guilty["message"])


@pytest.mark.nightly
def test_interrupted_runs_go_on(loopback: Loopback) -> None:
    """Ctrl-C in the middle of solves: exit 130, nobody solves any more, and the same command goes on."""
    _problems(loopback.folder / "p", range(2, 8))
    loopback.worker()
    chosen = ["p", "-s", "lemke", "-s", "gate", "-o", "r.sqlite", "--cluster", loopback.address]
    running = subprocess.Popen(loopback.command(*chosen), cwd=loopback.folder, stderr=subprocess.PIPE, text=True)
    until(lambda: [*loopback.folder.glob("entered-*")])
    running.send_signal(signal.SIGINT)
    told = running.communicate(timeout=600)[1]
    assert running.returncode == 130, told
    assert told.count("\n") == 1, told
    until(lambda: not _remote_workers(cwd=str(loopback.folder)))
    (loopback.folder / "open").touch()
    again = loopback.run(*chosen)
    assert again.returncode == 0, again.stderr
    rows, answers = _results(loopback.folder / "r.sqlite")
    assert [row["status"] for row in rows.values()] == ["solved"] * 12
    assert answers.keys() == rows.keys()


@pytest.mark.nightly
def test_a_run_whose_scheduler_dies_goes_on_without_it(loopback: Loopback) -> None:
    """One line and exit 2; what was finished is kept, nothing solves any more, and the same pairs can be run here."""
    _problems(loopback.folder / "p", range(2, 8))
    loopback.worker()
    chosen = ["p", "-s", "lemke", "-s", "gate", "-o", "r.sqlite"]
    running = subprocess.Popen(
        loopback.command(*chosen, "--cluster", loopback.address), cwd=loopback.folder, stderr=subprocess.PIPE, text=True
    )
    until(lambda: [*loopback.folder.glob("entered-*")])
    loopback.processes[0].kill()
    told = running.communicate(timeout=600)[1]
    assert running.returncode == 2, told
    assert "the Dask scheduler does not answer any more" in told
    (loopback.folder / "open").touch()
    again = loopback.run(*chosen)
    assert again.returncode == 0, again.stderr
    rows, answers = _results(loopback.folder / "r.sqlite")
    assert [row["status"] for row in rows.values()] == ["solved"] * 12
    assert answers.keys() == rows.keys()


@pytest.fixture(scope="module")
def local() -> Iterator[DaskExecutor]:
    """Two processes."""
    with connect.start("local", Setting(), 2) as started:
        yield started


@pytest.mark.nightly
def test_steps_follow_answers_of_another_task(
    local: DaskExecutor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(executor, "TASK", 0.05)
    scene = write_sequence(tmp_path / "steps.h5")
    limits = Limits(seconds=30.0, repeats=1)
    with Slot() as slot:
        addresses = storage.problem_files([str(scene)])
        surveys = [slot.survey(address, [plan.exact()]) for address in addresses]
        asked = (surveys, [plan.Entry("nsgs")], [plan.exact()], 1e-6, limits)
        planned = [pair for start in ("previous", "cold") for pair in plan.pairs(*asked, start=start)]
        expected, answers = _executed([slot], planned, tmp_path / "here.sqlite")
    rows, found = _executed(local, planned, tmp_path / "there.sqlite")
    assert len(expected) == 64
    assert _alike(rows) == _alike(expected)
    assert found == answers
    assert {str(row["started"]).partition(":")[0] for row in rows.values()} == {"cold", "previous"}


def test_a_run_over_two_processes_is_as_one_here(local: DaskExecutor, tmp_path: Path) -> None:
    _problems(tmp_path / "p", range(2, 6))
    with Slot() as slot:
        surveys = [slot.survey(str(path), [plan.exact()]) for path in sorted((tmp_path / "p").iterdir())]
        planned = plan.pairs(surveys, [plan.Entry("lemke")], [plan.exact()], 1e-6, Limits(seconds=60.0, repeats=1))
        expected, answers = _executed([slot], planned, tmp_path / "here.sqlite")
    rows, found = _executed(local, planned, tmp_path / "there.sqlite")
    assert [row["status"] for row in rows.values()] == ["solved"] * 4
    assert _alike(rows) == _alike(expected)
    assert found == answers


def test_workers_of_another_version_are_refused(
    local: DaskExecutor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cpbench, "__version__", "99")
    other = DaskExecutor(local._client, Setting())
    _problems(tmp_path / "p", range(2, 3))
    with Slot() as slot:
        survey = slot.survey(str(tmp_path / "p" / "p2.h5"), [plan.exact()])
    planned = plan.pairs([survey], [plan.Entry("lemke")], [plan.exact()], 1e-6)
    with pytest.raises(CpbenchError, match=r"has cpbench 0\.[\d.]+, and the run is of 99"):
        _executed(other, planned, tmp_path / "r.sqlite")


def _executed(on: Executor | list[Slot], planned: list[Pair], path: Path) -> tuple[dict, dict]:
    with Store(path, create=True) as store:
        store.plan(planned)
        execute(on, store, planned)
    return _results(path)


def _alike(rows: dict[str, dict[str, object]]) -> dict[str, list[object]]:
    return {key: [row[column] for column in SAME] for key, row in rows.items()}


def test_an_address_that_is_none() -> None:
    with pytest.raises(CpbenchError, match="'localhost' is no address of a Dask scheduler"):
        connect.to_scheduler("localhost", Setting())


def test_a_cluster_of_no_known_kind() -> None:
    with pytest.raises(CpbenchError, match="--cluster slurm: is local, or the address of a Dask scheduler"):
        connect.start("slurm", Setting())


def test_an_idle_remote_worker_ends_and_restarts() -> None:
    """A client that was killed removes no plugin; one that is only slow finds a worker again."""
    remote = RemoteWorker(executor._worker_setup(Setting()), idle=0.5)
    try:
        for _ in range(2):
            result = remote.ask("here", pickle.dumps((Block(()), 1.0)))
            assert (result.outcomes, result.died) == ((), "")
            assert result.machine is not None
            assert result.machine[0] == platform.node()
            until(lambda: not _remote_workers(ppid=os.getpid()))
    finally:
        remote.end()


def test_dask_is_imported_on_demand() -> None:
    loaded = (
        "import cpbench.cli.run_command, sys; print({'distributed', 'cpbench_lab.cluster.executor'} & {*sys.modules})"
    )
    done = subprocess.run([sys.executable, "-c", loaded], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"


def test_without_dask_one_line_says_what_to_install() -> None:
    blocked = (
        "import sys\n"
        "sys.modules['distributed'] = None\n"
        "from cpbench_lab.cluster import connect\n"
        "from cpbench.bench.worker_pool import Setting\n"
        "try:\n    connect.start('local', Setting())\n"
        "except Exception as error:\n    print(type(error).__name__, error)\n"
    )
    done = subprocess.run([sys.executable, "-c", blocked], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("CpbenchError clusters need Dask (")
    assert "pip install 'cpbench[dask]'" in done.stdout
