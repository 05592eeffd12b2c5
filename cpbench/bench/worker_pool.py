"""The processes of a slot: a referee, and one persistent worker a solver; replaced when they die, hang or are full."""

from __future__ import annotations

import contextlib
import time
from dataclasses import dataclass
from multiprocessing.context import ForkServerContext
from pathlib import Path
from typing import TypeVar

import cpbench.bench.referee as referee_process
import cpbench.bench.worker as worker_process
from cpbench.bench import messages
from cpbench.bench.processes.isolation import memory_around
from cpbench.bench.processes.process import Child, Died, TimedOut
from cpbench.bench.time_limits import START, WARM_UP
from cpbench.foundation import frames

Reply = TypeVar("Reply", bound=messages.Message)

AGAIN = 2
"""How often a request, or a start, is repeated with a fresh process after one died: the cause may lie elsewhere (where
memory is short Linux kills the largest process; what kills a parent ends its children)."""
PROCESSES = 64
"""Processes that a solver may have at a time, beside one for each thread: so many can be killed within half a second
after its limit, and a flood of more is stopped while it is small."""


@dataclass(frozen=True)
class Setting:
    """Settings that all processes of a slot have in common.

    Attributes
    ----------
    threads : threads of every numerical library, set before it is imported.
    memory : largest memory limit of any solve; the referee gets twice that.
    cpus : cores on which workers run, () for all; the referee runs elsewhere, since it would leave cold caches there.
    slots : number of slots side by side; a column of rows, since their times are not those of a quiet machine.
    """

    threads: int = 1
    memory: int = 4 * 2**30
    cpus: tuple[int, ...] = ()
    slots: int = 1

    @property
    def processes(self) -> int:
        """Number of processes that a solver may have at a time, its worker included."""
        return PROCESSES + self.threads


class RefereeClient:
    """Client of the referee process, which it starts again after a crash."""

    def __init__(self, context: ForkServerContext, setting: Setting, scratch: Path) -> None:
        self._context, self._scratch = context, scratch
        self._limit = memory_around(setting.memory)
        self.child: Child | None = None

    def ask(self, seconds: float, message: messages.Message, expected: type[Reply]) -> Reply | messages.Failure:
        """Send a message, again where the process died (`AGAIN`); return the reply, or why there is none."""
        data = messages.pack(message)
        reply = self._reply(seconds, data)
        for _ in range(AGAIN):
            if isinstance(reply, messages.Gone):
                reply = self._reply(seconds, data)
        if isinstance(reply, (expected, messages.Failure)):
            return reply
        return messages.Failed(f"the referee answered with {type(reply).__name__}")

    def _reply(self, seconds: float, data: bytes) -> messages.Message:
        try:
            if self.child is None:
                arguments = (str(self._scratch), self._limit)
                self.child = Child(self._context, referee_process.main, arguments)
            over = time.monotonic() + seconds
            self.child.send(data, seconds)
            reply = messages.unpack(self.child.receive(over - time.monotonic()))
            if not isinstance(reply, messages.OutOfMemory):
                return reply
        except TimedOut:
            reply = messages.Late(f"no reply within {seconds:g} s")
        except Died as death:
            reply = messages.OutOfMemory() if death.out_of_memory else messages.Gone(str(death))
        except frames.FrameError as noise:
            reply = messages.Gone(str(noise))
        self.close()  # its state is unknown; the next request starts a new one
        if isinstance(reply, messages.OutOfMemory):
            limited = f", limited to {self._limit} bytes" if self._limit else ""
            return messages.OutOfMemory(f"ran out of memory{limited}")
        return reply

    def close(self) -> None:
        child, self.child = self.child, None
        if child is not None:
            child.kill()


