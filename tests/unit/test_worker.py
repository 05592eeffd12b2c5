"""The process that solves, by its messages; what a solve used; a process a solve."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pandas as pd
import psutil
import pytest
import scipy.sparse as sp
from synthetic_results import meta, row, table

from cpbench.analysis import cautions
from cpbench.analysis import table as rows_of
from cpbench.analysis.ranking import rankings
from cpbench.bench import messages, shared_problem, worker
from cpbench.bench.outcome import LATE, LATE_SHARE, method_seconds
from cpbench.bench.processes import meter
from cpbench.bench.processes.launch import context
from cpbench.bench.processes.meter import Meter, checksum
from cpbench.bench.processes.process import Child
from cpbench.bench.worker_pool import hear
from cpbench.formulations import LCP

MiB = 2**20
linux = pytest.mark.skipif(sys.platform != "linux", reason="does not apply: Linux only")


# ---------------------------------------------------------------------------------------------- meter


@linux
def test_peak_is_what_was_needed_even_if_given_back() -> None:
    measured = Meter()
    measured.begin()
    np.ones(64 * MiB // 8).sum()
    first = measured.end(1e-3, 1e-3)
    assert 60 * MiB < first["peak"] < 80 * MiB
    measured.begin()
    assert measured.end(1e-3, 1e-3)["peak"] < 4 * MiB, "the mark begins anew"


BURN = "import time\nwhile time.process_time() < 0.3: pass"
FORKS = f"import subprocess, sys\nsubprocess.run([sys.executable, '-c', {BURN!r}])\nprint(flush=True)\nsys.stdin.read()"


@pytest.mark.nightly
@linux
def test_what_a_command_and_the_children_of_a_helper_used_is_charged() -> None:
    measured = Meter()
    measured.begin()
    before = measured.cpu()
    subprocess.run([sys.executable, "-c", BURN], check=True)
    spent = measured.cpu() - before
    assert spent > 0.25
    assert measured.end(1e-3, 1e-3)["peak"] is None, "no figure is better than that of somebody else"
    measured.begin()
    assert measured.end(1e-3, 1e-3)["peak"] < 4 * MiB, "nobody was waited for"
    with subprocess.Popen([sys.executable, "-c", FORKS], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as helper:
        measured = Meter()
        measured.helpers = (psutil.Process(helper.pid),)
        before = measured.cpu()
        assert helper.stdout is not None
        helper.stdout.readline()
        assert measured.cpu() - before > 0.25


@pytest.mark.nightly
@linux
def test_processes_there_when_a_solve_begins_are_helpers_and_more_of_them_are_left_behind() -> None:
    """As a served program has that holds each problem in a child of its own; one that keeps them all is told."""
    began: list[subprocess.Popen[bytes]] = []

    def load() -> None:
        began.append(subprocess.Popen([sys.executable, "-c", FORKS], stdin=subprocess.PIPE, stdout=subprocess.PIPE))

    def forget() -> None:
        last = began.pop()
        last.kill()
        last.communicate()

    try:
        measured = Meter()
        for _ in range(2):
            load()
            measured.begin()
            before = measured.cpu()
            assert began[-1].stdout is not None
            began[-1].stdout.readline()
            assert measured.cpu() - before > 0.25
            assert measured.end(1e-3, 1e-3)["children"] == 0
            forget()
        load()
        load()
        for helper in began:
            assert helper.stdout is not None
            helper.stdout.readline()  # the children that they begin with have ended
        measured.begin()
        assert measured.end(1e-3, 1e-3)["children"] == 1
    finally:
        while began:
            forget()


def test_threads_that_stay_and_those_that_were_busy() -> None:
    measured = Meter()
    measured.begin()
    assert measured.end(1e-3, 5e-3)["threads"] == 1, "too short to tell from CPU time"
    assert measured.end(1.0, 3.9)["threads"] == 4
    done = threading.Event()
    stays = threading.Thread(target=done.wait)
    stays.start()
    assert measured.end(1e-3, 1e-3)["threads"] == 2
    done.set()
    stays.join()


def _count(connection) -> None:
    counts = [len(meter.descendants())]
    pids: list[int] = []
    for _ in range(2):
        pids.append(os.fork())
        if pids[-1] == 0:
            time.sleep(3600)
    counts.append(len(meter.descendants()))
    for pid in pids:
        os.kill(pid, signal.SIGKILL)
        os.waitid(os.P_PID, pid, os.WEXITED | os.WNOWAIT)
    connection.send_bytes(repr([*counts, len(meter.descendants())]).encode())


@linux
def test_descendants_are_those_that_run() -> None:
    child = Child(context(1), _count, ())
    try:
        assert child.receive(60.0) == b"[0, 2, 0]"
    finally:
        child.kill()


@pytest.mark.parametrize("make", [np.array, sp.csr_array], ids=["dense", "sparse"])
def test_a_checksum_sees_every_change(make) -> None:
    M = np.array([[2.0, 1.0, 0.0], [0.0, 3.0, 1.0], [0.0, 0.0, 4.0]])
    problem = LCP(M=make(M), q=-np.ones(3))
    before = checksum(problem)
    assert checksum(LCP(M=make(M), q=-np.ones(3))) == before
    numbers = problem.M.data if sp.issparse(problem.M) else problem.M
    flat = np.asarray(numbers).reshape(-1)
    flat.setflags(write=True) if flat.base is None else numbers.setflags(write=True)
    flat = np.asarray(numbers).reshape(-1)
    flat[[0, 1]] = flat[[1, 0]]  # a swap, as sorting or pivoting in place does
    assert checksum(problem) != before


# --------------------------------------------------------------------------------------------- worker


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> str:
    where = tmp_path_factory.mktemp("worker") / "p"
    shared_problem.write(LCP(M=np.diag([2.0, 3.0]), q=np.array([-2.0, 3.0]), name="p"), where)
    return str(where)


def _ready(child: Child) -> messages.Ready:
    """What a worker says once it is warm: before, that it warms up."""
    assert isinstance(hear(child, 300.0), messages.WarmingUp)
    ready = hear(child, 300.0)
    assert isinstance(ready, messages.Ready)
    return ready


def _serve(child: Child, path: str, repeats: int = 3) -> list[messages.Message]:
    """All messages about one request."""
    child.send(messages.pack(messages.Solve(path, 1e-8, 10.0, {}, repeats=repeats)))
    last = messages.Repeats if repeats > 1 else messages.Result
    told: list[messages.Message] = []
    while not told or not isinstance(told[-1], (last, messages.Failure)):
        told.append(hear(child, 60.0))
    return told


@pytest.mark.needs("cpbench_solvers")
def test_the_messages_of_a_request(path: str) -> None:
    child = Child(context(1), worker.main, ("lemke", 2**30))
    try:
        _ready(child)
        for _ in range(2):
            told = _serve(child, path)
            assert [type(m) for m in told] == [messages.ProblemLoaded, messages.Result, messages.Repeats]
            result = told[1]
            np.testing.assert_allclose(result.vectors["z"], [1.0, 0.0])
            assert (result.claim, result.wrote, result.children, result.threads) == ("solved", False, 0, 1)
            assert 0 <= result.peak < 100 * MiB
            assert np.shape(told[2].times) == (2, 3)
        assert [type(m) for m in _serve(child, path, repeats=1)] == [messages.ProblemLoaded, messages.Result]
        missing = _serve(child, path + "x", repeats=1)[-1]
        assert isinstance(missing, messages.Failed)
        assert "no such file" in missing.message.lower()
        assert isinstance(_serve(child, path)[-1], messages.Repeats), "it goes on after an error"
    finally:
        child.kill()


def _counted(**counters: object) -> tuple[dict[str, int], str]:
    counted, notes = worker._counters(counters)
    return counted, "; ".join(notes)


def test_counters_are_few_short_and_of_64_bits() -> None:
    """What is left out is said; so many that their names alone take seconds are not looked at."""
    assert _counted(iterations=7, sweeps=np.int32(3)) == ({"iterations": 7, "sweeps": 3}, "")
    for bad in (1.5, -7):
        assert _counted(a=bad, b=2) == ({"b": 2}, "the counter a is no integer from 0 to 2^63, and not kept")
    counted, note = _counted(a=10**5000, b=2**63 - 1, c=2**62)
    assert (counted, note.startswith("the counter a is no")) == ({"b": 2**63 - 1, "c": 2**62}, True)
    counted, notes = worker._counters({"x" * 10**6: 1})
    assert (list(counted), notes) == (["x" * worker.NAME], [])
    counted, notes = worker._counters({f"c{k}": k for k in range(10**5)})
    assert list(counted.values()) == list(range(worker.COUNTERS))
    assert notes == [f"100000 counters, the first {worker.COUNTERS} are kept"]


# ---------------------------------------------------------------------------------------------- apart


def test_scratch_folders_of_the_living_are_left_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What kill -9 leaves is a folder and a lock that nobody holds."""
    import tempfile

    from cpbench.foundation.locks import RUN, TemporaryHome, remove_abandoned

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    alive, dead = TemporaryHome(RUN), tmp_path / "cpbench-run-0123456789ab"
    dead.mkdir()
    (tmp_path / f"{dead.name}.lock").touch()
    remove_abandoned(RUN, tmp_path)
    assert alive.folder.exists()
    assert not dead.exists()
    alive.remove()
    alive.remove()
    assert list(tmp_path.iterdir()) == []


