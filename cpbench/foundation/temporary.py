"""Temporary folders that say whether their process lives, and the removal of those that killed processes left."""

from __future__ import annotations

import shutil
import tempfile
import uuid
from pathlib import Path

from cpbench.errors import CpbenchError
from cpbench.foundation.locks import Held, Lock

RUN, EXCHANGE = "cpbench-run-", "cpbench-handed-"
"""How the folders of a run begin, and those through which problems and answers go."""


class TemporaryHome:
    """A folder with a lock beside it for as long as the process lives that owns it, in `place`, by default where the
    system keeps temporary files.

    A lock tells the living from the dead where process numbers do not: across containers, and across machines that
    share their temporary files. Raises CpbenchError where no folder can be made.
    """

    def __init__(self, prefix: str, place: Path | None = None) -> None:
        place = place or Path(tempfile.gettempdir())
        remove_abandoned(prefix, place)
        self._lock: Lock | None = None
        while self._lock is None:
            self.folder = place / f"{prefix}{uuid.uuid4().hex[:12]}"
            try:
                self._lock = Lock(self.folder)  # before there is anything to remove
                self.folder.mkdir(mode=0o700)
            except Held:  # by another process that looked whether its owner lives, before we had it
                continue
            except OSError as cause:
                why = cause.strerror or cause
                raise CpbenchError(f"{place}: no temporary folder can be made there ({why}); set TMPDIR") from None

    def remove(self) -> None:
        """Remove the folder with all that is in it; harmless when done before."""
        shutil.rmtree(self.folder, ignore_errors=True)
        lock, self._lock = self._lock, None
        if lock is not None:
            lock.release()


def remove_abandoned(prefix: str, *places: Path) -> None:
    """Delete the folders whose processes no longer live (kill -9 leaves them)."""
    for left in (path for place in places for path in place.glob(f"{prefix}*.lock")):
        folder = left.with_suffix("")
        try:
            lock = Lock(folder)
        except (Held, OSError):  # its owner lives, or it is another user's
            continue
        shutil.rmtree(folder, ignore_errors=True)
        lock.release()
