"""A program that is started once and answers every line of JSON on its stdin with one line of JSON on its stdout.

Whatever it does instead (nothing, too much, noise, dying) ends the session with an exception that says so. Its stderr
is passed on to ours, so that last words are found where those of a solver in this process would be.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import math
import os
import select
import subprocess
import time
import weakref
from collections.abc import Mapping, Sequence
from typing import Any, NoReturn

import psutil

from cpbench.errors import CpbenchError, Ended, NotApplicable, Unavailable
from cpbench.foundation.child_processes import end_descriptor, kill_tree, start, wait_by

LONGEST = 2**20
"""Bytes of a line that are taken."""
WORDS = 4000
"""Characters kept of what a program says."""
LAST_WORDS = 0.5
"""Seconds that a program has to end after it closed its stdout."""
PARTING = 0.5
"""Seconds which a program may take to quit."""
_LOOK = 0.05
"""Seconds between two looks at the process, where the system does not tell of its end."""
_CHUNK = 2**16
STATES = ("missing", "broken", "licence")

_open: weakref.WeakSet[Session] = weakref.WeakSet()


class ProgramError(CpbenchError):
    """A program answered with an error, with noise, with too much, or not at all."""


class Session:
    """One running program.

    Parameters
    ----------
    name : what it is called in messages. command : the executable and its arguments; no shell is involved.
    env : variables that it gets beside ours. cwd : its folder, None for ours.

    Raises Unavailable when it cannot be started.
    """

    def __init__(
        self, name: str, command: Sequence[str], env: Mapping[str, str] | None = None, cwd: str | None = None
    ) -> None:
        self.name = name
        self.holds: Any = None
        """The problem that the program has loaded."""
        self._rest, self._words = b"", b""
        self._passing_on = False
        try:
            pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
            self._process = start(command, env, cwd=cwd, bufsize=0, **pipes)
        except OSError as cause:
            state = "missing" if isinstance(cause, FileNotFoundError) else "broken"
            raise Unavailable(state, f"{command[0]}: cannot be started ({cause.strerror or cause})") from None
        stdin, stdout, stderr = self._process.stdin, self._process.stdout, self._process.stderr
        assert stdin is not None
        assert stdout is not None
        assert stderr is not None
        self._in, self._out, self._err = stdin.fileno(), stdout.fileno(), stderr.fileno()
        self._end = end_descriptor(self._process.pid)
        self._poll = select.poll()
        for descriptor in (self._in, self._out, self._err):
            # a program that neither reads nor writes must not hold up its limit: every wait is by `poll`, with a
            # deadline
            os.set_blocking(descriptor, False)
        for descriptor in (self._out, self._err, self._end):
            if descriptor is not None:
                self._poll.register(descriptor, select.POLLIN)
        self.alive = True
        _open.add(self)

    @property
    def words(self) -> str:
        """Last part of what the program wrote to stderr and was not passed on."""
        return self._words.decode(errors="replace").strip()[-WORDS:]

    def ended(self) -> bool:
        """Return whether the program has ended between requests."""
        if self.alive and self._end is not None:
            return any(descriptor == self._end for descriptor, _ in self._poll.poll(0))
        return not self.alive or self._code() is not None

    def pass_on(self) -> None:
        """Copy its stderr to ours from here on; what it wrote until now is dropped."""
        self._words, self._passing_on = b"", True

    def ask(self, do: str, seconds: float, /, **request: Any) -> dict[str, Any]:
        """Send a request; the reply. `seconds` may be infinite.

        Raises Ended, ProgramError, NotApplicable, Unavailable, MemoryError. Of these, a reply that says what is
        wrong leaves the program running; after anything else it is killed.
        """
        deadline = time.monotonic() + seconds
        line = json.dumps({"do": do, **request}, allow_nan=False).encode() + b"\n"
        try:
            # a reply that came without a request would be taken for that to the next one
            self._nothing_left(do)
            self._send(do, line, deadline, seconds)
            reply = self._reply(do, self._line(do, deadline, seconds))
        # what it says after that could belong to any request
        except BaseException:
            self.kill()
            raise
        self._raise(reply)
        return reply

    def close(self) -> None:
        """Tell the program to quit, and see to it; harmless when done before."""
        if self.alive:
            with contextlib.suppress(OSError):
                os.write(self._in, b'{"do": "quit"}\n')
            for pipe in (self._process.stdin, self._process.stdout):  # a reader that waits for more meets the end
                if pipe is not None:
                    pipe.close()
            wait_by(self._process, self._end, PARTING)
        self.kill()

    def kill(self) -> None:
        """Kill the program and all that it started (SIGKILL); harmless when done before."""
        if not self.alive:
            return
        self.alive = False
        kill_tree(self._process)
        self._pass(_read(self._err))
        for pipe in (self._process.stdin, self._process.stdout, self._process.stderr):
            if pipe is not None:
                pipe.close()
        if self._end is not None:
            os.close(self._end)

    # ------------------------------------------------------------------------------------------- within

    def _nothing_left(self, do: str) -> None:
        """Raise where the program has written without being asked: it is out of step from then on."""
        left = self._rest + _read(self._out)
        if left:
            raise ProgramError(f"{self.name}: printed {_shown(left)} before it was asked to {do}: {_ADVICE}")

    def _send(self, do: str, line: bytes, deadline: float, seconds: float) -> None:
        while line:
            try:
                line = line[os.write(self._in, line) :]
            except BlockingIOError:
                left = deadline - time.monotonic()
                if left <= 0:
                    raise ProgramError(f"{self.name}: did not read its stdin within {seconds:g} s") from None
                select.select([], [self._in], [], min(left, _LOOK))
            except BrokenPipeError:
                self._over(do)

    def _line(self, do: str, deadline: float, seconds: float) -> bytes:
        """Return the next line on its stdout; what it sent before it died still counts."""
        received = b""
        while True:
            ended = self._wait(do, deadline, seconds)
            while part := _read_once(self._out):
                received += part
                line, newline, rest = received.partition(b"\n")
                if newline:
                    self._rest = rest
                    return line
                if len(received) > LONGEST:
                    raise ProgramError(f"{self.name}: answered {do} with a line of more than {LONGEST} bytes")
            if part == b"" or ended:
                self._over(do, received)

    def _wait(self, do: str, deadline: float, seconds: float) -> bool:
        """Wait until there is something to read; whether the program has ended."""
        while True:
            left = deadline - time.monotonic()
            if left <= 0:
                raise ProgramError(f"{self.name}: did not answer {do} within {seconds:g} s")
            patience = min(left, _LOOK if self._end is None else 3600.0)
            ready = [descriptor for descriptor, _ in self._poll.poll(math.ceil(1000 * patience))]
            if self._err in ready:
                text = _read(self._err)
                if not text:  # closed, as programs may
                    self._poll.unregister(self._err)
                self._pass(text)
            if self._end in ready or (self._end is None and not ready and self._code() is not None):
                return True
            if self._out in ready:
                return False

    def _over(self, do: str, rest: bytes = b"") -> NoReturn:
        """Raise the exception for a program that ended, or closed its stdout or stdin."""
        code = wait_by(self._process, self._end, LAST_WORDS)
        # first the exit code: half a line before it is what a crash leaves
        if code:
            raise Ended(self.name, code)
        if rest.strip():
            raise ProgramError(f"{self.name}: answered {do} with {_shown(rest)} and no end of line: {_ADVICE}")
        if code == 0:
            raise Ended(self.name, code)
        # where another part of this process has reaped the child, its exit code is not known here
        if psutil.pid_exists(self._process.pid):
            raise ProgramError(f"{self.name}: was asked to {do}, closed its stdin or stdout, and went on without")
        raise ProgramError(f"{self.name}: ended before it answered {do}; its exit code is lost")

    def _code(self) -> int | None:
        return wait_by(self._process, self._end, 0.0)

    def _reply(self, do: str, line: bytes) -> dict[str, Any]:
        try:
            reply = json.loads(line)
        except (ValueError, RecursionError):
            reply = None
        if not isinstance(reply, dict) or not (
            reply.get("ok") is True or reply.keys() & {"error", "unsupported", "unavailable", "memory"}
        ):
            raise ProgramError(f"{self.name}: answered {do} with {_shown(line)}: {_ADVICE}")
        return reply

    def _raise(self, reply: Mapping[str, Any]) -> None:
        """Raise the exception that a reply other than ok stands for."""
        if "unavailable" in reply:
            state = reply.get("state")
            raise Unavailable(state if state in STATES else "broken", str(reply["unavailable"])[:WORDS])
        if "unsupported" in reply:
            raise NotApplicable(self.name, str(reply["unsupported"])[:WORDS])
        if "memory" in reply:
            raise MemoryError(f"{self.name}: {str(reply['memory'])[:WORDS]}")
        if "error" in reply:
            raise ProgramError(f"{self.name}: {str(reply['error'])[:WORDS]}")

    def _pass(self, text: bytes) -> None:
        if self._passing_on and text:
            with contextlib.suppress(OSError):
                os.write(2, text)
        else:
            self._words = (self._words + text)[-WORDS:]


_ADVICE = "every answer is one JSON object on a line of stdout with ok = true or what is wrong; the rest is for stderr"


def _read(descriptor: int) -> bytes:
    """Read all that can be read now, at most `LONGEST` bytes."""
    result = b""
    while (part := _read_once(descriptor)) and len(result) < LONGEST:
        result += part
    return result


def _read_once(descriptor: int) -> bytes | None:
    """Read some of what can be read now; None where that is nothing, b"" at the end."""
    try:
        return os.read(descriptor, _CHUNK)
    except BlockingIOError:
        return None
    except OSError:
        return b""


def _shown(text: bytes) -> str:
    shown = text[:200].decode(errors="replace")
    return repr(shown if len(text) <= 200 else f"{shown}...")


@atexit.register
def _close_all() -> None:
    # a copy: the set is weak, and may lose one meanwhile
    for session in list(_open):
        session.close()
