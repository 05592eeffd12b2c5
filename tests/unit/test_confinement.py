"""What a confined process may still do, by trying it in a forked one."""

from __future__ import annotations

import contextlib
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from cpbench.bench.processes import confinement, isolation, landlock
from cpbench.foundation import kernel_cache
from cpbench.solvers.base import solvers

confined = pytest.mark.skipif(landlock.version() == 0, reason="does not apply: this system has no Landlock")


def _tried(tasks: Mapping[str, Callable[[], Any]], prepare: Callable[[], None]) -> dict[str, bool]:
    """Which of the tasks go well in a process of its own, after `prepare`."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        prepare()
        found: dict[str, bool] = {}
        for name, task in tasks.items():
            found[name] = False
            with contextlib.suppress(OSError, subprocess.CalledProcessError):
                task()
                found[name] = True
        os.write(writer, json.dumps(found).encode())
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader, "rb") as told:
        found = json.loads(told.read())
    os.waitpid(child, 0)
    return found


@confined
def test_a_worker_writes_below_its_scratch_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    scratch, results = tmp_path / "scratch", tmp_path / "r.sqlite"
    scratch.mkdir()
    kernels = tmp_path / "just_installed" / "kernels"  # nothing was compiled yet
    kernels.mkdir(parents=True)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(kernel_cache, "_PACKAGES", ["just_installed.kernels"])
    results.write_text("results")
    beside = [sys.executable, "-c", f"open({str(results)!r}, 'a')"]
    allowed: dict[str, Callable[[], Any]] = {
        "a temporary file": lambda: os.close(tempfile.mkstemp()[0]),
        "of a child": lambda: subprocess.run(
            [sys.executable, "-c", "import tempfile; tempfile.TemporaryFile()"], check=True
        ),
        "the cache": lambda: (tmp_path / "cache" / "kernel").write_text("x"),
        "compiled kernels": lambda: (kernels / "__pycache__" / "kernel").write_text("x"),
        "null": lambda: Path("/dev/null").write_text("x"),
        "shared memory": lambda: tempfile.TemporaryDirectory(dir="/dev/shm").cleanup(),
        "reading": lambda: results.read_text(),
        "listing": lambda: os.listdir(tmp_path),
    }
    refused: dict[str, Callable[[], Any]] = {
        "the results": lambda: os.close(os.open(results, os.O_WRONLY)),
        "truncating": lambda: os.truncate(results, 0),
        "removing": lambda: results.unlink(),
        "moving": lambda: results.rename(tmp_path / "other"),
        "a log beside them": lambda: (tmp_path / "r.sqlite-journal").touch(),
        "by a child": lambda: subprocess.run(beside, check=True, stderr=subprocess.DEVNULL),
        "cpbench": lambda: os.close(os.open(confinement.__file__, os.O_WRONLY)),
        "the runner's memory": lambda: os.close(os.open(f"/proc/{os.getppid()}/mem", os.O_RDONLY)),
    }
    if landlock.version() < 3:
        refused.pop("truncating")
    means = isolation.detect()
    assert means.writes == "landlock"
    found = _tried({**allowed, **refused}, lambda: confinement.confine(means, str(scratch), own=True))
    assert {name for name, worked in found.items() if worked} == set(allowed)
    assert results.read_text() == "results"


@pytest.mark.needs("cpbench_solvers")
def test_the_loops_of_every_solver_of_cpbench_are_kept_in_folders_that_its_worker_may_write() -> None:
    assert solvers.get("lemke").origin == "native"
    kept = [module for module in kernel_cache.modules() if kernel_cache.is_kept(module)]
    assert "cpbench_solvers.kernels.tableau" in kept
    for module in kept:
        found = importlib.util.find_spec(module)
        assert found is not None
        assert str(Path(str(found.origin)).parent / "__pycache__") in kernel_cache.folders()


def test_without_landlock_only_the_temporary_folder_changes(tmp_path: Path) -> None:
    free = tmp_path / "free"
    found = _tried(
        {"elsewhere": free.touch, "own": lambda: Path(tempfile.gettempdir()).relative_to(tmp_path)},
        lambda: confinement.confine(isolation.detect("open"), str(tmp_path), own=False),
    )
    assert found == {"elsewhere": True, "own": True}
    assert isolation.detect("open").writes == isolation.detect("spawn").writes == "open"


def test_a_kernel_without_landlock_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(landlock, "_call", lambda *_: -38)
    landlock.version.cache_clear()
    try:
        assert landlock.version() == 0
        assert "no Landlock" in dict(isolation.detect().described())["writes"]
    finally:
        landlock.version.cache_clear()