def test_a_method_in_the_worker_has_the_clock_of_the_worker() -> None:
    assert method_seconds(2.0, 0.5, None, trusted=True) == 2.0


def test_the_clock_of_a_guest_counts_where_it_is_plausible() -> None:
    assert method_seconds(7.24e-3, 0.65e-3, 5e-5, trusted=True) == 0.65e-3
    for implausible in (None, 0.0, -1.0, 8e-3, math.nan):
        assert method_seconds(7.24e-3, implausible, 5e-5, trusted=True) == pytest.approx(7.19e-3)


def test_a_clock_that_shows_far_too_little_is_not_believed() -> None:
    """From both sides of what the flag `clock` allows: a quarter of a second, and half of the time."""
    reported = 1.0
    most = LATE + LATE_SHARE * reported
    assert method_seconds(0.999 * most, reported, 0.01, trusted=True) == reported
    assert method_seconds(1.001 * most, reported, 0.01, trusted=True) == pytest.approx(1.001 * most - 0.01)


def test_what_a_program_of_others_reports_is_its_claim() -> None:
    assert method_seconds(0.5, 1e-9, 0.01, trusted=False) == 0.49
    assert method_seconds(0.005, 1e-9, 0.01, trusted=False) == 0.0


def test_a_served_solver_is_marked_with_its_round_trip() -> None:
    rows = rows_of.normalised(
        pd.DataFrame([*(row(p, "guest", "solved", 1.0, trip=5e-5) for p in "ab"), row("a", "own", "solved", 1.0)])
    )
    [found] = rankings(rows)
    assert {one.solver: one.warnings for one in found.rows} == {"guest": ("served (round trip 50 µs)",), "own": ()}


