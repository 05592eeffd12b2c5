"""Output of a child: a pipe that the runner empties while it waits for the child, keeping the first and the last part.

A pipe bounds the memory that a flood of output takes. A child for which nobody waits stops when its pipe is full, and
goes on when somebody does.
"""

from __future__ import annotations

import os
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
