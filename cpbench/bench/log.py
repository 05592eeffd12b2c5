"""What a child prints: a file it appends to and never waits for, cut while it grows."""

from __future__ import annotations

import contextlib
import os
import tempfile
from pathlib import Path

PART = 500
"""Bytes kept of the beginning and of the end of what was printed."""
ROOM = 2**20
"""Size in bytes beyond which the file is emptied; what is printed between two looks comes on top."""


class Log:
    """A temporary file in `folder`, open for appending elsewhere; its first and last part are kept.

    A file, not a pipe: a pipe that is not emptied in time would hold the writer up. What is written between
    the reading of the file and its emptying is lost.
    """

    def __init__(self, folder: Path) -> None:
        self._file = tempfile.NamedTemporaryFile(dir=folder, suffix=".log", buffering=0)  # noqa: SIM115 - close() does
        self._forget()

    @property
    def path(self) -> str:
        return str(self._file.name)

    def trim(self) -> None:
        """Empty the file when it is larger than `ROOM`."""
        if not self._file.closed and os.fstat(self._file.fileno()).st_size > ROOM:
            self._absorb()

    def take(self) -> str:
        """What was printed since the last call, its middle left out when there is more than 2 · `PART` bytes."""
        if not self._file.closed:
            self._absorb()
        rest = self._seen - len(self._first)
        last = self._last[max(len(self._last) - rest, 0) :]
        left_out = rest - len(last)
        middle = f"\n[... {left_out} bytes ...]\n".encode() if left_out else b""
        text = (self._first + middle + last).decode(errors="replace").strip()
        self._forget()
        return text

    def close(self) -> None:
        """Close and remove the file; harmless when done before."""
        with contextlib.suppress(FileNotFoundError):
            self._file.close()

    def _forget(self) -> None:
        self._first, self._last, self._seen = b"", b"", 0

    def _absorb(self) -> None:
        descriptor = self._file.fileno()
        size = os.fstat(descriptor).st_size
        if size:
            self._first += os.pread(descriptor, PART - len(self._first), 0)
            self._last = (self._last + os.pread(descriptor, PART, max(size - PART, 0)))[-PART:]
            self._seen += size
            os.ftruncate(descriptor, 0)