def _loaded(loads: list[float]) -> pd.DataFrame:
    return rows_of.normalised(table(*(row(str(k), "s", "solved", 1.0) for k in range(len(loads))))).assign(
        loadavg=loads
    )


@pytest.mark.parametrize(("busy", "said"), [(0, False), (1, False), (2, True), (4, True)])
def test_a_load_beyond_the_cores_is_reported_from_a_tenth_of_the_rows(busy: int, said: bool) -> None:
    found = cautions.disturbance(_loaded([2.5] * busy + [2.0] * (20 - busy)), {"machine": {"threads": 2}})
    assert bool(found) == said
    assert (f"beyond the 2 cores at {busy} of 20 pairs (up to 2.5)" in found) == said


@pytest.mark.parametrize(("drift", "said"), [(1.0, False), (1.45, False), (1.55, True), (3.0, True)])
def test_a_drift_of_the_machine_is_reported_beyond_a_half(drift: float, said: bool) -> None:
    about = meta(references=[{"seconds": 0.01}, {"seconds": 0.01 * drift}, {"seconds": None}])
    assert bool(cautions.disturbance(_loaded([1.0]), about)) == said


def test_times_of_kernels_that_are_not_compiled_are_not_relied_on() -> None:
    about = {"machine": {"kernels": "NOT compiled, or changed since: cpbench_solvers.kernels. Python runs them"}}
    warning = cautions.disturbance(_loaded([1.0]), about)
    assert warning == "Do not rely on these times: kernels are NOT compiled, or changed since: cpbench_solvers.kernels."
