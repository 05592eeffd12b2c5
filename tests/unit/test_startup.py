"""Start-up of the command line, as a ratio to the bare interpreter in the same run."""

from __future__ import annotations

import subprocess
import sys
import time


def _seconds(*arguments: str) -> float:
    begun = time.perf_counter()
    subprocess.run([sys.executable, *arguments], capture_output=True, check=True)
    return time.perf_counter() - begun


def test_help_costs_at_most_six_bare_interpreters() -> None:
    pairs = [(_seconds("-m", "cpbench", "--help"), _seconds("-c", "pass")) for _ in range(7)]
    assert min(help for help, _ in pairs) <= 6 * min(bare for _, bare in pairs)
