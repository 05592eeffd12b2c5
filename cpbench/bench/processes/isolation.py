"""Means of the system to isolate solvers: how processes start, are killed, and are limited in their memory.

Linux has all of them. Elsewhere processes are spawned, killed as a tree and measured from outside.
`CPBENCH_ISOLATION=spawn` does the same on Linux, which is how it is tested; `group` is Linux without control groups, as
where they belong to the administrator; `open` is Linux without Landlock, as with an older kernel: workers may then
write wherever their user may.
"""

from __future__ import annotations

import contextlib
import ctypes
import multiprocessing as mp
import os
import signal
import sys
from collections.abc import Sequence
from dataclasses import dataclass

import psutil

from cpbench.bench.processes import cgroup, landlock
from cpbench.errors import CpbenchError, UnknownName

VARIABLE = "CPBENCH_ISOLATION"
CHOICES = ("", "group", "open", "spawn")
AROUND_SHARE = 2
"""Memory limit of the work around solves as a multiple of a solve's: it holds a problem with all its conversions."""
AROUND_LEAST = 2 * 2**30
"""Bytes that this work may use at least, however low the limit of solvers is."""
_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36


@dataclass(frozen=True)
class Isolation:
    """The means of this system.

    Attributes
    ----------
    start : `forkserver` or `spawn`.
    kill : `cgroup` (cgroup.kill of cgroup v2), `group` (session and descendants) or `tree` (descendants).
    memory : `cgroup` (memory.max), `rlimit` (RLIMIT_AS) or `watch` (resident memory looked at from outside).
    guard : whether a process stands between runner and worker that adopts orphans and dies with the runner.
    affinity : whether a process can be tied to cores. output : whether what it prints is kept.
    cgroups : the folder in which control groups are made, "" for none.
    writes : `landlock` (workers write to folders of their own only) or `open`.
    """

    start: str
    kill: str
    memory: str
    guard: bool
    affinity: bool
    output: bool
    cgroups: str = ""
    writes: str = "open"

    @property
    def forks(self) -> bool:
        """Whether a warmed-up process may fork one for every solve."""
        return self.start == "forkserver"

    def described(self) -> list[tuple[str, str]]:
        """Return the means by name, each with what it implies."""
        return [(what, _MEANING[what][str(getattr(self, what))]) for what in _MEANING]


_MEANING = {
    "start": {
        "forkserver": "forkserver: a process starts in milliseconds, with the numerical packages loaded",
        "spawn": "spawn (no safe fork here): a new process imports everything anew, which takes seconds",
    },
    "kill": {
        "cgroup": "cgroup.kill (cgroup v2): a solver and all it started die at once, daemons too",
        "group": "session and descendants (no writable cgroup v2 here): repeated until none is left",
        "tree": "descendants, one by one: a child whose parent has ended is not found",
    },
    "memory": {
        "cgroup": "memory.max of cgroup v2: what is really used, of a solver and all it started",
        "rlimit": "RLIMIT_AS (no memory controller of cgroup v2 here): address space, of every process by itself",
        "watch": "resident memory, of every process by itself, looked at 20 times a second: a burst gets beyond it",
    },
    "guard": {
        "True": "orphans stay findable (child subreaper), and none outlives the runner (a pipe to it)",
        "False": "none: children of a solver whose parent ended, and those of a killed runner, may live on",
    },
    "forks": {
        "True": "one process a solve (fresh) is forked from a warm one, in milliseconds",
        "False": "one process a solve (fresh) is started and warmed up anew, in seconds",
    },
    "affinity": {
        "True": "workers can be tied to cores",
        "False": "workers cannot be tied to cores: timings are noisier",
    },
    "writes": {
        "landlock": "Landlock: workers write to their own temporary folder, caches and devices, to no other file",
        "open": "wherever their user may (no Landlock here, Linux 5.13): forged rows are found, not prevented",
    },
    "output": {
        "True": "both ends of what a solver prints are kept, through a pipe that the runner empties",
        "False": "what a solver prints is not kept",
    },
}


def detect(asked: str | None = None) -> Isolation:
    """Return the best means that work here, or those that `asked` or the environment name; raises UnknownName."""
    asked = os.environ.get(VARIABLE, "") if asked is None else asked
    if asked not in CHOICES:
        raise UnknownName(f"isolation in {VARIABLE}", asked, [c for c in CHOICES if c])
    posix = os.name == "posix"
    affinity = hasattr(os, "sched_setaffinity")
    # elsewhere fork is not safe: frameworks of macOS crash in the child, and Windows has none
    if asked == "spawn" or sys.platform != "linux" or "forkserver" not in mp.get_all_start_methods():
        return Isolation("spawn", "tree", "watch", guard=False, affinity=affinity, output=posix)
    folder = None if asked == "group" else cgroup.writable()
    memory = "cgroup" if folder is not None and folder.memory else "rlimit"
    return Isolation(
        "forkserver",
        "cgroup" if folder is not None else "group",
        memory,
        guard=True,
        affinity=affinity,
        output=posix,
        cgroups=str(folder.path) if folder is not None else "",
        writes="landlock" if asked != "open" and landlock.version() > 0 else "open",
    )


# --------------------------------------------------------------------------- what a process does to itself


def pin(cpus: Sequence[int]) -> None:
    """Restrict this process and all that it starts to cores; raises CpbenchError where that is not possible."""
    if not cpus:
        return
    if not hasattr(os, "sched_setaffinity"):
        raise CpbenchError(f"this system cannot tie processes to cores ({list(cpus)}): run without --cpus")
    os.sched_setaffinity(0, cpus)


def die_with_parent(by: signal.Signals) -> None:
    """Have this process get a signal when the thread that forked it ends (Linux)."""
    _prctl(_PR_SET_PDEATHSIG, int(by))


def adopt_orphans() -> None:
    """Become the parent of every descendant whose parent ends (Linux)."""
    _prctl(_PR_SET_CHILD_SUBREAPER, 1)


def address_space() -> int:
    """Return the size of the address space [bytes], which RLIMIT_AS limits; 0 where the system does not tell."""
    if sys.platform != "linux":
        return 0
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
    if os.name != "posix":
        return sys.maxsize
    import resource

    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    return sys.maxsize if hard == resource.RLIM_INFINITY else hard


def limit_address_space(growth: int) -> None:
    """Limit further growth of the address space to `growth` bytes, that of child processes too; to less where the
    system allows less."""
    import resource

    hard = address_space_allowed()
    limit = min(address_space() + growth, hard)
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    if sys.platform == "linux":
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
    if os.name == "posix":
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _prctl(option: int, value: int) -> None:
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(option, value, 0, 0, 0)
