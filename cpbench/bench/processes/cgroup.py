"""Control groups of Linux, version 2: one for every process of a run, to kill and limit it with its descendants.

The mount is read from /proc/mounts, the group of this process from /proc/self/cgroup. New groups are made beside that
one where possible, because version 2 limits nothing below a group that itself holds processes.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import time
from dataclasses import dataclass
from pathlib import Path

import psutil

PREFIX = "cpbench-"
_numbers = itertools.count()


@dataclass(frozen=True)
class CgroupPlace:
    """A folder in which groups can be made, and whether they can limit memory."""

    path: Path
    memory: bool


class Cgroup:
    """A group of its own in the folder `parent`; processes join it by themselves."""

    def __init__(self, parent: str | Path) -> None:
        self.path = Path(parent) / f"{PREFIX}{os.getpid()}-{next(_numbers)}"
        self.path.mkdir()

    def limit_memory(self, growth: int) -> None:
        """Limit further growth of the group's memory to `growth` bytes, without swap."""
        limit = int((self.path / "memory.current").read_text()) + growth
        with contextlib.suppress(FileNotFoundError, PermissionError):  # where there is no swap at all
            (self.path / "memory.swap.max").write_text("0")
        (self.path / "memory.oom.group").write_text("1")
        (self.path / "memory.max").write_text(str(limit))

    @property
    def out_of_memory(self) -> bool:
        """Whether the system has killed a process of the group for its memory."""
        try:
            return _counters(self.path / "memory.events").get("oom_kill", 0) > 0
        except OSError:
            return False

    def kill(self, seconds: float = 1.0) -> None:
        """Kill every process in the group (SIGKILL), new ones too; wait until all have ended, or for `seconds`."""
        with contextlib.suppress(OSError):
            (self.path / "cgroup.kill").write_text("1")
            deadline = time.monotonic() + seconds
            while _counters(self.path / "cgroup.events").get("populated") and time.monotonic() < deadline:
                time.sleep(0.001)

    def remove(self, seconds: float = 2.0) -> None:
        """Remove the group when its last process is gone, or leave it to the next run after `seconds`."""
        deadline = time.monotonic() + seconds
        while self.path.exists():
            try:
                self.path.rmdir()
            except OSError:
                if time.monotonic() > deadline:
                    return
                time.sleep(0.002)


def join(path: str | Path) -> bool:
    """Move this process into a group; False where that is not allowed."""
    try:
        (Path(path) / "cgroup.procs").write_text("0")
    except OSError:
        return False
    return True


def writable() -> CgroupPlace | None:
    """Return the folder for groups: one where they can limit memory, else one where they can be killed."""
    result: CgroupPlace | None = None
    for folder in _ours():
        place = _tried(folder)
        if place is not None and place.memory:
            return place
        result = result or place
    return result


def remove_abandoned(parent: str | Path) -> None:
    """Remove the empty groups of runs that have ended."""
    for path in Path(parent).glob(f"{PREFIX}*-*"):
        owner = path.name.removeprefix(PREFIX).partition("-")[0]
        if owner.isdigit() and not psutil.pid_exists(int(owner)):
            with contextlib.suppress(OSError):  # not empty: it may be in use
                path.rmdir()


def _ours() -> list[Path]:
    """Return the group of this process and those above it, up to the mount."""
    try:
        mounts = [line.split() for line in Path("/proc/mounts").read_text().splitlines()]
        lines = Path("/proc/self/cgroup").read_text().splitlines()
    except OSError:
        return []
    roots = [Path(fields[1]) for fields in mounts if len(fields) > 2 and fields[2] == "cgroup2"]
    inside = [line.removeprefix("0::").strip("/") for line in lines if line.startswith("0::")]
    if not roots or not inside or ".." in inside[0]:
        return []
    own = roots[0] / inside[0]
    return [own, *(p for p in own.parents if p == roots[0] or roots[0] in p.parents)]


def _tried(folder: Path) -> CgroupPlace | None:
    """Return what groups in `folder` can do, by a trial; None where none can be made or joined."""
    if not os.access(folder / "cgroup.procs", os.W_OK):
        return None
    trial = folder / f"{PREFIX}{os.getpid()}-trial{next(_numbers)}"
    try:
        trial.mkdir()
    except OSError:
        return None
    try:
        if not (trial / "cgroup.kill").exists():  # Linux before 5.14
            return None
        return CgroupPlace(folder, memory=(trial / "memory.max").exists())
    finally:
        with contextlib.suppress(OSError):
            trial.rmdir()


def _counters(path: Path) -> dict[str, int]:
    return {name: int(value) for name, value in (line.split() for line in path.read_text().splitlines())}
