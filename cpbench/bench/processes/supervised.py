"""A process that says which phase of its work it is in, and is killed at the limit of that phase.

It is this interpreter once more. Nothing here imports numerical packages: what supervises costs little beside the
process that works, which imports them meanwhile.
"""

from __future__ import annotations

import json
import os
import select
import subprocess
import time
from collections.abc import Callable, Mapping
from typing import Any, Self

from cpbench.errors import CpbenchError
from cpbench.foundation.child_processes import kill_tree, start_python, wait

LARGEST = 2**20
"""Bytes that are read at once."""
LAST_WORDS = 5.0
"""Seconds that a process has to end after it has closed its output."""


class Stopped(Exception):
    """End of a process that gave no answer: in which `phase`, and its return `code`, None where it was killed at the
    limit of the phase."""

    def __init__(self, phase: str, code: int | None) -> None:
        self.phase, self.code = phase, code
        super().__init__(phase, code)


class Supervised:
    """A process that runs `code`, which reads one line of JSON and writes lines of JSON.

    Each of these is ``{"phase": NAME}``, another note for `on_note`, or, with the key ``answer``, the last one.
    """

    def __init__(self, code: str, threads: int) -> None:
        self._process = start_python(code, threads=threads, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self._buffer = b""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Kill it with all that it started; harmless after its end."""
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                stream.close()
        kill_tree(self._process)

    def ask(
        self,
        asked: Mapping[str, Any],
        first: str,
        limits: Mapping[str, float],
        on_note: Callable[[Mapping[str, Any]], None],
    ) -> Any:
        """Send a request and return the answer.

        Parameters
        ----------
        first : the phase that it begins in. limits : the seconds of each phase, of all its parts together.

        Raises Stopped where it ends without an answer or a phase exceeds its limit.
        """
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps(asked).encode() + b"\n")
            self._process.stdin.flush()
        except OSError:
            raise Stopped(first, self._code()) from None
        phase, spent, since = first, dict.fromkeys(limits, 0.0), time.monotonic()
        while True:
            note = self._next(since + limits[phase] - spent[phase], phase)
            if "answer" in note:
                return note["answer"]
            if "phase" not in note:
                on_note(note)
                continue
            now = time.monotonic()
            spent[phase] += now - since
            phase, since = note["phase"], now

    def _next(self, deadline: float, phase: str) -> Mapping[str, Any]:
        """Return the next line; raises Stopped."""
        assert self._process.stdout is not None
        descriptor = self._process.stdout.fileno()
        while b"\n" not in self._buffer:
            left = min(deadline - time.monotonic(), 3600.0)
            if left <= 0:
                kill_tree(self._process)
                raise Stopped(phase, None)
            if not select.select([descriptor], [], [], left)[0]:
                continue
            data = os.read(descriptor, LARGEST)
            if not data:
                raise Stopped(phase, self._code())
            self._buffer += data
        line, _, self._buffer = self._buffer.partition(b"\n")
        try:
            return dict(json.loads(line))
        except ValueError:
            raise CpbenchError(f"the process that solves wrote no message: {line[:100]!r}") from None

    def _code(self) -> int:
        """Return the code of its end."""
        code = wait(self._process, LAST_WORDS)
        kill_tree(self._process)
        return 0 if code is None else code
