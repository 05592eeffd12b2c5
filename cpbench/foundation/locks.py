"""Locks of files that the system takes back when their holder ends, however it ends, and temporary folders with such a
lock: it says whether their process lives, and those that killed processes left are removed.

On network file systems locks hold across machines where the server keeps them.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import json
import os
import shutil
import socket
import tempfile
import time
import uuid
from pathlib import Path

from cpbench.errors import CpbenchError


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
        with contextlib.suppress(OSError):
            self._path.unlink()
        os.close(self._descriptor)

    def _take(self) -> int:
        while True:
            descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT, 0o666)
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
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


RUN, EXCHANGE = "cpbench-run-", "cpbench-handed-"
"""How the folders of a run begin, and those through which problems and answers go."""


class TemporaryHome:
    """A folder with a lock beside it for as long as the process lives that owns it, in `parent`, by default where the
    system keeps temporary files.

    A lock tells the living from the dead where process numbers do not: across containers, and across machines that
    share their temporary files. Raises CpbenchError where no folder can be made.
    """

    def __init__(self, prefix: str, parent: Path | None = None) -> None:
        parent = parent or Path(tempfile.gettempdir())
        remove_abandoned(prefix, parent)
        self._lock: Lock | None = None
        while self._lock is None:
            self.folder = parent / f"{prefix}{uuid.uuid4().hex[:12]}"
            try:
                self._lock = Lock(self.folder)  # before there is anything to remove
                self.folder.mkdir(mode=0o700)
            except Held:  # by another process that looked whether its owner lives, before we had it
                continue
            except OSError as cause:
                why = cause.strerror or cause
                raise CpbenchError(f"{parent}: no temporary folder can be made there ({why}); set TMPDIR") from None

    def remove(self) -> None:
        """Remove the folder with all that is in it; harmless when done before."""
        shutil.rmtree(self.folder, ignore_errors=True)
        lock, self._lock = self._lock, None
        if lock is not None:
            lock.release()


def remove_abandoned(prefix: str, *folders: Path) -> None:
    """Delete the folders whose processes no longer live (kill -9 leaves them)."""
    for left in (path for parent in folders for path in parent.glob(f"{prefix}*.lock")):
        folder = left.with_suffix("")
        try:
            lock = Lock(folder)
        except (Held, OSError):  # its owner lives, or it is another user's
            continue
        shutil.rmtree(folder, ignore_errors=True)
        lock.release()
