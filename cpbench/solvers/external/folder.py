"""Temporary folders through which problems and answers go, and the removal of those that killed processes left."""

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

_PREFIX = "cpbench-exchange-"
_home: tuple[int, Path, int] | None = None
"""Process, folder, and the descriptor that holds its lock."""


def folder() -> tempfile.TemporaryDirectory[str]:
    """A new folder, which goes with the object that this returns, with this process, or with the next that looks."""
    return tempfile.TemporaryDirectory(dir=_own(), ignore_cleanup_errors=True)


def _own() -> Path:
    """The folder of this process, locked for as long as it lives."""
    global _home
    if _home is None or _home[0] != os.getpid() or not _home[1].is_dir():
        _remove_abandoned()
        while True:
            path = Path(tempfile.mkdtemp(prefix=_PREFIX))
            lock = _lock(path)
            if path.is_dir():  # somebody else's `_remove_abandoned` may come in between
                break
        _home = (os.getpid(), path, lock)
        atexit.register(shutil.rmtree, path, ignore_errors=True)
    return _home[1]


def _lock(path: Path) -> int:
    """Descriptor of a folder that is ours alone, -1 where it is not."""
    if fcntl is None:
        return -1
    descriptor = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        return -1
    return descriptor


def _remove_abandoned() -> None:
    """Folders that nobody holds a lock on: their process was killed."""
    for left in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*"):
        with contextlib.suppress(OSError):
            descriptor = _lock(left)
            if descriptor >= 0:
                shutil.rmtree(left, ignore_errors=True)
                os.close(descriptor)
