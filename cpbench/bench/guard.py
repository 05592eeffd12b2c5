"""A process between the runner and a worker: it adopts and ends what a solver leaves behind, and ends as it ended.

Runner, forkserver, guard, worker: a solver that kills or stops its parent meets its own guard and nobody else's.
Linux only: orphans come to it because it is a child subreaper, and it learns of the runner's death by a signal.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import time
import traceback
from collections.abc import Callable
from typing import NoReturn

import psutil

from cpbench.bench import isolation

PATIENCE = 5.0
"""Seconds for which processes that do not die are killed again and again."""


def stand(cgroup: str, release: Callable[[], None]) -> None:
    """Fork; return in the child, the worker. The parent guards it and never returns.

    `release` closes what is the worker's alone: nobody else is to hold its connection open.
    """
    isolation.adopt_orphans()
    isolation.die_with_parent(signal.SIGTERM)
    signal.signal(signal.SIGTERM, lambda *_: _end_all(cgroup))
    worker = os.fork()
    if worker == 0:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        begin()
        return
    release()
    status = reap(worker)
    kill_descendants()
    end_as(status)


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


def kill_descendants() -> None:
    """SIGKILL to all that descend from this process, until nobody is left."""
    deadline = time.monotonic() + PATIENCE
    while has_children() and time.monotonic() < deadline:
        for process in psutil.Process().children(recursive=True):
            with contextlib.suppress(psutil.Error):
                process.kill()
        time.sleep(0.001)


def end_as(status: int) -> NoReturn:
    """End this process by the same signal or code as one with this wait status."""
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        with contextlib.suppress(OSError):  # SIGKILL has no handler to take away
            signal.signal(number, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [number])
        os.kill(os.getpid(), number)
    os._exit(os.waitstatus_to_exitcode(status) & 0xFF)


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
    """Whether a child lives; those that have ended are buried."""
    try:
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass
    except ChildProcessError:
        return False
    return True


def _end_all(group: str) -> NoReturn:
    """The runner is gone: nobody stays behind."""
    if group:
        with contextlib.suppress(OSError), open(os.path.join(group, "cgroup.kill"), "w") as kill:
            kill.write("1")  # this process too
    kill_descendants()
    os._exit(1)
