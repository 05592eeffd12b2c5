"""A child process in a session of its own: guarded, its output kept, killed with all that it started.

Its output goes into a pipe that the runner empties while it waits for the child, keeping the first and the last part.
A pipe bounds the memory that a flood of output takes. A child for which nobody waits stops when its pipe is full, and
goes on when somebody does.
"""

from __future__ import annotations

import contextlib
import os
import select
import selectors
import signal
import time
from collections.abc import Callable, Sequence
from multiprocessing.context import ForkServerContext
from typing import Any, cast

import psutil

from cpbench.bench.processes import channel, guard
from cpbench.bench.processes.launch import ProcessStart, passed_on, started

PART = 500
"""Bytes kept of the beginning and of the end of the output."""
_CHUNK = 2**16
_AT_ONCE = 64
"""Chunks read in one call, so that output without end does not keep the reader."""


class Log:
    """The output written to `writer`, which is passed to a child and then closed by `started`."""

    def __init__(self, ctx: Any) -> None:
        self._reader, self.writer = ctx.Pipe(duplex=False)
        os.set_blocking(self._reader.fileno(), False)
        self._forget()

    def fileno(self) -> int:
        return int(self._reader.fileno())

    def started(self) -> None:
        """Note that the child has its end of the pipe."""
        self.writer.close()

    def take(self) -> str:
        """Return the output since the last call, without its middle when it has more than 2 · `PART` bytes."""
        self.empty()
        rest = self._seen - len(self._first)
        last = self._last[max(len(self._last) - rest, 0) :]
        left_out = rest - len(last)
        middle = f"\n[... {left_out} bytes ...]\n".encode() if left_out else b""
        text = (self._first + middle + last).decode(errors="replace").strip()
        self._forget()
        return text

    def forget(self) -> None:
        """Drop the output so far; what is printed at this moment may still count as new."""
        self.empty()
        self._forget()

    def close(self) -> None:
        """Close the pipe; harmless when done before."""
        self._reader.close()

    def _forget(self) -> None:
        self._first, self._last, self._seen = b"", b"", 0

    def empty(self) -> bool:
        """Read what there is; return False where the other end is closed."""
        for _ in range(0 if self._reader.closed else _AT_ONCE):
            try:
                part = os.read(self._reader.fileno(), _CHUNK)
            except BlockingIOError:
                return True
            if not part:
                return False
            self._first += part[: PART - len(self._first)]
            self._last = (self._last + part[-PART:])[-PART:]
            self._seen += len(part)
        return not self._reader.closed


LOOK = 0.05
"""Seconds between two looks at a child that sends nothing."""
EXIT = 0.5
"""Seconds that a child has to end after it closed its connection."""
GUARD_EXIT = 0.2
"""Seconds that a guard has to end after all that it guarded was killed."""
ACCEPT = 30.0
"""Seconds within which a child has to take a message, where no phase of a run has another limit."""


class TimedOut(Exception):
    """Error of a child that sent no message within the limit."""


class Died(Exception):
    """The child ended: `signal` (a number) or exit `code`, and the first and last part of its output. As text the cause
    and this output."""

    def __init__(self, code: int | None, output: str, *, reason: str = "") -> None:
        self.signal = -code if code is not None and code < 0 else None
        self.code, self.output = code, output
        self._reason = reason
        super().__init__(f"{self.cause}: {output}" if output else self.cause)

    @property
    def cause(self) -> str:
        if self._reason:
            return self._reason
        if self.signal is not None:
            return f"killed by {_signal_name(self.signal)}"
        return f"exited with code {self.code}"

    @property
    def out_of_memory(self) -> bool:
        """Return whether its output names an allocation that failed."""
        return "bad_alloc" in self.output or "MemoryError" in self.output


