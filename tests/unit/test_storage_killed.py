"""`cpbench convert`, killed while it writes: OUT is absent, or what it was, or complete; nothing else is left."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from tiers import some_by_day

from cpbench import storage
from cpbench.formulations import LCP, Relay

pytestmark = pytest.mark.skipif(
    not (hasattr(os, "O_TMPFILE") and Path("/proc/self/fd").is_dir()),
    reason="does not apply: files without a name, and /proc to see them written, are Linux's",
)
N = 1200
"""11 MB: writing takes half a second, with compression."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A large problem, and what converting it gives."""
    place = tmp_path_factory.mktemp("large")
    M = np.random.default_rng(5).standard_normal((N, N))
    storage.save(Relay(M=M, q=np.ones(N), lb=-np.ones(N), ub=np.ones(N)), place / "in.h5", compress=False)
    assert convert(place, "out.h5").wait() == 0
    return place


def convert(place: Path, out: str, *more: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "cpbench", "convert", "in.h5", out, "--to", "relay", *more]
    return subprocess.Popen(command, cwd=place, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def killed_after(child: subprocess.Popen[bytes], place: Path, nbytes: int) -> int:
    """Kill the process when its file without a name holds `nbytes`; that file's size then, -1 when it had none."""
    seen = -1
    while child.poll() is None:
        seen = max(seen, _nameless_size(child.pid, place))
        if seen >= nbytes:
            break
        time.sleep(0.001)
    child.send_signal(signal.SIGKILL)
    child.wait()
    return seen


def _nameless_size(pid: int, place: Path) -> int:
    try:
        for fd in Path(f"/proc/{pid}/fd").iterdir():
            target = os.readlink(fd)
            if target.startswith(str(place)) and target.endswith("(deleted)"):
                return os.stat(fd).st_size
    except OSError:  # closed meanwhile
        pass
    return -1


@pytest.mark.nightly
@pytest.mark.parametrize("share", some_by_day([0.0, 0.5, 0.9], 1))
@pytest.mark.parametrize("suffix", some_by_day([".h5", ".dat"], 1))
def test_killed_while_writing(suffix: str, share: float, folder: Path) -> None:
    before = sorted(os.listdir(folder))
    full = (folder / "out.h5").stat().st_size
    out = folder / f"killed{suffix}"
    seen = killed_after(convert(folder, out.name), folder, int(share * full))
    assert seen >= share * full, "the process ended before it was seen to write"
    left = sorted(os.listdir(folder))
    if out.exists():  # the last moment: it was complete
        assert storage.load(out).fingerprint == storage.load(folder / "in.h5").fingerprint
        out.unlink()
        left.remove(out.name)
    assert left == before
    assert storage.problem_files([folder]) == [str(folder / "in.h5"), str(folder / "out.h5")]


@pytest.mark.nightly
@pytest.mark.parametrize("share", some_by_day([0.0, 0.5], 1))
def test_killed_while_replacing(share: float, folder: Path) -> None:
    out = folder / "kept.h5"
    storage.save(LCP(M=np.eye(2), q=np.ones(2)), out, force=True)
    old, full = out.read_bytes(), (folder / "out.h5").stat().st_size
    assert killed_after(convert(folder, out.name, "--force"), folder, int(share * full)) >= share * full
    if out.read_bytes() != old:
        assert storage.load(out).fingerprint == storage.load(folder / "in.h5").fingerprint
    out.unlink()
    assert [str(folder / "in.h5"), str(folder / "out.h5")] == storage.problem_files([folder])
    for left in set(os.listdir(folder)) - {"in.h5", "out.h5"}:  # between its two last steps: named, not yet in place
        assert left.startswith(".kept.h5.")
        assert left.endswith(".tmp")
        (folder / left).unlink()


@pytest.mark.parametrize("delay", some_by_day([0.3, 0.8], 1))
def test_killed_before_it_writes(delay: float, folder: Path) -> None:
    child = convert(folder, "early.h5")
    time.sleep(delay)
    child.send_signal(signal.SIGKILL)
    child.wait()
    left = set(os.listdir(folder)) - {"in.h5", "out.h5"}
    assert left <= {"early.h5"}
    if left:
        assert storage.load(folder / "early.h5").fingerprint == storage.load(folder / "in.h5").fingerprint
        (folder / "early.h5").unlink()
