"""Messages over a socket, with deadlines, between the runner and processes that ran foreign code.

A message is a magic number, the number of the request it answers, its length and its bytes. No read waits beyond its
limit, no memory is reserved for bytes that have not come, and answers to an earlier request are dropped.
"""

from __future__ import annotations

import contextlib
import socket
import struct
import time

from cpbench.foundation.frames import FrameError

MOST = 2**30
"""Bytes of the largest message that is accepted."""
_HEAD = struct.Struct("<4sIQ")
_MAGIC = b"cpb1"
_PART = 2**20
_AT_ONCE = 16
"""Parts read in one call, so that a sender without end does not keep the reader from its deadline."""


class Channel:
    """One end of a pair of sockets.

    The end of the runner uses `send` and `receive_nowait`; that of a child `recv_bytes` and `send_bytes`, which
    wait and answer the request that came last.
    """

    def __init__(self, end: socket.socket, most: int = MOST) -> None:
        self._socket, self._most = end, most
        self._turn = 0
        self._buffer = bytearray()

    def fileno(self) -> int:
        return self._socket.fileno()

    def close(self) -> None:
        self._socket.close()

    # ------------------------------------------------------------------------------------ the runner's end

    def send(self, message: bytes, seconds: float) -> None:
        """Send a request; raises OSError when the other end is closed, TimeoutError when it does not read within
        `seconds`."""
        self._turn = (self._turn + 1) % 2**32  # answers to earlier requests, which were given up, are dropped by it
        rest = memoryview(_HEAD.pack(_MAGIC, self._turn, len(message)) + message)
        self._socket.setblocking(False)
        with contextlib.suppress(BlockingIOError):  # nearly always there is room at once
            rest = rest[self._socket.send(rest) :]
        deadline = time.monotonic() + seconds
        while rest:
            self._socket.settimeout(max(deadline - time.monotonic(), 1e-3))
            rest = rest[self._socket.send(rest) :]

    def receive_nowait(self) -> bytes | None:
        """Return a message if all of it has come and could be read in one call, otherwise None.

        Raises EOFError when the other end is closed, FrameError when the bytes are not a message.
        """
        message = self._taken()
        parts = 0
        while message is None:
            if parts == _AT_ONCE:
                return None
            parts += 1
            wanted = min(max(self._wanted(), 4096), _PART)
            try:
                self._socket.setblocking(False)
                part = self._socket.recv(wanted)
            except (BlockingIOError, InterruptedError):
                return None
            except OSError:
                raise EOFError from None
            if not part:
                raise EOFError
            self._buffer += part
            message = self._taken()
        return message

    # ------------------------------------------------------------------------------------- a child's end

    def recv_bytes(self) -> bytes:
        """Wait for the next request; raises EOFError when the runner has ended."""
        head = self._exactly(_HEAD.size)
        _, self._turn, size = _HEAD.unpack(head)
        return self._exactly(size)

    def send_bytes(self, message: bytes) -> None:
        """Send an answer to the last request; waits until all of it is sent."""
        self._socket.setblocking(True)
        head = _HEAD.pack(_MAGIC, self._turn, len(message))
        if len(message) <= _PART:  # in one piece: each piece wakes the runner
            self._socket.sendall(head + message)
        else:
            self._socket.sendall(head)
            self._socket.sendall(message)

    def _exactly(self, size: int) -> bytes:
        self._socket.setblocking(True)
        got = bytearray()
        while len(got) < size:
            part = self._socket.recv(min(size - len(got), _PART))
            if not part:
                raise EOFError
            got += part
        return bytes(got)

    # -------------------------------------------------------------------------------------------- frames

    def _wanted(self) -> int:
        """Return the number of bytes that are missing of the first message in the buffer."""
        if len(self._buffer) < _HEAD.size:
            return _HEAD.size - len(self._buffer)
        return _HEAD.size + self._head()[1] - len(self._buffer)

    def _head(self) -> tuple[int, int]:
        mark, turn, size = _HEAD.unpack_from(self._buffer)
        if mark != _MAGIC:
            raise FrameError(f"not a message: it begins with {bytes(self._buffer[:16])!r}")
        if size > self._most:
            raise FrameError(f"a message of {size} bytes, over the limit of {self._most}")
        return turn, size

    def _taken(self) -> bytes | None:
        """Return the first message in the buffer when it is complete, without answers to earlier requests."""
        while len(self._buffer) >= _HEAD.size:
            turn, size = self._head()
            end = _HEAD.size + size
            if len(self._buffer) < end:
                return None
            message = bytes(memoryview(self._buffer)[_HEAD.size : end])
            del self._buffer[:end]
            if turn == self._turn:
                return message
        return None


def pair() -> tuple[Channel, socket.socket]:
    """Return the runner's end, and the socket that becomes a child's `Channel`."""
    ours, theirs = socket.socketpair()
    return Channel(ours), theirs
