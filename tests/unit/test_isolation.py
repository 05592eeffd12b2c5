"""Processes of a run are tied to cores and limited in memory; tests/faults has how they end."""

from __future__ import annotations

import os
import subprocess
import sys

from cpbench.bench.processes.launch import context
from cpbench.bench.processes.process import Child


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
