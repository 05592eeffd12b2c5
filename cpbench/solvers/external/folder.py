"""Temporary folders through which problems and answers go, and the removal of those that killed processes left.

What is small goes through memory, where the system has a folder for that: five times as fast as through a disk.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import shutil
import tempfile
import weakref
from pathlib import Path

try:
    import fcntl
except ImportError:  # a system without locks on folders: what a killed process leaves stays
    fcntl = None

MEMORY = Path("/dev/shm")
SMALL = 2**20
"""Bytes of a problem that goes through memory."""
_PREFIX = "cpbench-exchange-"
_homes: dict[Path, tuple[int, Path, int]] = {}
"""Of every place: the process, its folder there, and the descriptor that holds the folder's lock."""


class Folder:
    """A new folder for about `size` bytes: it goes with this object, with this process, or when the next process looks
    for what others left."""

    def __init__(self, size: int) -> None:
        place = MEMORY if size <= SMALL and os.access(MEMORY, os.W_OK) else Path(tempfile.gettempdir())
        self.path = Path(tempfile.mkdtemp(dir=_own(place)))
        weakref.finalize(self, shutil.rmtree, self.path, ignore_errors=True)


def _own(place: Path) -> Path:
    """The folder of this process, locked for as long as it lives."""
    known = _homes.get(place)
    if known is not None and known[0] == os.getpid() and known[1].is_dir():
        return known[1]
    remove_abandoned()
    while True:
        path = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=place))
        with contextlib.suppress(FileNotFoundError, BlockingIOError):  # somebody's `remove_abandoned` came in between
            lock = _lock(path)
            if path.is_dir():
                break
            _unlock(lock)
    _homes[place] = (os.getpid(), path, lock)
    atexit.register(shutil.rmtree, path, ignore_errors=True)
    return path


def _lock(path: Path) -> int:
    """Descriptor of a folder that is ours alone, -1 where there are no locks.

    Raises BlockingIOError when it is somebody else's, OSError.
    """
    if fcntl is None:
        return -1
    descriptor = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as cause:
        os.close(descriptor)
        if isinstance(cause, BlockingIOError):
            raise
        return -1
    return descriptor


def _unlock(descriptor: int) -> None:
    if descriptor >= 0:
        os.close(descriptor)


def remove_abandoned() -> None:
    """Delete folders that nobody holds a lock on: their process was killed."""
    for left in (p for place in (MEMORY, Path(tempfile.gettempdir())) for p in place.glob(f"{_PREFIX}*")):
        with contextlib.suppress(OSError):
            descriptor = _lock(left)
            if descriptor >= 0:
                shutil.rmtree(left, ignore_errors=True)
                _unlock(descriptor)