class Child:
    """A process running `target(channel, *args)`, isolated from all others; `target` limits its own memory.

    Parameters
    ----------
    cpus : cores on which it runs, () for all.
    processes : number of descendants that it may have, where the system lists them (0: no limit).

    Raises Died when the system refuses to start it.
    """

    def __init__(
        self,
        ctx: ForkServerContext,
        target: Callable[..., None],
        args: tuple[Any, ...],
        *,
        cpus: Sequence[int] = (),
        processes: int = 0,
    ) -> None:
        self._processes = processes
        self._looked = 0.0
        self._over = False
        self._log = Log(ctx)
        self._channel, theirs = channel.pair()
        ours, self._lifeline = ctx.Pipe(duplex=False)
        start = ProcessStart(theirs, self._log.writer, ours, tuple(cpus), passed_on())
        self._selector = selectors.DefaultSelector()
        try:
            self._process = started(ctx, start, target, args)
        except OSError as cause:
            self._release()
            raise Died(None, "", reason=f"could not be started ({cause})") from None
        finally:
            theirs.close()
            ours.close()
            self._log.started()
        self._first = _found(self.pid)
        self._selector.register(self._channel, selectors.EVENT_READ)
        self._selector.register(self._process.sentinel, selectors.EVENT_READ)
        self._selector.register(self._log, selectors.EVENT_READ)
        self._end = select.poll()
        self._end.register(self._process.sentinel, select.POLLIN)

    @property
    def pid(self) -> int:
        return int(self._process.pid or 0)

    @property
    def alive(self) -> bool:
        """Return whether it still runs; it may die between two requests."""
        return not self._over and not self._end.poll(0)

    def send(self, message: bytes, seconds: float = ACCEPT) -> None:
        """Send a request. Raises Died when the other end is closed, TimedOut when it does not read."""
        try:
            self._channel.send(message, seconds)
        except TimeoutError:
            raise TimedOut from None
        except OSError:
            raise self._death() from None

    def receive(self, seconds: float) -> bytes:
        """Return the next message about the last request; raises TimedOut, Died, FrameError.

        Waits for the end of the process as well as for the channel, which its own children may hold open after it, and
        takes what it prints meanwhile.
        A message that it sent before it died still counts.
        """
        deadline = time.monotonic() + seconds
        ended = False
        while True:
            try:
                message = self._channel.receive_nowait()
            except EOFError:
                raise self._death() from None
            if message is not None:
                return message
            if ended:
                raise self._death()
            left = deadline - time.monotonic()
            if left <= 0.0:
                raise TimedOut
            ready = [key.fileobj for key, _ in self._selector.select(min(left, LOOK))]
            if self._log in ready and not self._log.empty():
                self._selector.unregister(self._log)
            silent = self._channel not in ready
            ended = silent and (self._process.sentinel in ready or (not ready and not self.alive))
            self._look()

    def output(self) -> str:
        """Return what the child printed since the last call, first and last part."""
        return self._log.take()

    def forget(self) -> None:
        """Forget what was printed so far."""
        self._log.forget()

    def kill_all(self) -> None:
        """Kill the child and all that it started (SIGKILL); `receive` in another thread raises Died.

        A guard gets a moment to reap what was killed: in a container there may be no other process that does.
        """
        deadline = time.monotonic() + guard.PATIENCE
        passing = guard.pauses(guard.PATIENCE)
        while (family := self._family()) and next(passing, False):
            for process in family:
                with contextlib.suppress(psutil.Error):
                    process.kill()
        if self._lives():
            self._join(GUARD_EXIT)
        while self._lives() and time.monotonic() < deadline:
            with contextlib.suppress(psutil.Error):
                cast(psutil.Process, self._first).kill()
            self._join(LOOK)

    def kill(self) -> None:
        """Kill it with all that it started and wait for its end."""
        self.kill_all()
        self._join(LOOK)
        self._release()

    # ------------------------------------------------------------------------------------------- within

    def _release(self) -> None:
        """Close pipes and sockets."""
        self._selector.close()
        self._channel.close()
        self._lifeline.close()
        self._log.close()

    def _join(self, seconds: float) -> None:
        """Wait for the end and remember it: the exit code can be read once, and the forkserver closes its pipe a moment
        later."""
        self._process.join(seconds)
        self._over = self._process.exitcode is not None

    def _lives(self) -> bool:
        """Return whether the process exists, by the system itself: the forkserver, which reports it, may have died."""
        return self._first is not None and self._first.is_running() and _lives(self._first)

    def _family(self) -> list[psutil.Process]:
        """Return the living descendants of the child, which is their guard, and the members of its session."""
        members: dict[int, psutil.Process] = {}
        with contextlib.suppress(psutil.Error):
            if self._first is not None:
                members = {p.pid: p for p in guard.descendants(self._first)}
        for pid in psutil.pids():
            with contextlib.suppress(OSError, psutil.Error):
                if os.getsid(pid) == self.pid:
                    members.setdefault(pid, psutil.Process(pid))
        members.pop(self.pid, None)
        return [process for process in members.values() if _lives(process)]

    def _look(self) -> None:
        """Raise Died when the child has too many processes; checks once in `LOOK` seconds."""
        now = time.monotonic()
        if now - self._looked < LOOK:
            return
        self._looked = now
        if self._processes and guard.count_below(self.pid) > self._processes:
            self.kill_all()
            raise Died(None, self.output(), reason=crowded(self._processes))

    def _death(self) -> Died:
        """Return why it ended; a child that goes on without its connection is killed."""
        self._join(EXIT)
        reason = "closed its connection" if self.alive and self._family() else ""
        if reason:
            self.kill_all()
        self._join(guard.PATIENCE)  # a guard that is about to end as its worker did
        return Died(None if reason else self._process.exitcode, self.output(), reason=reason)


def crowded(most: int) -> str:
    """Return the reason to kill a child, or refuse its answer, that had too many processes."""
    return f"more than {most} processes at a time"


def _found(pid: int) -> psutil.Process | None:
    """Return the process, identified by its id and its start: ids are used again."""
    try:
        return psutil.Process(pid)
    except psutil.Error:
        return None


def _lives(process: psutil.Process) -> bool:
    try:
        return process.status() not in (psutil.STATUS_ZOMBIE, psutil.STATUS_DEAD)
    except psutil.Error:
        return False


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:  # a real-time signal
        return f"signal {number}"
