"""Isolates the process that calls it: its cores, limits of its memory, and what becomes of orphans."""

from __future__ import annotations

import contextlib
import ctypes
import os
import resource
import signal
import sys
from collections.abc import Sequence

import psutil

AROUND_SHARE = 2
"""Memory limit of the work around solves as a multiple of a solve's: it holds a problem with all its conversions."""
AROUND_LEAST = 2 * 2**30
"""Bytes that this work may use at least, however low the limit of solvers is."""
_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36


def pin(cpus: Sequence[int]) -> None:
    """Restrict this process and all that it starts to cores; () are all."""
    if cpus:
        os.sched_setaffinity(0, cpus)


def die_with_parent(by: signal.Signals) -> None:
    """Have this process get a signal when the thread that forked it ends."""
    _prctl(_PR_SET_PDEATHSIG, int(by))


def adopt_orphans() -> None:
    """Become the parent of every descendant whose parent ends."""
    _prctl(_PR_SET_CHILD_SUBREAPER, 1)


def address_space() -> int:
    """Return the size of the address space [bytes], which RLIMIT_AS limits."""
    descriptor = os.open("/proc/self/statm", os.O_RDONLY)
    try:
        return int(os.read(descriptor, 64).split()[0]) * os.sysconf("SC_PAGE_SIZE")
    finally:
        os.close(descriptor)


def memory_around(memory: int) -> int:
    """Return the limit of the work around solves, conversions and judging, where a solve has `memory` bytes (0: none).

    >>> memory_around(4 * 2**30) == 8 * 2**30, memory_around(2**20) == 2 * 2**30, memory_around(0)
    (True, True, 0)
    """
    return max(AROUND_SHARE * memory, AROUND_LEAST) if memory > 0 else 0


def address_space_allowed() -> int:
    """Return the address space that the system allows a process (the hard limit of `ulimit -v`) [bytes]."""
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    return sys.maxsize if hard == resource.RLIM_INFINITY else hard


def limit_address_space(growth: int) -> None:
    """Limit further growth of the address space to `growth` bytes (0: no limit), that of child processes too; to less
    where the system allows less."""
    if growth <= 0:
        return
    hard = address_space_allowed()
    limit = min(address_space() + growth, hard)
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    # a limit is inherited at a fork only: what runs already (the program of a solver) has its own
    children: list[psutil.Process] = []
    with contextlib.suppress(psutil.Error):  # one process of somebody else that cannot be read ends the look at all
        children = psutil.Process().children(recursive=True)
    for child in children:
        with contextlib.suppress(psutil.Error):
            most = min(child.memory_info().vms + growth, hard)
            child.rlimit(psutil.RLIMIT_AS, (most, most))


def no_core_dumps() -> None:
    """Forbid core dumps, which would fill the disk when solvers crash."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _prctl(option: int, value: int) -> None:
    ctypes.CDLL(None).prctl(option, value, 0, 0, 0)
