"""Locks of files that the system takes back when their holder ends, however it ends.

On network file systems they hold across machines where the server keeps locks.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import socket
import time
from pathlib import Path

_BEYOND = 2**30
"""Where Windows locks one byte: what it locks cannot be read, so it lies behind what the file says."""


class Held(Exception):
    """Another process holds the lock; the message says which."""


class Lock:
    """The right to write `path` or what is in it, held from construction to `release`, or to the end of the process.

    The lock is on a companion file, `path.lock`, which also names its holder. What kill -9 leaves of it is an unlocked
    file, which the next process takes over. Raises Held, and OSError where no file can be made or locked beside `path`.
    """

    def __init__(self, path: Path) -> None:
        self._path = Path(f"{os.path.realpath(path)}.lock")  # one lock, whatever links lead to the file
        self._descriptor = self._take()
        holder = {"pid": os.getpid(), "host": socket.gethostname(), "since": time.strftime("%Y-%m-%d %H:%M:%S")}
        with contextlib.suppress(OSError):  # on a full disk the lock holds all the same
            os.ftruncate(self._descriptor, 0)
            os.write(self._descriptor, json.dumps(holder).encode())

    def release(self) -> None:
        """Remove the companion file and give the lock back."""
        with contextlib.suppress(OSError):  # Windows keeps a file that is open
            self._path.unlink()
        os.close(self._descriptor)

    def _take(self) -> int:
        while True:
            descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT, 0o666)
            try:
                exclusive(descriptor)
                status = os.stat(self._path)
                if os.path.samestat(status, os.fstat(descriptor)):
                    return descriptor
            except FileNotFoundError:
                pass  # its holder has just removed it: what is locked is no longer what others will find
            except OSError as cause:
                os.close(descriptor)
                if cause.errno in (errno.EACCES, errno.EAGAIN, errno.EDEADLK):
                    raise Held(self._holder()) from None
                raise
            os.close(descriptor)

    def _holder(self) -> str:
        try:
            record = json.loads(self._path.read_text())
            return f"process {record['pid']} on {record['host']} has been writing it since {record['since']}"
        except (OSError, ValueError, KeyError):
            return "another process is writing it"


def exclusive(descriptor: int, *, wait: bool = False) -> None:
    """Lock an open file; raises OSError, also when somebody has it (EAGAIN or EACCES) unless that is waited for."""
    try:
        import fcntl
    except ImportError:
        import msvcrt

        os.lseek(descriptor, _BEYOND, os.SEEK_SET)
        how = msvcrt.LK_LOCK if wait else msvcrt.LK_NBLCK  # pyright: ignore[reportAttributeAccessIssue]
        msvcrt.locking(descriptor, how, 1)  # pyright: ignore[reportAttributeAccessIssue]
        os.lseek(descriptor, 0, os.SEEK_SET)
    else:
        fcntl.flock(descriptor, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
