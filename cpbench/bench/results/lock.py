"""The right to write a results file: one process at a time, by a lock that the system takes back when it ends.

The lock is on a companion file, `FILE.lock`, which also says who holds it. What kill -9 leaves of it is an unlocked
file, which the next run takes over. On network file systems it holds across machines where the server keeps locks;
where locks are not to be had at all, writing is refused, for SQLite needs them too.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import socket
import time
from pathlib import Path

from cpbench.errors import StoreError

_BEYOND = 2**30
"""Where Windows locks one byte: what it locks cannot be read, so it lies behind what the file says."""


class Lock:
    """Held from construction to `release`, or to the end of the process.

    Raises StoreError when another process holds it, or when no file can be made beside `path`.
    """

    def __init__(self, path: Path) -> None:
        self._path = Path(f"{os.path.realpath(path)}.lock")  # one lock, whatever links lead to the file
        try:
            self._descriptor = self._take(path)
        except OSError as cause:
            raise StoreError(
                f"{path}: cannot be written ({cause.strerror or cause}); name a file in another folder with -o"
            ) from None
        holder = {"pid": os.getpid(), "host": socket.gethostname(), "since": time.strftime("%Y-%m-%d %H:%M:%S")}
        with contextlib.suppress(OSError):  # on a full disk the lock holds all the same
            os.ftruncate(self._descriptor, 0)
            os.write(self._descriptor, json.dumps(holder).encode())

    def release(self) -> None:
        with contextlib.suppress(OSError):  # Windows keeps a file that is open
            self._path.unlink()
        os.close(self._descriptor)

    def _take(self, path: Path) -> int:
        while True:
            descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT, 0o666)
            try:
                _lock(descriptor)
                found = os.stat(self._path)
                if os.path.samestat(found, os.fstat(descriptor)):
                    return descriptor
            except FileNotFoundError:
                pass  # its holder has just removed it: what is locked is no longer what others will find
            except OSError as cause:
                os.close(descriptor)
                if cause.errno in (errno.EACCES, errno.EAGAIN, errno.EDEADLK):
                    raise StoreError(f"{path}: {self._holder()}; wait for it, or use another file with -o") from None
                raise
            os.close(descriptor)

    def _holder(self) -> str:
        try:
            told = json.loads(self._path.read_text())
            return f"process {told['pid']} on {told['host']} has been writing it since {told['since']}"
        except (OSError, ValueError, KeyError):
            return "another process is writing it"


def _lock(descriptor: int) -> None:
    """Take the lock at once or raise OSError (EAGAIN or EACCES: somebody has it)."""
    try:
        import fcntl
    except ImportError:
        import msvcrt

        os.lseek(descriptor, _BEYOND, os.SEEK_SET)
        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)  # pyright: ignore[reportAttributeAccessIssue]
        os.lseek(descriptor, 0, os.SEEK_SET)
    else:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