class WorkerPool:
    """Warm workers by solver, replaced when they die, hang or are full.

    Attributes
    ----------
    versions : versions of the solvers that were started. unavailable : why others cannot be started.
    """

    def __init__(self, context: ForkServerContext, setting: Setting, scratch: Path) -> None:
        self._context, self._setting, self._scratch = context, setting, scratch
        self._children: dict[str, Child] = {}
        self._memory: dict[str, int] = {}
        self._begun: dict[str, float] = {}
        self.versions: dict[str, str] = {}
        self.unavailable: dict[str, messages.SolverUnavailable] = {}

    @property
    def children(self) -> list[Child]:
        return list(self._children.values())

    def begin(self, name: str, memory: int) -> None:
        """Start a worker that will be needed soon: it warms up while the caller does something else."""
        if self.settled(name, memory):
            return
        self.drop(name)
        with contextlib.suppress(Died):  # `get` tries again, and reports why
            self._begin(name, memory)

    def get(self, name: str, memory: int, timeout: float = 0.0) -> Child | None:
        """Return the worker of a solver, with this memory limit; None where the solver is not available.

        timeout : limit of a solve, from which the limits of start and warm-up follow.
        """
        if not self.settled(name, memory):
            self.drop(name)
        if not self.ready(name, memory):
            reply = self._warmed_up(name, memory, timeout)
            for _ in range(AGAIN):
                if isinstance(reply, messages.Gone):
                    reply = self._warmed_up(name, memory, timeout)
            if isinstance(reply, messages.SolverUnavailable):
                self.unavailable[name] = reply
            elif isinstance(reply, messages.Failure):
                self.unavailable[name] = messages.SolverUnavailable(reply.message)
            if not isinstance(reply, messages.Ready):
                return None
            self.versions[name] = reply.version
        return self._children.get(name)

    def settled(self, name: str, memory: int) -> bool:
        """Return whether `get` needs no new process: it has a worker, or the solver is unavailable."""
        child = self._children.get(name)
        return name in self.unavailable or (child is not None and self._memory[name] == memory and child.alive)

    def ready(self, name: str, memory: int) -> bool:
        """Return whether `get` returns at once."""
        return self.settled(name, memory) and name not in self._begun

    def drop(self, name: str) -> None:
        child = self._children.pop(name, None)
        self._begun.pop(name, None)
        if child is not None:
            child.kill()

    def close(self) -> None:
        for name in list(self._children):
            self.drop(name)

    def _warmed_up(self, name: str, memory: int, timeout: float) -> messages.Ready | messages.Failure:
        """Wait until a new worker is ready, and drop it where it fails."""
        phase, reply = START, None
        try:
            if name not in self._begun:
                self._begin(name, memory)
            child, begun = self._children[name], self._begun.pop(name)
            reply = hear(child, max(begun + START.limit(timeout) - time.monotonic(), 0.0))
            if isinstance(reply, messages.WarmingUp):
                phase = WARM_UP
                reply = hear(child, WARM_UP.limit(timeout))
            if isinstance(reply, messages.Ready):
                return reply
            if not isinstance(reply, messages.SolverUnavailable):
                reply = messages.Failed(f"expected Ready, received {reply!s:.200}")
        except TimedOut:
            reply = messages.Late(f"{phase.name} not over after {phase.limit(timeout):g} s")
        except Died as death:
            reply = messages.Gone(str(death))
        except frames.FrameError as noise:
            reply = messages.Failed(str(noise))
        self.drop(name)
        return reply

    def _begin(self, name: str, memory: int) -> None:
        """Start the process; raises Died where the system refuses."""
        setting = self._setting
        arguments = (name, memory, str(self._scratch))
        self._children[name] = Child(
            self._context, worker_process.main, arguments, cpus=setting.cpus, processes=setting.processes
        )
        self._memory[name], self._begun[name] = memory, time.monotonic()


def hear(worker: Child, seconds: float) -> messages.Message:
    """Return the next message of a worker; raises as `Child.receive` does, and FrameError."""
    return messages.unpack(worker.receive(seconds), frames.UNTRUSTED_HEADER)
