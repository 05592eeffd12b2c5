"""Compiles the kernels of solvers while others are timed: in a separate process, on cores where nothing is timed.

With an empty cache a solver takes seconds to compile, all solvers of cpbench minutes. A worker reports that it has to
compile, and is dropped; its pairs are put off until the kernels are in the cache.
"""

from __future__ import annotations

import contextlib
import os
from collections import deque
from collections.abc import Sequence

from cpbench.bench.processes.channel import Channel
from cpbench.bench.processes.launch import Context
from cpbench.bench.processes.process import Child, Died, TimedOut
from cpbench.foundation import frames
from cpbench.solvers.base import solvers

NICE = 10
"""Its niceness: the referee, which works on the same cores, goes first."""


class Compiler:
    """The solvers that wait for their kernels, and the process that compiles one after the other.

    cpus : cores on which it works; without any it compiles nothing. A solver that was `tried` and still has to compile
        is waited for.
    """

    def __init__(self, context: Context, cpus: Sequence[int]) -> None:
        self._context, self._cpus = context, tuple(cpus)
        self._queue: deque[str] = deque()
        self._now: str | None = None
        self._child: Child | None = None
        self.tried: set[str] = set()

    def takes(self, name: str) -> bool:
        """Return whether it can compile a solver."""
        return bool(self._cpus) and name not in self.tried

    def add(self, name: str) -> None:
        """Compile a solver, after those that wait already."""
        self.tried.add(name)
        self._queue.append(name)
        self._go_on()

    def waits(self, name: str) -> bool:
        """Return whether a solver waits to be compiled, or is being compiled."""
        self._go_on()
        return name == self._now or name in self._queue

    def give_back(self) -> None:
        """Drop the last solver that waits: nothing else is left to run, so that its worker may compile as well."""
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
        """Check whether it is done, and give it the next solver. A failure is left to the worker, which reports why."""
        try:
            if self._now is not None and self._child is not None:
                with contextlib.suppress(TimedOut):
                    reply, _ = frames.unpack(self._child.receive(0.0))
                    self._now = None if reply.get("solver") == self._now else self._now
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
        with contextlib.suppress(Exception):  # the worker meets the same error, and reports it
            solvers.get(asked["solver"]).warmup()
        connection.send_bytes(frames.pack(asked))
