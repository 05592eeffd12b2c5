"""A process between the runner and a worker: it adopts and ends what a solver leaves behind, and ends as it ended.

A solver that kills or stops its parent hits its own guard, not the runner or the forkserver. Orphans come
to the guard because it is a child subreaper, and a pipe tells it that the runner has ended.
"""

from __future__ import annotations

import contextlib
import os
import select
import signal
import time
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from typing import NoReturn

import psutil

from cpbench.bench.processes import isolation
from cpbench.foundation.child_processes import fork

PATIENCE = 5.0
"""Seconds for which processes that do not die are killed again and again."""
LONGEST = 0.02
"""Seconds between two looks whether they are dead."""


def run_guarded(lifeline: Connection, release: Callable[[], None], work: Callable[[], None]) -> NoReturn:
    """Do `work` in a fork, the worker; guard that until it ends, and end as it did.

    Parameters
    ----------
    lifeline : the reading end of a pipe whose other end only the runner has.
    release : closes what is the worker's alone: no other process is to hold its connection open.
    """
    isolation.adopt_orphans()
    isolation.die_with_parent(signal.SIGTERM)  # the forkserver, should that alone be killed
    signal.signal(signal.SIGTERM, lambda *_: _end_all())
    ended = _ChildEnded()

    def worker_steps() -> None:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        ended.close()
        lifeline.close()
        os.setpgid(0, 0)
        isolation.adopt_orphans()
        isolation.die_with_parent(signal.SIGKILL)
        work()

    worker = fork(worker_steps)
    release()
    poll = select.poll()
    poll.register(lifeline, 0)  # a hang-up is always reported
    poll.register(ended.reader, select.POLLIN)
    while (status := _exit_status(worker)) is None:
        ready = [descriptor for descriptor, _ in poll.poll()]
        if lifeline.fileno() in ready:
            _end_all()
        ended.clear()
    kill_descendants()
    end_as(status)


class _ChildEnded:
    """A pipe in which a byte lies whenever a child has ended (SIGCHLD), so that `poll` can wait for that too."""

    def __init__(self) -> None:
        self.reader, self._writer = os.pipe()
        os.set_blocking(self.reader, False)
        os.set_blocking(self._writer, False)
        signal.signal(signal.SIGCHLD, lambda *_: None)
        signal.set_wakeup_fd(self._writer, warn_on_full_buffer=False)

    def clear(self) -> None:
        with contextlib.suppress(BlockingIOError):
            os.read(self.reader, 2**12)

    def close(self) -> None:
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        os.close(self.reader)
        os.close(self._writer)


def _exit_status(worker: int) -> int | None:
    """Reap all children that have ended; return the wait status of the worker, None while it lives."""
    while True:
        ended, status = os.waitpid(-1, os.WNOHANG)
        if ended in (0, worker):
            return status if ended else None


def pauses(seconds: float) -> Iterator[bool]:
    """Yield True at once, and again after a pause, until so many seconds are over; each pause is longer than the last.

    To look without a pause would slow down what is waited for: to end a large process takes a processor, too.
    """
    deadline, pause = time.monotonic() + seconds, 0.001
    while time.monotonic() < deadline:
        yield True
        time.sleep(pause)
        pause = min(2.0 * pause, LONGEST)


def kill_descendants() -> None:
    """Kill all descendants of this process (SIGKILL), until none is left."""
    passing = pauses(PATIENCE)
    while has_children() and next(passing, False):
        for process in descendants(psutil.Process()):
            with contextlib.suppress(psutil.Error):
                process.kill()


def end_as(status: int) -> NoReturn:
    """End this process by the same signal or code as one with this wait status."""
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        with contextlib.suppress(OSError):  # SIGKILL has no handler to take away
            signal.signal(number, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [number])
        os.kill(os.getpid(), number)
    os._exit(os.waitstatus_to_exitcode(status) & 0xFF)


def end_like(code: int) -> NoReturn:
    """End this process as one with this return code of `subprocess`; 0 too, which is not an answer."""
    end_as(-code if code < 0 else code << 8)


def has_children() -> bool:
    """Return whether a child lives, after those that have ended were reaped."""
    try:
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass
    except ChildProcessError:
        return False
    return True


def descendants(process: psutil.Process) -> list[psutil.Process]:
    """Return the descendants of a process; where the system lists children, without a look at all its processes."""
    try:
        ids = below(process.pid)
    except OSError:
        return process.children(recursive=True)
    result: list[psutil.Process] = []
    for pid in ids:
        with contextlib.suppress(psutil.Error):
            result.append(psutil.Process(pid))
    return result


def count_below(pid: int) -> int:
    """Return the number of descendants of a process, 0 where the system does not list children.

    It is called 20 times a second while a solver runs: a look at all processes would take milliseconds.
    """
    try:
        return len(below(pid))
    except OSError:
        return 0


def below(pid: int) -> list[int]:
    """Return the ids of the descendants of a process; raises OSError where the system does not list children."""
    result: list[int] = []
    for task in os.listdir(f"/proc/{pid}/task"):
        with open(f"/proc/{pid}/task/{task}/children") as children:
            for child in map(int, children.read().split()):
                result.append(child)
                with contextlib.suppress(FileNotFoundError, ProcessLookupError):  # it ended meanwhile
                    result += below(child)
    return result


def _end_all() -> NoReturn:
    """Kill everything and end, because the runner is gone."""
    kill_descendants()
    os._exit(1)
