"""Work in a fork is ended at the limit of its phase, and what it loads is not in its solve."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import psutil
import pytest

from cpbench.bench.processes.alone import Stopped, Work, run_alone
from cpbench.bench.processes.launch import context
from cpbench.bench.processes.process import Child

LONG, SHORT = 600.0, 0.3


def ended(
    work: Callable[[Work], Mapping[str, Any]],
    notes: list[Mapping[str, Any]] | None = None,
    memory: int = 0,
    **limits: float,
) -> Any:
    """What the work answers within the limits of its phases."""
    every = {"read": LONG, "warm-up": LONG, "solve": LONG, "judge": LONG, **limits}
    return run_alone(work, every, memory, (notes if notes is not None else []).append)


def test_the_answer_comes_with_all_notes_before_it() -> None:
    notes: list[Mapping[str, Any]] = []

    def work(there: Work) -> dict[str, Any]:
        there.say(node="lcp")
        there.begin("solve")
        print("what a solver prints is no note")
        return {"numbers": list(range(10**5))}

    assert ended(work, notes)["numbers"][-1] == 10**5 - 1
    assert notes == [{"node": "lcp"}]


def test_a_phase_that_exceeds_its_limit_is_ended_with_all_that_it_started(tmp_path: Path) -> None:
    def work(there: Work) -> dict[str, Any]:
        child = subprocess.Popen(["sleep", "600"])
        (tmp_path / "ids").write_text(f"{os.getpid()} {child.pid}")
        there.begin("solve")
        time.sleep(600)
        return {}

    with pytest.raises(Stopped) as stopped:
        ended(work, solve=SHORT)
    assert (stopped.value.phase, stopped.value.code) == ("solve", None)
    ids = [int(pid) for pid in (tmp_path / "ids").read_text().split()]
    assert len(ids) == 2
    over = time.monotonic() + 60.0
    while any(map(_runs, ids)):  # one that is killed may be seen for a moment more
        assert time.monotonic() < over
        time.sleep(0.01)


def _runs(pid: int) -> bool:
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


@pytest.mark.parametrize(("end", "code"), [(lambda: sys.exit(3), 3), (lambda: os.kill(os.getpid(), 9), -9)])
def test_a_death_has_its_code_and_phase(end: Callable[[], object], code: int) -> None:
    def work(there: Work) -> dict[str, Any]:
        there.begin("judge")
        end()
        return {}

    with pytest.raises(Stopped) as stopped:
        ended(work)
    assert (stopped.value.phase, stopped.value.code) == ("judge", code)


def test_the_memory_of_a_solve_is_limited_by_itself() -> None:
    """256 MiB are too much where a solve has 128, and not before it."""

    def work(there: Work) -> dict[str, Any]:
        tried: dict[str, bool] = {}
        for phase in ("warm-up", "solve"):
            there.begin(phase)
            try:
                bytearray(2**28)
                tried[phase] = True
            except MemoryError:
                tried[phase] = False
        return tried

    assert ended(work, memory=2**27) == {"warm-up": True, "solve": False}


def _tell_cpus(connection) -> None:
    connection.send_bytes(repr(sorted(os.sched_getaffinity(0))).encode())


def test_a_child_is_tied_to_its_cores() -> None:
    core = max(os.sched_getaffinity(0))
    child = Child(context(1), _tell_cpus, (), cpus=(core,))
    try:
        assert child.receive(30.0) == b"[%d]" % core
    finally:
        child.kill()


def test_memory_is_limited_beside_a_process_that_cannot_be_read() -> None:
    """The system may refuse /proc/PID of somebody else, at which psutil gives up its look at all processes."""
    code = (
        "import resource, psutil\n"
        "def refused(*_, **__): raise psutil.AccessDenied(1)\n"
        "psutil.Process.children = refused\n"
        "from cpbench.bench.processes.isolation import address_space, limit_address_space\n"
        "before = address_space(); limit_address_space(2**30)\n"
        "print(0 <= resource.getrlimit(resource.RLIMIT_AS)[0] - before - 2**30 < 2**26)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.strip() == "True", done.stderr
