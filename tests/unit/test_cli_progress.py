"""What a run shows: a bar on a terminal, lines elsewhere; and what is left after Ctrl-C."""

from __future__ import annotations

import contextlib
import os
import pty
import re
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from command_line import with_plugins

from cpbench import storage
from cpbench.bench.results.store import Store
from cpbench.formulations import LCP

SLOW = """
import time
from cpbench.formulations import LCPPoint
from cpbench.solvers import Claim, Solver, SolverOutput, SolverSpec, register

@register
class Slow(Solver):
    spec = SolverSpec(name="slow", node="lcp", summary="takes its time", method="sleep")

    def solve(self, prepared, budget, options, start=None, record=None):
        time.sleep(1.2 if prepared.name != "p0" else 0.0)
        return SolverOutput(claim=Claim.SOLVED, point=LCPPoint(z=-prepared.q / 2.0))
"""

BAR = r"[1-9]\d*/80\s+pairs,\s+\S+\s+left\s+\d+ solved"
"""What the bar says of some pairs that were solved."""
ESCAPES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for k in range(40):
        q = np.full(k + 1, -1.0 - k)
        storage.save(LCP(M=2.0 * np.eye(k + 1), q=q, name=f"p{k}"), tmp_path / f"p{k}.h5")
    (tmp_path / "slow.py").write_text(SLOW)
    return tmp_path


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "cpbench", "--plugin", "slow.py", "run", ".", "--no-report", *arguments]


def on_a_terminal(folder: Path, arguments: list[str], until: Callable[[str], bool]) -> tuple[int, str]:
    """Exit code and what a terminal of 100 columns got, without its colours; SIGINT once `until` holds of that."""
    ours, theirs = pty.openpty()
    env = {**os.environ, "COLUMNS": "100", "LINES": "30", "TERM": "xterm-256color"}
    env.pop("NO_COLOR", None)
    running = subprocess.Popen(arguments, cwd=folder, stdin=theirs, stdout=theirs, stderr=theirs, env=env)
    os.close(theirs)
    seen, asked, deadline = "", False, time.monotonic() + 600
    while time.monotonic() < deadline:
        if select.select([ours], [], [], 0.1)[0]:
            part = b""
            with contextlib.suppress(OSError):
                part = os.read(ours, 65536)
            if not part:
                break
            seen += part.decode()
        if not asked and until(ESCAPES.sub("", seen)):
            asked = True
            running.send_signal(signal.SIGINT)
    code = running.wait(600)
    os.close(ours)
    return code, ESCAPES.sub("", seen)


@pytest.mark.nightly
def test_a_terminal_shows_a_bar_and_ctrl_c_leaves_a_resumable_file(folder: Path) -> None:
    """Interrupted while the second problem is being solved: exit code 130, nothing half-written, and it goes on."""
    arguments = command("-s", "lemke", "-s", "slow", "--timeout", "20s", "-o", "r.sqlite")
    code, seen = on_a_terminal(folder, arguments, lambda text: "slow on p" in text and bool(re.search(BAR, text)))
    assert code == 130, seen
    assert re.search(r"slow on p\d+, at most 20 s", seen), seen
    assert "interrupted; r.sqlite has what was done, the same command goes on" in " ".join(seen.split())
    with Store(folder / "r.sqlite") as store:
        counts = store.counts()
        done = counts.pop("solved")
        assert counts == {"not_run": 80 - done}
        assert len(list(store.answers())) == done
    again = command("-s", "lemke", "-o", "r.sqlite", "--timeout", "20s", "--where", "n <= 2")
    assert subprocess.run(again, cwd=folder, timeout=600, check=False).returncode == 0


@pytest.mark.needs("cpbench_solvers")
def test_elsewhere_it_shows_lines(folder: Path) -> None:
    done = with_plugins(folder, "run", ".", "--no-report", "-s", "lemke", "-o", "r.sqlite")
    assert done.returncode == 0, done.stderr
    assert "40 pairs\n" in done.stderr
    assert "40/40  40 solved\n" in done.stderr
    assert "\x1b" not in done.stderr


@pytest.mark.nightly
def test_quiet_is_nothing(folder: Path) -> None:
    arguments = command("-s", "lemke", "--where", "n == 1", "-o", "q.sqlite", "-q")
    done = subprocess.run(arguments, cwd=folder, timeout=600, capture_output=True, text=True, check=True)
    assert done.stderr == ""
