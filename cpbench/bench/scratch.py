"""The folder of a run's temporary files, and the removal of those that killed runs left behind."""

from __future__ import annotations

import os
import platform
import shutil
import tempfile
from pathlib import Path

import psutil

_PREFIX = f"cpbench-run-{platform.node()}-"
"""With the name of the machine: the folder of temporary files may be common to several."""


class Scratch:
    """A folder named after the machine and the process that own it."""

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
