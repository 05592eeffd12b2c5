"""A process between the runner and a worker: it adopts and ends what a solver leaves behind, and ends as it ended.

Runner, forkserver, guard, worker: a solver that kills or stops its parent meets its own guard and nobody else's.
Linux only: orphans come to it because it is a child subreaper, and it learns of the runner's death by a pipe.
"""

from __future__ import annotations

import contextlib
import os
import select
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from typing import NoReturn

import psutil

from cpbench.bench.processes import cgroup, isolation

PATIENCE = 5.0
"""Seconds for which processes that do not die are killed again and again."""
LONGEST = 0.02
"""Seconds between two looks whether they are dead."""


def stand(group: str, lifeline: Connection, release: Callable[[], None]) -> None:
    """Fork; return in the child, the worker. The parent guards it and never returns.

    `group` is the control group of the worker, "" for none; the guard stays out of it, to bury who dies in it.
    `lifeline` is the reading end of a pipe whose other end only the runner has. `release` closes what is the
    worker's alone: nobody else is to hold its connection open.
    """
    isolation.adopt_orphans()
    isolation.die_with_parent(signal.SIGTERM)  # the forkserver, should that alone be killed
    signal.signal(signal.SIGTERM, lambda *_: _end_all(group))
    bell = _Bell()
    worker = os.fork()
    if worker == 0:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        bell.close()
        lifeline.close()
        if group:
            cgroup.join(group)
        begin()
        return
    release()
    poll = select.poll()
    poll.register(lifeline, 0)  # its hang-up is always told
    poll.register(bell.reader, select.POLLIN)
    while (status := _ended(worker)) is None:
        ready = [descriptor for descriptor, _ in poll.poll()]
        if lifeline.fileno() in ready:
            _end_all(group)
        bell.clear()
    kill_descendants()
    end_as(status)


class _Bell:
    """A pipe in which a byte lies whenever a child has ended."""

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


def _ended(worker: int) -> int | None:
    """Wait status of the worker, None while it lives; all others that have ended are buried."""
    while True:
        ended, status = os.waitpid(-1, os.WNOHANG)
        if ended in (0, worker):
            return status if ended else None


def begin() -> None:
    """First steps of who runs a solver: a group of its own, its orphans come to it, it dies with its parent."""
    os.setpgid(0, 0)
    isolation.adopt_orphans()
    isolation.die_with_parent(signal.SIGKILL)


def reap(child: int) -> int:
    """Wait until `child` ends, burying all others that end before; its wait status."""
    while True:
        ended, status = os.waitpid(-1, 0)
        if ended == child:
            return status


def pauses(seconds: float) -> Iterator[bool]:
    """Yield True at once, and again after a pause, until so many seconds are over; each pause is longer than the last.

    Who looks for the dying all the time keeps them from it: to end a large process takes a processor, too.
    """
    deadline, pause = time.monotonic() + seconds, 0.001
    while time.monotonic() < deadline:
        yield True
        time.sleep(pause)
        pause = min(2.0 * pause, LONGEST)


def kill_descendants() -> None:
    """SIGKILL to all that descend from this process, until nobody is left."""
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
    """End this process as one with this return code of `subprocess`; 0 too, which is no answer."""
    end_as(-code if code < 0 else code << 8)


def finish(work: Callable[[], None]) -> NoReturn:
    """Run `work` and end this forked process, with the exit code that Python gives to what it raised."""
    code = 0
    try:
        work()
    except SystemExit as leave:
        code = leave.code if isinstance(leave.code, int) else int(leave.code is not None)
        if isinstance(leave.code, str):
            print(leave.code, file=sys.stderr)
    except BaseException:
        code = 1
        with contextlib.suppress(BaseException):
            traceback.print_exc()
    with contextlib.suppress(BaseException):
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(code & 0xFF)


def has_children() -> bool:
    """Return whether a child lives; those that have ended are buried."""
    try:
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass
    except ChildProcessError:
        return False
    return True


def descendants(process: psutil.Process) -> list[psutil.Process]:
    """Return all that descend from a process; where the system lists them, without a look at all processes there
    are."""
    try:
        ids = below(process.pid)
    except OSError:
        return process.children(recursive=True)
    found: list[psutil.Process] = []
    for pid in ids:
        with contextlib.suppress(psutil.Error):
            found.append(psutil.Process(pid))
    return found


def count_below(pid: int) -> int:
    """Return how many processes descend from another one, 0 where the system does not list children.

    It is asked 20 times a second while a solver runs: a look at every process there is would take milliseconds.
    """
    try:
        return len(below(pid))
    except OSError:
        return 0


def below(pid: int) -> list[int]:
    """Ids of all that descend from a process; raises OSError where the system does not list them."""
    found: list[int] = []
    for task in os.listdir(f"/proc/{pid}/task"):
        with open(f"/proc/{pid}/task/{task}/children") as children:
            for child in map(int, children.read().split()):
                found.append(child)
                with contextlib.suppress(FileNotFoundError, ProcessLookupError):  # it ended meanwhile
                    found += below(child)
    return found


def _end_all(group: str) -> NoReturn:
    """Return the runner is gone: nobody stays behind."""
    if group:
        with contextlib.suppress(OSError), open(os.path.join(group, "cgroup.kill"), "w") as kill:
            kill.write("1")
    kill_descendants()
    os._exit(1)
