"""Temporary folders through which problems and answers go, and the removal of those that killed processes left.

What is small goes through memory, where the system has a folder for that: five times as fast as through a disk.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import shutil
import tempfile
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


def folder(size: int) -> tempfile.TemporaryDirectory[str]:
    """A new folder for about `size` bytes: it goes with the object that this returns, with this process, or when the
    next process looks for what others left."""
    place = MEMORY if size <= SMALL and os.access(MEMORY, os.W_OK) else Path(tempfile.gettempdir())
    return tempfile.TemporaryDirectory(dir=_own(place), ignore_cleanup_errors=True)


def _own(place: Path) -> Path:
    """The folder of this process, locked for as long as it lives."""
    known = _homes.get(place)
    if known is not None and known[0] == os.getpid() and known[1].is_dir():
        return known[1]
    _remove_abandoned(place)
    while True:
        path = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=place))
        lock = _lock(path)
        if path.is_dir():  # somebody else's `_remove_abandoned` may come in between
            break
    _homes[place] = (os.getpid(), path, lock)
    atexit.register(shutil.rmtree, path, ignore_errors=True)
    return path


def _lock(path: Path) -> int:
    """Descriptor of a folder that is ours alone, -1 where it is not. Raises OSError."""
    if fcntl is None:
        return -1
    descriptor = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        return -1
    return descriptor


def _remove_abandoned(place: Path) -> None:
    """Folders that nobody holds a lock on: their process was killed."""
    for left in place.glob(f"{_PREFIX}*"):
        with contextlib.suppress(OSError):
            descriptor = _lock(left)
            if descriptor >= 0:
                shutil.rmtree(left, ignore_errors=True)
                os.close(descriptor)
