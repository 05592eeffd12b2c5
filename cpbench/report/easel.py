"""Figures drawn beside the report: by processes of their own while its sections are written.

A figure in three formats takes half a second of a core, and a report of many formulations has dozens. A process is
handed a function of this package and what to call it with, and tells by a line that the files are there. What it did
not draw, for whatever reason, is drawn here: an error is then raised where it belongs, and a machine with one core, or
where no process can be started, makes the same files.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Thread
from types import TracebackType
from typing import TYPE_CHECKING, Any

from cpbench.report import figures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FEW = 4
"""Figures up to which no process is worth its start."""
MOST = 4
"""The most processes."""
_COMMAND = "import sys; sys.path[:] = {path!r}; from cpbench.report.easel import work; work()"


@dataclass(frozen=True)
class Job:
    """Draw `make(*given)` and save it as `name` in `folder`."""

    folder: Path
    name: str
    make: Callable[..., Figure]
    given: tuple[Any, ...]

    def done(self) -> None:
        """Do it."""
        figures.save(self.make(*self.given), self.folder, self.name)


class Easel:
    """Takes figures to draw; all of them are there when it is left without an exception.

    Parameters
    ----------
    folder : where the files go. processes : the most that draw, one more whenever all are busy; None for as many as
    there are cores, at most MOST.
    few : figures up to which no process is started.
    """

    def __init__(self, folder: Path, processes: int | None = None, few: int = FEW) -> None:
        self._folder, self._few = folder, few
        self._count = min(cores(), MOST) if processes is None else processes
        self._queue: SimpleQueue[Job | None] = SimpleQueue()
        self._waiting: list[Job] = []
        self._left: SimpleQueue[Job] = SimpleQueue()
        self._hands: list[_Hand] = []

    def draw(self, name: str, make: Callable[..., Figure], *given: Any) -> None:
        """Have `make(*given)` saved as `name`; `make` is a function of a module."""
        self._waiting.append(Job(self._folder, name, make, given))
        if self._hands or (self._count > 1 and len(self._waiting) > self._few):
            if not self._hands or (len(self._hands) < self._count and not self._queue.empty()):
                self._hands.append(_Hand(self._queue, self._left))
            self._hand_over()

    def __enter__(self) -> Easel:
        return self

    def __exit__(self, kind: type[BaseException] | None, _: BaseException | None, __: TracebackType | None) -> None:
        for hand in self._hands:
            self._queue.put(None)
            if kind is not None:
                hand.stop()
        for hand in self._hands:
            hand.join()
        if kind is None:
            self._draw_here()

    def _hand_over(self) -> None:
        for job in self._waiting:
            self._queue.put(job)
        self._waiting.clear()

    def _draw_here(self) -> None:
        """What was never handed over, what came back, and what nobody was there to take."""
        for job in self._waiting:
            job.done()
        for queue in (self._left, self._queue):
            try:
                while True:
                    job = queue.get_nowait()
                    if job is not None:
                        job.done()
            except Empty:
                continue


class _Hand(Thread):
    """A process that draws, and the thread that hands it one job after another until there is None."""

    def __init__(self, queue: SimpleQueue[Job | None], left: SimpleQueue[Job]) -> None:
        super().__init__(daemon=True)
        self._queue, self._left = queue, left
        self._process = _started()
        self.start()

    def stop(self) -> None:
        """End the process, whatever it is drawing."""
        if self._process is not None:
            self._process.kill()

    def run(self) -> None:
        if self._process is None:
            return
        with contextlib.suppress(OSError), self._process:  # its pipe may be broken when it is closed
            while (job := self._queue.get()) is not None:
                if not _drawn(self._process, job):
                    self._left.put(job)
                    self._process.kill()
                    return


def _started() -> subprocess.Popen[bytes] | None:
    """A process that draws; None where none can be started."""
    command = [sys.executable, "-c", _COMMAND.format(path=sys.path)]
    try:
        return subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, bufsize=0
        )
    except OSError:
        return None


def _drawn(process: subprocess.Popen[bytes], job: Job) -> bool:
    """Whether the process has drawn it."""
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        told = memoryview(pickle.dumps(job))
        while told:
            told = told[process.stdin.write(told) :]
        return process.stdout.readline() == b"drawn\n"
    except (OSError, pickle.PicklingError, AttributeError, TypeError):  # the last three: cannot be handed over
        return False


def work() -> None:
    """Draw what comes in until nothing does: the other end of a `_Hand`."""
    told = os.fdopen(os.dup(sys.stdout.fileno()), "wb", buffering=0)
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # nobody else says anything there
    while True:
        try:
            job: Job = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        job.done()
        told.write(b"drawn\n")


def cores() -> int:
    """Those that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
