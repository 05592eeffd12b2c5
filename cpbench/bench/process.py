"""One child process with hard limits: own process group, memory limit, output kept, killed with all its children.

Children come from a forkserver that has the numerical packages loaded, so that a respawn costs milliseconds.
They die with the runner: the forkserver ends when the runner does, and the kernel then kills its children.
"""

from __future__ import annotations

import contextlib
import ctypes
import multiprocessing as mp
import os
import resource
import signal
import sys
import time
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

from cpbench.bench.log import Log

THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMBA_NUM_THREADS",
    "RAYON_NUM_THREADS",
)
PRELOAD = ["numpy", "scipy.sparse.linalg", "scipy.linalg", "h5py", "cpbench.bench.worker"]
LOOK = 0.1
"""Seconds between two looks at the size of what a child prints."""
_PR_SET_PDEATHSIG = 1


class TimedOut(Exception):
    """No message within the limit."""


class Died(Exception):
    """The child ended: `signal` (a number) or `code`, and what it printed (first and last part)."""

    def __init__(self, code: int | None, output: str) -> None:
        self.signal = -code if code is not None and code < 0 else None
        self.code, self.output = code, output
        super().__init__(self.cause)

    @property
    def cause(self) -> str:
        if self.signal is not None:
            return f"killed by {signal.Signals(self.signal).name}"
        return f"exited with code {self.code}"

    @property
    def out_of_memory(self) -> bool:
        """Whether its last words were of an allocation that failed."""
        return "bad_alloc" in self.output or "MemoryError" in self.output


def context(threads: int) -> Any:
    """The forkserver context; thread counts are set before anything numerical is imported."""
    for variable in THREAD_VARIABLES:
        os.environ[variable] = str(threads)
    ctx = mp.get_context("forkserver")
    ctx.set_forkserver_preload(PRELOAD)
    return ctx


class Child:
    """A process running `target(connection, *args)` in its own session; what it prints goes to a `Log` in `folder`."""

    def __init__(
        self,
        ctx: Any,
        folder: Path,
        target: Callable[..., None],
        args: tuple[Any, ...],
        cpus: Sequence[int] = (),
    ) -> None:
        self._log = Log(folder)
        self._connection, theirs = ctx.Pipe()
        self._process = ctx.Process(target=_enter, args=(target, theirs, self._log.path, args, cpus), daemon=True)
        self._process.start()
        theirs.close()

    @property
    def pid(self) -> int:
        return int(self._process.pid or 0)

    def send(self, message: bytes) -> None:
        """Raises Died when nobody listens any more."""
        try:
            self._connection.send_bytes(message)
        except (BrokenPipeError, ConnectionError, OSError):
            raise self._death() from None

    def receive(self, seconds: float) -> bytes:
        """The next message; raises TimedOut after `seconds`, Died when the child has ended.

        The end of the process is waited for beside the pipe, which children of its own may hold open after it.
        """
        sources = [self._connection, self._process.sentinel]
        deadline = time.monotonic() + seconds
        while True:
            left = max(deadline - time.monotonic(), 0.0)
            try:
                ready = wait(sources, min(left, LOOK))
                if ready and self._connection.poll():  # what it sent before it died still counts
                    return self._connection.recv_bytes()
            except (EOFError, ConnectionError, OSError):
                raise self._death() from None
            self._log.trim()
            if ready:
                raise self._death()
            if left == 0.0:
                raise TimedOut

    def output(self) -> str:
        """What the child printed since the last call, first and last part."""
        return self._log.take()

    def strike(self) -> None:
        """SIGKILL to the whole process group; who waits for its messages learns of the death."""
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self.pid, signal.SIGKILL)
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.kill(self.pid, signal.SIGKILL)

    def kill(self) -> None:
        """SIGKILL to the whole process group, reaped; the log is removed."""
        self.strike()
        self._process.join(10.0)
        self._connection.close()
        self._log.close()

    def _death(self) -> Died:
        deadline = time.monotonic() + 5.0
        while self._process.exitcode is None and time.monotonic() < deadline:
            self._process.join(0.05)
        return Died(self._process.exitcode, self.output())


def _enter(
    target: Callable[..., None], connection: Connection, log: str, args: tuple[Any, ...], cpus: Sequence[int]
) -> None:
    """First steps of every child: a session of its own, its cores, death with its parent, output into the log."""
    os.setsid()
    if cpus:
        os.sched_setaffinity(0, cpus)
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the runner's to handle
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    descriptor = os.open(log, os.O_WRONLY | os.O_APPEND)
    os.dup2(descriptor, 1)
    os.dup2(descriptor, 2)
    target(connection, *args)


def limit_memory(growth: int) -> None:
    """Let the address space grow by at most `growth` bytes from what it is now (0: no limit)."""
    if growth > 0 and sys.platform == "linux":
        limit = address_space() + growth
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


def address_space() -> int:
    """Bytes of this process's address space, what RLIMIT_AS counts (0 where the system does not say)."""
    if sys.platform != "linux":
        return 0
    return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
