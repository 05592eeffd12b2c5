"""Compiles the loops of solvers while others are timed: in a process of its own, on cores where nothing is timed.

Where the cache of kernels is empty a solver takes seconds to compile, all of cpbench's take minutes. Its worker says so
when it begins, and is given up; its pairs are put off until its loops lie in the cache.
"""

from __future__ import annotations

import contextlib
import os
from collections import deque
from collections.abc import Sequence

from cpbench import frames
from cpbench.bench.processes.channel import Channel
from cpbench.bench.processes.launch import Context
from cpbench.bench.processes.process import Child, Died, TimedOut
from cpbench.solvers.base import solvers

NICE = 10
"""How far it steps back behind the referee, which works on the same cores."""


class Compiler:
    """The solvers that wait for their loops, and the process that compiles one after the other.

    cpus : where it works; without any it takes nobody. Those that it has had are `tried`: whoever has to compile even
    then is waited for.
    """

    def __init__(self, context: Context, cpus: Sequence[int]) -> None:
        self._context, self._cpus = context, tuple(cpus)
        self._queue: deque[str] = deque()
        self._now: str | None = None
        self._child: Child | None = None
        self.tried: set[str] = set()

    def takes(self, name: str) -> bool:
        """Return whether a solver that has to compile may be left to it."""
        return bool(self._cpus) and name not in self.tried

    def add(self, name: str) -> None:
        """Compile its loops, after those that wait already."""
        self.tried.add(name)
        self._queue.append(name)
        self._go_on()

    def waits(self, name: str) -> bool:
        """Return whether its loops are not compiled yet."""
        self._go_on()
        return name == self._now or name in self._queue

    def give_back(self) -> None:
        """Let the last one go, for whoever waits has nothing else to do than to compile it; the others stay."""
        if self._queue:
            self._queue.pop()
        else:
            self._now = None

    def close(self) -> None:
        """End the process; harmless when done before."""
        self._queue.clear()
        self._now = None
        self._drop()

    def _go_on(self) -> None:
        """Hear whether it is done, and give it the next one. What fails is left to the worker, which says why."""
        try:
            if self._now is not None and self._child is not None:
                with contextlib.suppress(TimedOut):
                    told, _ = frames.unpack(self._child.receive(0.0))
                    self._now = None if told.get("solver") == self._now else self._now
            if self._now is None and self._queue:
                self._now = self._queue.popleft()
                if self._child is None:
                    self._child = Child(self._context, main, (), cpus=self._cpus)
                self._child.send(frames.pack({"solver": self._now}))
        except (Died, TimedOut, frames.FrameError):
            self._now = None
            self._drop()

    def _drop(self) -> None:
        child, self._child = self._child, None
        if child is not None:
            child.kill()


def main(connection: Channel) -> None:
    """Warm up each solver that is named, until the runner closes the connection."""
    with contextlib.suppress(AttributeError, OSError):
        os.nice(NICE)
    while True:
        try:
            asked, _ = frames.unpack(connection.recv_bytes())
        except EOFError:
            return
        with contextlib.suppress(Exception):
            solvers.get(asked["solver"]).warmup()
        connection.send_bytes(frames.pack(asked))
