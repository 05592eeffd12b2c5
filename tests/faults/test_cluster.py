"""Real Dask on loopback: workers that die, come late, see no files, or are of another version; and pairs that kill."""

from __future__ import annotations

import contextlib
import json
import os
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

from cpbench import storage
from cpbench.bench.store import Store
from cpbench.formulations import LCP

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
        return subprocess.run(command, cwd=self.folder, capture_output=True, text=True, timeout=120)

    def close(self) -> None:
        """End them all, with what they started."""
        for process in self.processes:
            with contextlib.suppress(psutil.Error):
                for child in psutil.Process(process.pid).children(recursive=True):
                    with contextlib.suppress(psutil.Error):
                        child.kill()
            process.kill()
            process.wait()


def until(what: Callable[[], object], seconds: float = 60.0) -> None:
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
        return {str(row["key"]): row for row in store.rows()}, dict(store.answers())


def _stations() -> list[psutil.Process]:
    found = []
    for process in psutil.process_iter(["cmdline", "status"]):
        line = " ".join(process.info["cmdline"] or ())
        if "cpbench.bench.station" in line and process.info["status"] != psutil.STATUS_ZOMBIE:
            found.append(process)
    return found


def test_a_worker_dies_and_one_comes_late(loopback: Loopback) -> None:
    """Three workers, one of them killed in the middle of a solve, one that joins then and gets work: the results are
    those of a local run but for times."""
    _problems(loopback.folder / "p", range(2, 26))
    chosen = ["p", "-s", "gate", "-s", "lemke", "-s", "pgs"]
    victim, *_ = (loopback.worker("--no-nanny"), loopback.worker(), loopback.worker())
    running = subprocess.Popen(
        loopback.command(*chosen, "-o", "dask.sqlite", "--dask", loopback.address),
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
    told = running.communicate(timeout=60)[1]
    assert running.returncode == 0, told
    assert "a Dask worker was lost" in told
    until(lambda: not _stations(), 10)

    assert loopback.run(*chosen, "-o", "local.sqlite").returncode == 0
    (there, answers), (here, expected) = (_results(loopback.folder / f"{name}.sqlite") for name in ("dask", "local"))
    assert len(here) == 24 * 3
    assert {row["status"] for row in here.values()} == {"solved"}
    assert {k: [row[c] for c in SAME] for k, row in there.items()} == {
        k: [row[c] for c in SAME] for k, row in here.items()
    }
    assert answers == expected
    assert {row["jobs"] for row in there.values()} <= {1, 2, 3}


@pytest.mark.parametrize("name", ["kills-worker", "kills-station"])
def test_a_pair_that_kills_twice_has_its_row(loopback: Loopback, name: str) -> None:
    """It is tried once more, alone; those that were at work beside it lose nothing."""
    _problems(loopback.folder / "p", range(2, 10))
    loopback.worker()
    done = loopback.run("p", "-s", name, "-s", "lemke", "-o", "r.sqlite", "--dask", loopback.address)
    assert done.returncode == 0, done.stderr
    rows, _ = _results(loopback.folder / "r.sqlite")
    assert len(rows) == 16
    (guilty,) = [row for row in rows.values() if row["status"] != "solved"]
    assert (guilty["solver"], guilty["problem"], guilty["status"]) == (name, "p5", "crash")
    assert "died twice" in str(guilty["message"])


def test_interrupted_runs_go_on(loopback: Loopback) -> None:
    """Ctrl-C in the middle of solves: exit 130, nobody solves any more, and the same command goes on."""
    _problems(loopback.folder / "p", range(2, 8))
    loopback.worker()
    chosen = ["p", "-s", "lemke", "-s", "gate", "-o", "r.sqlite", "--dask", loopback.address]
    running = subprocess.Popen(loopback.command(*chosen), cwd=loopback.folder, stderr=subprocess.PIPE, text=True)
    until(lambda: [*loopback.folder.glob("entered-*")])
    running.send_signal(signal.SIGINT)
    told = running.communicate(timeout=30)[1]
    assert running.returncode == 130, told
    assert told.count("\n") == 1, told
    until(lambda: not _stations(), 10)
    (loopback.folder / "open").touch()
    again = loopback.run(*chosen)
    assert again.returncode == 0, again.stderr
    rows, answers = _results(loopback.folder / "r.sqlite")
    assert [row["status"] for row in rows.values()] == ["solved"] * 12
    assert answers.keys() == rows.keys()
