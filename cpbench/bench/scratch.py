"""The folder of a run's temporary files, and the removal of those that killed runs left behind."""

from __future__ import annotations

import shutil
import tempfile
import uuid
from pathlib import Path

from cpbench.bench.results.lock import Lock
from cpbench.errors import StoreError

_PREFIX = "cpbench-run-"


class Scratch:
    """A folder with a lock beside it for as long as the process lives that owns it.

    A lock tells the living from the dead where process numbers do not: across containers, and across machines that
    share their temporary files.
    """

    def __init__(self) -> None:
        remove_abandoned()
        self.folder = Path(tempfile.gettempdir()) / f"{_PREFIX}{uuid.uuid4().hex[:12]}"
        self._lock: Lock | None = Lock(self.folder)  # before there is anything to remove
        self.folder.mkdir(mode=0o700)

    def remove(self) -> None:
        """Harmless when done before."""
        shutil.rmtree(self.folder, ignore_errors=True)
        lock, self._lock = self._lock, None
        if lock is not None:
            lock.release()


def remove_abandoned() -> None:
    """Delete the folders of runs that no longer live (kill -9 leaves them)."""
    for left in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*.lock"):
        folder = left.with_suffix("")
        try:
            lock = Lock(folder)
        except (StoreError, OSError):  # its owner lives, or it is another user's
            continue
        shutil.rmtree(folder, ignore_errors=True)
        lock.release()
