"""A piece of work in a process forked from a warm one, which costs milliseconds.

The process that is forked has one thread and has solved nothing. However its fork ends, it then ends the same way, so
that the runner meets one kind of death.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from typing import Any

from cpbench.bench.processes import guard
from cpbench.foundation.child_processes import fork


def run_forked(work: Callable[[], Any]) -> Any:
    """Return what `work` returns in a separate process, data for JSON of at most 4 KiB.

    Where that process ends by a signal or an exit code, this one ends by the same.
    """
    reader, writer = os.pipe()

    def reported() -> None:
        guard.begin()
        os.close(reader)
        value = work()
        os.write(writer, json.dumps(value).encode())

    child = fork(reported)
    os.close(writer)
    status = guard.reap(child)
    guard.kill_descendants()
    os.set_blocking(reader, False)  # a child of the child may hold the other end
    try:
        answer = os.read(reader, 2**12)
    except BlockingIOError:
        answer = b""
    os.close(reader)
    if status or not answer:
        guard.end_as(status)
    return json.loads(answer)
