"""Who works in a lane: a referee, and one persistent worker a solver; replaced when they die, hang or are full."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cpbench.bench.referee as referee_process
import cpbench.bench.worker as worker_process
from cpbench.bench.processes import wire
from cpbench.bench.processes.launch import Context
from cpbench.bench.processes.process import Child, Died, TimedOut
from cpbench.bench.time_limits import START, WARM_UP

AGAIN = 2
"""How often a command, or a start, is repeated by a fresh process where one was found dead: it may have died of
something else (Linux kills what is largest where memory is short; what kills its parent kills it too)."""
PROCESSES = 64
"""How many processes a solver may have at a time, beside one a thread: so many are dead half a second after its limit,
and a flood of more is stopped while it is small."""
REFEREE_SHARE = 2
"""How many times the memory limit of a worker the referee has: it holds a problem with all its conversions."""
REFEREE_LEAST = 2 * 2**30
"""Bytes the referee has at least, however little a solver is to get by on."""


@dataclass(frozen=True)
class Setting:
    """What all processes of a lane have in common.

    Attributes
    ----------
    threads : of every numerical library, set before it is imported. memory : the largest limit of any solve; the
    referee gets twice that. fresh : a new process for every solve. cpus : where workers run, () for anywhere;
    the referee runs elsewhere, for it would leave them cold caches.
    lanes : how many work side by side; rows tell, for their times are not those of a quiet machine.
    single : one solve is all there will be: what it does not need is not loaded.
    """

    threads: int = 1
    memory: int = 4 * 2**30
    fresh: bool = False
    cpus: tuple[int, ...] = ()
    lanes: int = 1
    single: bool = False

    @property
    def referee_memory(self) -> int:
        """Bytes that conversions and judging may take (0: no limit)."""
        return max(REFEREE_SHARE * self.memory, REFEREE_LEAST) if self.memory > 0 else 0

    @property
    def processes(self) -> int:
        """How many a solver may have at a time, its worker included."""
        return PROCESSES + self.threads


class Referee:
    """The seat of the referee: who sits there may change, who asks need not know."""

    def __init__(self, context: Context, setting: Setting, scratch: Path) -> None:
        self._context, self._scratch = context, scratch
        self._limit = setting.referee_memory
        self.child: Child | None = None

    def ask(self, seconds: float, vectors: Mapping[str, Any] | None = None, **header: Any) -> Any:
        """Send a command; the reply's header and vectors, whatever it is: `timeout`, `died`, `memory` are replies too.

        Who is found dead may have died of something else: a command is repeated (`AGAIN`).
        """
        message = wire.pack(header, vectors)
        reply, found = self._asked(seconds, message)
        for _ in range(AGAIN):
            if reply["event"] == "died":
                reply, found = self._asked(seconds, message)
        return reply, found

    def _asked(self, seconds: float, message: bytes) -> tuple[dict[str, Any], dict[str, Any]]:
        try:
            if self.child is None:
                arguments = (str(self._scratch), self._limit)
                self.child = Child(self._context, referee_process.main, arguments, memory=self._limit)
            over = time.monotonic() + seconds
            self.child.send(message, seconds)
            reply, found = wire.unpack(self.child.receive(over - time.monotonic()))
            self.child.warm()
            if reply["event"] != "memory":
                return reply, found
        except TimedOut:
            reply = {"event": "timeout", "message": f"no reply within {seconds:g} s"}
        except Died as death:
            reply = {"event": "memory" if death.out_of_memory else "died", "message": obituary(death)}
        except wire.WireError as noise:
            reply = {"event": "died", "message": str(noise)}
        self.close()
        if reply["event"] == "memory":
            limited = f", limited to {self._limit} bytes" if self._limit else ""
            reply["message"] = f"ran out of memory{limited}"
        return reply, {}

    def close(self) -> None:
        child, self.child = self.child, None
        if child is not None:
            child.kill()


class Workers:
    """The warm workers, by solver.

    Attributes
    ----------
    versions : of the solvers that were started. unavailable : state and detail of those that cannot be.
    """

    def __init__(self, context: Context, setting: Setting, scratch: Path) -> None:
        self._context, self._setting, self._scratch = context, setting, scratch
        self._children: dict[str, Child] = {}
        self._memory: dict[str, int] = {}
        self._single: dict[str, bool] = {}
        self._begun: dict[str, float] = {}
        self._holds: dict[str, str] = {}
        self.versions: dict[str, str] = {}
        self.unavailable: dict[str, tuple[str, str]] = {}

    @property
    def children(self) -> list[Child]:
        return list(self._children.values())

    def begin(self, name: str, memory: int) -> None:
        """Start the process of a worker that will be asked for: it warms up while something else is done."""
        if self.settled(name, memory):
            return
        self.drop(name)
        with contextlib.suppress(Died):  # whoever asks for it tries again, and learns why
            self._begin(name, memory)

    def get(
        self,
        name: str,
        memory: int,
        timeout: float = 0.0,
        compiling: Callable[[], None] = lambda: None,
        *,
        patient: bool = True,
    ) -> Child | None:
        """The worker of a solver, with this memory limit; None where the solver is not available.

        timeout : of a solve, after which the limits of the start and the warm-up go. compiling : called when the worker
        has to compile before it is ready, which takes seconds and happens once a machine. patient : whether that is
        waited for; else such a worker is given up, and None.
        """
        if not self.settled(name, memory):
            self.drop(name)
        if not self.ready(name, memory):
            reply = self._hired(name, memory, timeout, compiling, patient)
            for _ in range(AGAIN):
                if reply["event"] == "died":
                    reply = self._hired(name, memory, timeout, compiling, patient)
            if reply["event"] == "compiling":
                return None
            if reply["event"] != "ready":
                self.unavailable[name] = (str(reply.get("state", "broken")), str(reply.get("detail", reply["event"])))
                return None
            self.versions[name] = str(reply.get("version", ""))
            self._single[name] = bool(reply.get("single"))
        return self._children.get(name)

    def settled(self, name: str, memory: int) -> bool:
        """Whether `get` needs no new process: a worker with this limit is there, or there is none to be had."""
        child = self._children.get(name)
        return name in self.unavailable or (child is not None and self._memory[name] == memory and child.alive)

    def ready(self, name: str, memory: int) -> bool:
        """Whether `get` need not wait either."""
        return self.settled(name, memory) and name not in self._begun

    def loaded(self, name: str, path: str) -> None:
        """A worker has told that it holds this problem; a fresh process takes it along when it ends."""
        if not self._setting.fresh:
            self._holds[name] = path

    def holds(self, name: str, path: str) -> bool:
        """Whether a worker need not load a problem, nor say that it has."""
        return self._holds.get(name) == path

    def served(self, name: str) -> None:
        """After a request: a worker that serves only one makes room for the next."""
        if self._single.get(name):
            self.drop(name)

    def drop(self, name: str) -> None:
        child = self._children.pop(name, None)
        self._holds.pop(name, None)
        self._begun.pop(name, None)
        if child is not None:
            child.kill()

    def close(self) -> None:
        for name in list(self._children):
            self.drop(name)

    def _hired(
        self, name: str, memory: int, timeout: float, compiling: Callable[[], None], patient: bool
    ) -> dict[str, Any]:
        """What a new worker says when it is warm, or why it is not; it is dropped unless it is ready."""
        phase = START
        try:
            if name not in self._begun:
                self._begin(name, memory)
            child, begun = self._children[name], self._begun.pop(name)
            reply, _ = hear(child, max(begun + START.limit(timeout) - time.monotonic(), 0.0))
            if reply["event"] == "warming":
                phase, over = WARM_UP, time.monotonic() + WARM_UP.limit(timeout)
                reply, _ = hear(child, over - time.monotonic())
                if reply["event"] == "compiling":
                    compiling()
                    if not patient:
                        self.drop(name)
                        return reply
                    reply, _ = hear(child, over - time.monotonic())
            if reply["event"] not in ("ready", "unavailable"):
                raise wire.WireError(f"in place of being ready it says {str(reply)[:200]}")
            child.warm()
        except TimedOut:
            reply = {"event": "timeout", "detail": f"{phase.name} not over after {phase.limit(timeout):g} s"}
        except Died as death:
            reply = {"event": "died", "detail": obituary(death)}
        except (wire.WireError, KeyError) as noise:
            reply = {"event": "noise", "detail": str(noise)}
        if reply["event"] != "ready":
            self.drop(name)
        return reply

    def _begin(self, name: str, memory: int) -> None:
        """Start the process; raises Died where the system does not let it."""
        setting = self._setting
        arguments = (name, memory, setting.fresh, str(self._scratch))
        limits: dict[str, Any] = {"cpus": setting.cpus, "memory": memory, "processes": setting.processes}
        self._children[name] = Child(self._context, worker_process.main, arguments, **limits)
        self._memory[name], self._begun[name] = memory, time.monotonic()


def hear(worker: Child, seconds: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """The next message of a worker, which may be anything; raises as `Child.receive` and `wire.unpack` do."""
    return wire.unpack(worker.receive(seconds), wire.HEADER)


def obituary(death: Died) -> str:
    """What it died of, and its last words."""
    return f"{death.cause}: {death.output}" if death.output else death.cause
