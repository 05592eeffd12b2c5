"""Measures what a solve used beside time: memory, threads, children, and whether it wrote to its problem.

This happens outside the timed part, in less than 100 µs for small problems.
"""

from __future__ import annotations

import contextlib
import os
import resource
import threading
import time
import zlib
from typing import Any, cast

import numpy as np
import psutil
import scipy.sparse as sp

from cpbench.bench.processes import guard
from cpbench.bench.processes.isolation import address_space
from cpbench.formulations.base import Problem

BUSY = 0.05
"""Seconds from which on the ratio of CPU time to wall time counts the busy threads."""


class Meter:
    """A meter of this process, made when that is warm: what it has by then is not charged to a solve.

    helpers : its child processes when a solve begins: the program of a solver, and processes of that program that hold
        the problem. What they use in a solve is charged to the solve.
    """

    def __init__(self) -> None:
        self._space = address_space()
        self.helpers = descendants()
        self._there: int | None = None
        self._tasks, self._memory, self._faults = 1, 0, 0

    @property
    def children(self) -> int:
        """Number of running child processes beyond those at the beginning of the first solve.

        A program that holds each problem in a child has the same number at every solve; one that leaves a process
        behind for every problem has more at the second.
        """
        count = len(self.helpers) if self._there is None else self._there
        return max(guard.count_below(os.getpid()) - count, 0) if guard.has_children() else 0

    def cpu(self) -> float:
        """Return the CPU seconds of this process and its helpers, and of processes that they have waited for."""
        seconds = time.process_time()
        ended = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds += ended.ru_utime + ended.ru_stime
        for helper in self.helpers:
            with contextlib.suppress(psutil.Error):
                used = helper.cpu_times()
                seconds += used.user + used.system + used.children_user + used.children_system
        return seconds

    def begin(self) -> None:
        """Begin to measure, just before a solve, when the solver has the problem."""
        self.helpers = descendants()
        if self._there is None:
            self._there = len(self.helpers)
        self._tasks = _tasks()
        # else the peak is that of the largest problem so far, of whichever solve
        _forget_peak()
        for helper in self.helpers:
            _forget_peak(str(helper.pid))
        self._memory = self._peak()
        self._faults = _faults()

    def end(self, seconds: float, cpu: float) -> dict[str, Any]:
        """Return what was used, just after a solve that took these wall and CPU seconds.

        peak : resident memory [bytes] that it needed beyond what there was; None where processes took part that have
            ended, since the system keeps no such figure of them.
        grown : bytes of address space since the warm-up. threads : those that it started and left, or kept busy, its
            own included. children : processes that it started and that still run.
        """
        # threads that ended before the solve did are seen by the time that they took; in short solves the clocks are
        # too coarse
        busy = round(cpu / seconds) if seconds >= BUSY else 1
        return {
            # a page fault of a child that was waited for: some process took part and is gone
            "peak": max(self._peak() - self._memory, 0) if _faults() == self._faults else None,
            "grown": address_space() - self._space,
            "threads": max(1, 1 + _tasks() - self._tasks, busy),
            "children": self.children,
        }

    def _peak(self) -> int:
        return _peak() + sum(_peak_of(helper.pid) for helper in self.helpers)


def descendants() -> tuple[psutil.Process, ...]:
    """Return the running descendants of this process."""
    if not guard.has_children():
        return ()
    return tuple(guard.descendants(psutil.Process()))


def checksum(problem: Problem) -> int:
    """Return the CRC-32 of the numbers of a problem: arrays are read-only, but compiled code can write to them."""
    value = 0
    for matrix in problem.data().values():
        parts: list[Any] = [matrix.data, matrix.indices, matrix.indptr] if sp.issparse(matrix) else [matrix]
        for part in parts:
            value = zlib.crc32(cast(Any, np.ascontiguousarray(part)), value)
    for F in problem.maps().values():
        for part in F.arrays().values():
            value = zlib.crc32(cast(Any, part), value)
    return value


def _tasks() -> int:
    """Return the number of threads: a folder has a link from itself, its parent, and each folder in it."""
    try:
        return os.stat("/proc/self/task").st_nlink - 2
    except OSError:
        return threading.active_count()


def _forget_peak(process: str = "self") -> None:
    """Reset the high-water mark of resident memory."""
    try:
        descriptor = os.open(f"/proc/{process}/clear_refs", os.O_WRONLY)
    except OSError:
        return
    try:
        os.write(descriptor, b"5")
    finally:
        os.close(descriptor)


def _peak() -> int:
    """Return the high-water mark of resident memory since `_forget_peak` [bytes]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def _faults() -> int:
    """Return the page faults of all processes that this one has waited for: 0 means that there was no process."""
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    return ended.ru_minflt + ended.ru_majflt


def _peak_of(pid: int) -> int:
    """Return the high-water mark of another process [bytes], 0 where the system does not tell it."""
    try:
        with open(f"/proc/{pid}/status") as status:
            return next((1024 * int(line.split()[1]) for line in status if line.startswith("VmHWM")), 0)
    except OSError:
        return 0
