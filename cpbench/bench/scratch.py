"""The folder of a run's temporary files, and the removal of those that killed runs left behind."""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path

import psutil

_PREFIX = "cpbench-run-"


class Scratch:
    """A folder named after the process that owns it."""

    def __init__(self) -> None:
        remove_abandoned()
        self.folder = Path(tempfile.mkdtemp(prefix=f"{_PREFIX}{os.getpid()}-"))

    def remove(self) -> None:
        shutil.rmtree(self.folder, ignore_errors=True)


def remove_abandoned() -> None:
    """Delete the folders of runs that no longer live (kill -9 leaves them)."""
    for folder in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*"):
        owner = folder.name.removeprefix(_PREFIX).partition("-")[0]
        if owner.isdigit() and not psutil.pid_exists(int(owner)):
            shutil.rmtree(folder, ignore_errors=True)
