"""A piece of work in a fork of this process, within limits of time and memory that the system keeps.

An alarm that nothing catches ends the fork, whatever it is doing, and its address space is limited. It says in which
phase of its work it is, and each phase has its own limits.
"""

from __future__ import annotations

import contextlib
import json
import os
import resource
import signal
from collections.abc import Callable, Mapping
from typing import Any

from cpbench.bench.processes.isolation import address_space, die_with_parent, memory_around
from cpbench.foundation.child_processes import fork

FIRST, SOLVE, WARMING = "read", "solve", "warm-up"
"""The phase that the work begins in; the solve, whose memory is limited by itself; and what is loaded before it."""
NEVER = 1e8
"""Seconds of an alarm where a phase has no limit: those of three years."""


class Stopped(Exception):
    """End of a process that gave no answer: in which `phase`, and its return `code`, None where it was ended at the
    limit of the phase."""

    def __init__(self, phase: str, code: int | None) -> None:
        self.phase, self.code = phase, code
        super().__init__(phase, code)


class Work:
    """The side of the process that works: it says what it is doing, and the system limits that.

    limits : the seconds of each phase, of all its parts together. memory : bytes of a solve, 0 for no limit; what is
    around it has more (`memory_around`).
    """

    def __init__(self, descriptor: int, limits: Mapping[str, float], memory: int) -> None:
        self._descriptor, self._memory = descriptor, memory
        self._left = {phase: min(seconds, NEVER) for phase, seconds in limits.items()}
        self._solving = 0
        self.phase = FIRST
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        self._allow(address_space() + memory_around(memory))
        signal.setitimer(signal.ITIMER_REAL, self._left[FIRST])

    def say(self, **note: Any) -> None:
        """Send a note to the process that waits."""
        data = json.dumps(note).encode() + b"\n"
        while data:
            data = data[os.write(self._descriptor, data) :]

    def begin(self, phase: str) -> None:
        """Begin a phase, or go on with it."""
        if phase == SOLVE:
            self._solving = address_space() + self._memory
        self._enter(phase)

    def _enter(self, phase: str) -> None:
        self._left[self.phase], _ = signal.setitimer(signal.ITIMER_REAL, 0.0)
        self.phase = phase
        self.say(phase=phase)
        self._allow(self._solving if phase == SOLVE else address_space() + memory_around(self._memory))
        signal.setitimer(signal.ITIMER_REAL, max(self._left[phase], 1e-6))

    def _allow(self, limit: int) -> None:
        if self._memory > 0:
            hard = resource.getrlimit(resource.RLIMIT_AS)[1]
            resource.setrlimit(resource.RLIMIT_AS, (limit if hard < 0 else min(limit, hard), hard))


def run_alone(
    work: Callable[[Work], Mapping[str, Any]],
    limits: Mapping[str, float],
    memory: int,
    on_note: Callable[[Mapping[str, Any]], None],
) -> Any:
    """Return what `work` returns in a fork of this process, with a session of its own; what it prints goes to stderr.

    `limits`, `memory` : as of `Work`. `on_note` : takes what the work says beside its phases.

    Raises Stopped where it ends without an answer.
    """
    reader, writer = os.pipe()

    def steps() -> None:
        os.setsid()
        die_with_parent(signal.SIGKILL)
        os.close(reader)
        os.dup2(2, 1)
        there = Work(writer, limits, memory)
        there.say(answer=work(there))

    child = fork(steps)
    os.close(writer)
    phase, answer = FIRST, None
    try:
        with os.fdopen(reader, encoding="utf-8") as notes:
            for line in notes:
                if not line.endswith("\n"):  # it ended meanwhile
                    break
                note = json.loads(line)
                phase, answer = note.pop("phase", phase), note.pop("answer", answer)
                if note:
                    on_note(note)
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    finally:  # after Ctrl-C too; what it started is of its session
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)
    if answer is None:
        raise Stopped(phase, None if code == -signal.SIGALRM else code)
    return answer
