"""Shared fixtures: the seeded generator, and the real data files where they stand beside the checkout.

In CI (`CI=true`) a skip is a failure unless its reason begins with one of ALLOWED_SKIPS.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[1]
ALLOWED_SKIPS = ("needs the folder of real files",)
collect_ignore = ["unit/siconos_errors.py", "unit/siconos_read.py", "faults/faulty_solvers.py"]
_unexpected: list[str] = []


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20260801)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real files; tests that need it skip where it is not there."""
    folder = ROOT.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("needs the folder of real files (../shared/data), which is not part of the project")
    return folder


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    if report.skipped and not hasattr(report, "wasxfail"):
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
        if not reason.removeprefix("Skipped: ").startswith(ALLOWED_SKIPS):
            _unexpected.append(f"{report.nodeid}: {reason}")


def pytest_sessionfinish(session: pytest.Session) -> None:
    if os.environ.get("CI") == "true" and _unexpected:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter) -> None:
    if os.environ.get("CI") == "true" and _unexpected:
        terminalreporter.section("skips without a listed reason (failures in CI)")
        for line in _unexpected:
            terminalreporter.line(line)
