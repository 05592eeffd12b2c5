"""A supervised process is killed at the limit of the phase it is in, and what it loads is not in its solve."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import psutil
import pytest

from cpbench.bench.processes.supervised import Stopped, Supervised

BEGIN = """
import json, os, sys, time
asked = json.loads(sys.stdin.readline())
def say(**note): print(json.dumps(note), flush=True)
"""
LONG, SHORT = 600.0, 0.3


def ended(body: str, notes: list[Mapping[str, Any]] | None = None, **limits: float) -> Any:
    """What a program answers within the limits of its phases."""
    with Supervised(BEGIN + body, 1) as process:
        return process.ask({"number": 7}, "read", {"read": LONG, "load": LONG, **limits}, (notes or []).append)


def test_the_answer_comes_with_all_notes_before_it() -> None:
    notes: list[Mapping[str, Any]] = [{}]
    answer = ended("say(node='lcp'); say(phase='solve'); say(answer=asked['number'] + 1)", notes, solve=LONG)
    assert answer == 8
    assert notes == [{}, {"node": "lcp"}]


def test_a_phase_that_exceeds_its_limit_is_killed_with_all_that_it_started(tmp_path: Path) -> None:
    body = (
        f"import subprocess; child = subprocess.Popen(['sleep', '600'])\n"
        f"open({str(tmp_path / 'ids')!r}, 'w').write(f'{{os.getpid()}} {{child.pid}}')\n"
        "say(phase='solve'); time.sleep(600)"
    )
    with pytest.raises(Stopped) as stopped:
        ended(body, solve=SHORT)
    assert (stopped.value.phase, stopped.value.code) == ("solve", None)
    ids = [int(pid) for pid in (tmp_path / "ids").read_text().split()]
    assert len(ids) == 2
    over = time.monotonic() + 60.0
    while any(map(_runs, ids)):  # one that is killed may be seen for a moment more
        assert time.monotonic() < over
        time.sleep(0.01)


def _runs(pid: int) -> bool:
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


def test_what_happens_between_the_parts_of_a_phase_is_not_in_its_time() -> None:
    parts = "say(phase='solve'); say(phase='load'); time.sleep(1.2); say(phase='solve'); say(answer=1)"
    assert ended(parts, solve=1.0) == 1
    with pytest.raises(Stopped):
        ended(parts.replace("say(phase='load'); ", ""), solve=1.0)


@pytest.mark.parametrize(("body", "code"), [("sys.exit(3)", 3), ("os.kill(os.getpid(), 9)", -9)])
def test_a_death_has_its_code_and_phase(body: str, code: int) -> None:
    with pytest.raises(Stopped) as stopped:
        ended(f"say(phase='load')\n{body}")
    assert (stopped.value.phase, stopped.value.code) == ("load", code)
