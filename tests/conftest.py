"""What all tests share: a seeded generator, real data files where they stand beside the checkout, compiled kernels.

In CI (`CI=true`) a skip is a failure unless its reason begins with one of ALLOWED_SKIPS.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
from collections import Counter
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from cpbench.bench.processes.launch import THREAD_VARIABLES
from cpbench.foundation import kernel_build, kernels
from cpbench.registry import DECLARED, PLUGIN_FILES

for _variable in THREAD_VARIABLES:  # as in a run; numba takes no other number once its threads are there
    os.environ[_variable] = "1"
os.environ[kernels.CHECKED] = "1"
os.environ["OPENBLAS_NUM_THREADS"] = os.environ.get("CPBENCH_TEST_BLAS_THREADS", "1")  # of .ci/arithmetics
for _variable in ("COLUMNS", "LINES"):  # readline, which pytest imports, leaves them to parallel runs
    os.environ.pop(_variable, None)
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as a shell leaves it that starts this in the background
    signal.signal(signal.SIGINT, signal.default_int_handler)  # else no child would hear the Ctrl-C of a test
ROOT = Path(__file__).resolve().parents[1]
ABSENT = [name for name in ("cpbench_solvers", "cpbench_lab") if find_spec(name) is None]
"""Packages that cpbench does without: `.ci/core` runs these tests where neither is installed."""
if "cpbench_solvers" in ABSENT:
    os.environ[PLUGIN_FILES] = os.pathsep.join(map(str, sorted((ROOT / "tests" / "reference").glob("*.py"))))
ALLOWED_SKIPS = ("needs the folder of real files", "needs a licence", "needs a program: julia", "does not apply")
collect_ignore = [
    "unit/siconos_errors.py",
    "unit/siconos_read.py",
    "lab/cluster_solvers.py",
    "faults/faulty_solvers.py",
    "faults/forging_solvers.py",
    "faults/served_faults.py",
    *(name.removeprefix("cpbench_") for name in ABSENT),
    *(("docs", "browser") if ABSENT else ()),  # what is said of all packages
]
LONG = ("faults", "browser", "lab")
"""Folders whose tests wait for processes, pages and proofs."""
_unexpected: list[str] = []


@pytest.fixture(autouse=True, scope="module")
def no_plugins_of_others() -> Iterator[None]:
    """What a command in the test's process loads or declares reaches the processes of its own module only."""
    before = {name: os.environ.get(name) for name in (PLUGIN_FILES, DECLARED)}
    yield
    for name, value in before.items():
        if value is None:
            os.environ.pop(name, None)
        else:
            os.environ[name] = value


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


def pytest_configure(config: pytest.Config) -> None:
    """Compile the kernels that have changed since cpbench was installed."""
    if not hasattr(config, "workerinput"):
        errors = kernel_build.build(kernel_build.present(), [kernels.level()])
        if errors and shutil.which("cc"):
            pytest.exit("\n".join(errors), 2)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Skip tests whose mark `needs` names a package that is not installed; put long tests first, so that no worker is
    left with them at the end."""
    items.sort(key=lambda item: item.path.parent.name not in LONG)
    for item in items:
        for mark in item.iter_markers("needs"):
            lacking = [name for name in mark.args if name in ABSENT]
            if lacking:
                item.add_marker(pytest.mark.skip(f"needs {', '.join(lacking)}"))


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    if report.skipped and not hasattr(report, "wasxfail"):
        reason = _reason(report)
        if not reason.startswith(ALLOWED_SKIPS):
            _unexpected.append(f"{report.nodeid}: {reason}")


def pytest_sessionfinish(session: pytest.Session) -> None:
    if os.environ.get("CI") == "true" and _unexpected:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


_MARKS = {"passed": ".", "skipped": "-", "xfailed": "x", "failed": "F", "error": "F", "xpassed": "F"}


def _conformance(stats) -> dict[str, dict[str, dict[str, str]]]:
    """kind -> plugin -> check -> mark, from the ids of tests/conformance/test_conformance.py."""
    found: dict[str, dict[str, dict[str, str]]] = {}
    for outcome, mark in _MARKS.items():
        for report in stats.get(outcome, []):
            named = re.search(r"test_conformance\.py::test_(\w+)\[(.+)-check_(\w+)\]$", getattr(report, "nodeid", ""))
            if named:
                kind, plugin, check = named.groups()
                found.setdefault(kind, {}).setdefault(plugin, {})[check] = mark
    return found


def _reason(report) -> str:
    """Why a test was skipped; what enables it follows after 'needs'."""
    reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
    return reason.removeprefix("Skipped: ")


def _skips(terminalreporter) -> None:
    """The last lines: what each skipped test needs, and where nothing would make it apply."""
    count = Counter(_reason(report) for report in terminalreporter.stats.get("skipped", []))
    if count:
        terminalreporter.section(f"{count.total()} skipped, and what would enable them")
    for start in ("needs", "does not apply", ""):  # what is left is listed as well
        for reason, times in count.most_common():
            if reason.startswith(start):
                terminalreporter.line(f"{times:>5}  {reason}")
                del count[reason]


def pytest_terminal_summary(terminalreporter) -> None:
    table = _conformance(terminalreporter.stats)
    if table:
        terminalreporter.section("conformance: . ran, - skipped, x known failure, F failed")
    for kind, plugins in sorted(table.items()):
        checks = sorted({check for row in plugins.values() for check in row})
        terminalreporter.line(f"{kind} checks: " + ", ".join(f"{k} {check}" for k, check in enumerate(checks, 1)))
        for plugin, row in sorted(plugins.items()):
            marks = " ".join(row.get(check, " ").rjust(2) for check in checks)
            terminalreporter.line(f"  {plugin:<24}{marks}")
    _skips(terminalreporter)
    if os.environ.get("CI") == "true" and _unexpected:
        terminalreporter.section("skips without a listed reason (failures in CI)")
        for line in _unexpected:
            terminalreporter.line(line)
