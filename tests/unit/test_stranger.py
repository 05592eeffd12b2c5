"""A package of a stranger, made from CONTRIBUTING in a folder: its solver, formulation and command come in by entry
points, as those of cpbench_solvers and cpbench_lab do, and work in processes of a run."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from sliding import SLIDING

from cpbench import storage
from cpbench.bench.results.store import Store
from cpbench.formulations import LCP

ROOT = Path(__file__).resolve().parents[2]
ENTRY_POINTS = """[cpbench.plugins]
stranger = stranger.plugin
[cpbench.commands]
greet = stranger.greet:command
results.count = stranger.greet:command
[cpbench.functions]
halved = stranger.greet:halved
"""
PLUGIN = f"""{SLIDING}
from stranger import greedy  # the solver
"""
COMMAND = '''"""Print the number of unknowns of a problem. Nothing else."""

import click

from cpbench import storage


def halved(x):
    return x / 2


@click.command()
@click.argument("problem")
def command(problem):
    """Print the number of unknowns of a problem."""
    click.echo(sum(storage.load(problem).point_sizes.values()))
'''


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of installed packages with the stranger's, as pip would leave it."""
    site = tmp_path_factory.mktemp("site")
    written = _cpbench(site, site, "new", "solver", "greedy", "--node", "lcp")
    assert written.returncode == 0, written.stderr
    (site / "greedy").rename(site / "stranger")
    (site / "stranger" / "__init__.py").write_text("")
    (site / "stranger" / "plugin.py").write_text(PLUGIN)
    (site / "stranger" / "greet.py").write_text(COMMAND)
    about = site / "stranger-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: stranger\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(ENTRY_POINTS)
    storage.save(LCP(M=2.0 * np.eye(3), q=[-2.0, 1.0, -4.0], name="three"), site / "three.h5")
    return site


def _cpbench(site: Path, folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(site), str(ROOT)])}
    command = [sys.executable, "-m", "cpbench", *words]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300)


def test_a_command_of_a_package_is_listed_and_works(site: Path, tmp_path: Path) -> None:
    helped = _cpbench(site, tmp_path, "--help")
    assert any(line.split()[:1] == ["greet"] for line in helped.stdout.splitlines()), helped.stdout
    done = _cpbench(site, tmp_path, "greet", str(site / "three.h5"))
    assert (done.returncode, done.stdout) == (0, "3\n"), done.stderr


def test_a_command_of_a_package_may_stand_in_a_group(site: Path, tmp_path: Path) -> None:
    assert _cpbench(site, tmp_path, "results", "count", str(site / "three.h5")).stdout == "3\n"
    assert _cpbench(site, tmp_path, "count", str(site / "three.h5")).returncode == 2


def test_a_solver_of_a_package_runs_in_processes_of_its_own(site: Path, tmp_path: Path) -> None:
    done = _cpbench(site, tmp_path, "run", str(site / "three.h5"), "-s", "greedy", "-t", "1e-8", "-o", "a.sqlite", "-q")
    assert done.returncode == 0, done.stderr
    with Store(tmp_path / "a.sqlite") as store:
        assert [(row.solver, row.status) for row in store.rows()] == [("greedy", "solved")]


def test_a_function_of_a_package_is_offered(site: Path, tmp_path: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(site), str(ROOT)])}
    code = "import cpbench; print(cpbench.halved(3.0))"
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.stdout == "1.5\n", done.stderr
