"""A fresh process for a piece of work: forked from one that is warm, so that it costs milliseconds.

What is forked has one thread and no solves behind it. It dies as it will; who forked it then ends the same way, so
that the runner meets one kind of death.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from typing import Any

from cpbench.bench.processes import guard


def run_forked(work: Callable[[], Any]) -> Any:
    """Do `work` in a process of its own; what it returns, which is data for JSON of at most 4 KiB.

    Whatever else that process does to end is what this one does then: a signal, an exit code.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    reader, writer = os.pipe()

    def reported() -> None:
        guard.begin()
        os.close(reader)
        value = work()
        os.write(writer, json.dumps(value).encode())

    child = os.fork()
    if child == 0:
        guard.finish(reported)
    os.close(writer)
    status = guard.reap(child)
    guard.kill_descendants()
    os.set_blocking(reader, False)  # a child of the child may hold the other end
    try:
        told = os.read(reader, 2**12)
    except BlockingIOError:
        told = b""
    os.close(reader)
    if status or not told:
        guard.end_as(status)
    return json.loads(told)
