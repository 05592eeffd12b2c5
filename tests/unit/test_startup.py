"""What a start costs: as a ratio to the bare interpreter in the same run, in modules, and in what waits for what."""

from __future__ import annotations

import os
import resource
import statistics
import subprocess
import sys

import pytest
from tiers import some_by_day


def _seconds(*arguments: str) -> float:
    """Return the processor time of an interpreter that may keep its bytecode [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": ""}
    subprocess.run([sys.executable, *arguments], capture_output=True, check=True, env=environment)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def test_help_costs_at_most_six_bare_interpreters() -> None:
    pairs = [(_seconds("-m", "cpbench", "--help"), _seconds("-c", "pass")) for _ in range(7)]
    # of pairs, each measured in one moment: on a busy machine the least of either is luck
    assert statistics.median(help / bare for help, bare in pairs) <= 6


LEFT = ("CPBENCH_PLUGINS", "CPBENCH_SOLVERS")
"""What a command that ran in this process may have left for others."""


def _said(code: str, **variables: str) -> str:
    """What a fresh interpreter prints."""
    environment = {name: value for name, value in os.environ.items() if name not in LEFT} | variables
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def _processor_seconds(code: str) -> float:
    """Return the processor time of a fresh interpreter that may keep its bytecode [s]."""
    return float(_said(f"{code}\nimport time; print(time.process_time())", PYTHONDONTWRITEBYTECODE=""))


@pytest.mark.needs("cpbench_solvers", "cpbench_lab")
def test_the_command_line_itself_is_small() -> None:
    """Few modules of ours, and none of other packages that add commands."""
    code = (
        "import sys; from cpbench.cli import cli; cli.main(['--help'], standalone_mode=False); "
        "print(*sorted(name for name in sys.modules if name.startswith('cpbench') or name in ('numpy', 'asyncio')))"
    )
    below = ["", ".extensions", ".imports", ".text"]
    ours = ["", ".cli", ".errors", *(f".foundation{name}" for name in below)]
    assert _said(code).splitlines()[-1].split() == [f"cpbench{name}" for name in ours]


def test_a_plugin_names_its_packages_and_imports_none_of_them() -> None:
    """Nor the registries that take them: what a format or a family needs is loaded when one is asked for."""
    code = (
        "import sys, cpbench_problems; print([m for m in ('numpy', 'h5py', 'cpbench.storage') if m in sys.modules]); "
        "from cpbench.generators import generators; generators.get('lcp-classics'); "
        "few = sum('cpbench_problems.' in m for m in sys.modules); "
        "print('american-put' in generators.names(), 2 * few < sum('cpbench_problems.' in m for m in sys.modules))"
    )
    assert _said(code).splitlines() == ["[]", "True True"]


LIBRARIES = "import scipy.sparse.linalg, cpbench_solvers.kernels.tableau"
"""What no first solve can do without: SciPy's sparse matrices, and the first of its kernels."""


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize(
    "problem",
    some_by_day(
        [
            "lcp/lcp-classics.h5::fathi-10",
            "mlcp/mlcp-planted.h5::kkt-30-20",
            "qp/qp-planted.h5::bounds-50",
            "fc/contact-planted-3d.h5::full-rank-6",
            "ncp/ncp-classics.h5::josephy",
        ],
        1,
    ),
)
def test_a_first_solve_costs_at_most_twice_what_its_libraries_take_to_load(problem: str) -> None:
    code = f"import cpbench; assert cpbench.solve(cpbench.load('builtin/{problem}'))"
    # the first one of a checkout writes the bytecode, and others run beside the rest
    pairs = [(_processor_seconds(code), _processor_seconds(LIBRARIES)) for _ in range(4)]
    assert min(solve for solve, _ in pairs) <= 2 * min(libraries for _, libraries in pairs)


def test_the_answer_and_the_report_of_a_run_load_what_they_need_only() -> None:
    """What draws, optimises or integrates takes a quarter of a second, of which a run of one pair needs nothing."""
    slow = ("matplotlib", "scipy.optimize", "scipy.special", "scipy.spatial")
    code = f"import sys, cpbench.cli.answer, cpbench.api.reports; print([m for m in {slow!r} if m in sys.modules])"
    assert _said(code) == "[]"


@pytest.mark.skipif(sys.platform != "linux", reason="does not apply: Linux only")
@pytest.mark.parametrize(
    ("arguments", "begins"),
    some_by_day(
        [
            (["run", "p.h5", "-s", "lemke", "--timeout=1"], True),
            (["run"], True),
            (["run", "p.h5", "--cluster=local"], False),
            (["run", "--plan", "mine.toml"], False),
            (["run", "--help"], False),
            (["solve", "p.h5"], False),
            (["info", "p.h5"], False),
        ],
        2,
    ),
)
def test_a_run_begins_its_processes_before_it_imports(arguments: list[str], begins: bool) -> None:
    """Unless a file or an option may say how."""
    code = (
        f"import os, sys, psutil, cpbench.cli; os.chdir('/'); cpbench.cli._begin_run({arguments!r}); "
        "print(len(psutil.Process().children()) > 0, 'numpy' in sys.modules)"
    )
    assert _said(code) == f"{begins} False"
