"""Output of a child: a pipe that a thread of the runner empties, keeping the first and the last part.

A pipe bounds the memory that a flood of output takes; the thread keeps a full pipe from blocking the child.
"""

from __future__ import annotations

import os
import selectors
import threading
from typing import Any

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
        self._lock = threading.Lock()
        self._closed, self._watched = False, True
        self._forget()
        _emptier.add(self)

    def fileno(self) -> int:
        return int(self._reader.fileno())

    def started(self) -> None:
        """Note that the child has its end of the pipe."""
        self.writer.close()

    def take(self) -> str:
        """Return the output since the last call, without its middle when it has more than 2 · `PART` bytes."""
        with self._lock:
            self._absorb(_AT_ONCE)
            rest = self._seen - len(self._first)
            last = self._last[max(len(self._last) - rest, 0) :]
            left_out = rest - len(last)
            middle = f"\n[... {left_out} bytes ...]\n".encode() if left_out else b""
            text = (self._first + middle + last).decode(errors="replace").strip()
            self._forget()
        return text

    def forget(self) -> None:
        """Drop the output so far; what is printed at this moment may still count as new."""
        if self._seen:
            self.take()

    def empty(self) -> None:
        """Read what there is, for the thread; the pipe is watched no more once its other end is closed."""
        with self._lock:
            if not self._absorb(1):
                self._unwatch()

    def close(self) -> None:
        """Close the pipe; harmless when done before."""
        with self._lock:
            if not self._closed:
                self._closed = True
                self._unwatch()
                self._reader.close()

    def _unwatch(self) -> None:
        if self._watched:
            self._watched = False
            _emptier.remove(self)

    def _forget(self) -> None:
        self._first, self._last, self._seen = b"", b"", 0

    def _absorb(self, chunks: int) -> bool:
        for _ in range(chunks):
            if self._closed:
                return False
            try:
                part = os.read(self._reader.fileno(), _CHUNK)
            except BlockingIOError:
                return True
            if not part:
                return False
            self._first += part[: PART - len(self._first)]
            self._last = (self._last + part[-PART:])[-PART:]
            self._seen += len(part)
        return True


class _Emptier:
    """The thread that empties the pipes of all children; it sleeps while there is no output."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._selector: selectors.BaseSelector | None = None

    def add(self, log: Log) -> None:
        with self._lock:
            if self._selector is None:
                self._selector = selectors.DefaultSelector()
                threading.Thread(target=self._run, args=(self._selector,), daemon=True, name="child output").start()
            self._selector.register(log, selectors.EVENT_READ, log)

    def remove(self, log: Log) -> None:
        with self._lock:
            assert self._selector is not None
            self._selector.unregister(log)

    def _run(self, selector: selectors.BaseSelector) -> None:
        while True:
            for key, _ in selector.select():
                key.data.empty()


_emptier = _Emptier()
