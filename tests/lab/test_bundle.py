"""A bundle holds what repeats a run: after unpacking, its command gives the same outcomes."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

import cpbench as cp
from cpbench.bench.results.store import Store

PLAN = '[[set]]\nproblems = ["scenes/p.h5", "../other.h5"]\nsolvers = ["lemke"]\nrepeats = 1\n'


def cpbench(folder: Path, *arguments: str, rc: int = 0) -> str:
    done = subprocess.run([sys.executable, "-m", "cpbench", *arguments], cwd=folder, capture_output=True, text=True)
    assert done.returncode == rc, done.stderr
    return done.stdout + done.stderr


def outcomes(path: Path) -> dict[str, tuple[str, float | None]]:
    with Store(path) as store:
        return {row.problem: (row.status, row.error) for row in store.rows()}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of a plan: a problem below the folder, one beside it."""
    folder = tmp_path_factory.mktemp("bundle") / "here"
    (folder / "scenes").mkdir(parents=True)
    M = np.array([[2.0, 1.0], [1.0, 2.0]])
    cp.save(cp.LCP(M=M, q=[-5.0, -6.0], name="below"), folder / "scenes" / "p.h5")
    cp.save(cp.LCP(M=M, q=[-1.0, 2.0], name="beside"), folder.parent / "other.h5")
    (folder / "plan.toml").write_text(PLAN)
    cpbench(folder, "run", "--plan", "plan.toml", "-o", "r.sqlite", "--no-report", "-q")
    return folder


@pytest.mark.needs("cpbench_solvers")
def test_a_bundle_holds_the_run_and_repeats_it(folder: Path, tmp_path: Path) -> None:
    said = cpbench(folder, "results", "bundle", "r.sqlite", "-o", str(tmp_path / "run.zip"))
    assert "3 files beside the results" in said
    with zipfile.ZipFile(tmp_path / "run.zip") as archive:
        archive.extractall(tmp_path / "again")
    again = tmp_path / "again"
    (moved,) = (again / "elsewhere").iterdir()
    text = (again / "README.md").read_text()
    assert f"`elsewhere/{moved.name}` was `../other.h5`" in text
    assert "cpbench run --plan plan.toml -o r.sqlite --no-report -q" in text
    assert f"numpy=={np.__version__}" in (again / "versions.txt").read_text().splitlines()
    assert outcomes(again / "results.sqlite") == outcomes(folder / "r.sqlite")
    (tmp_path / "other.h5").write_bytes(moved.read_bytes())
    cpbench(again, "run", "--plan", "plan.toml", "-o", "r.sqlite", "--no-report", "-q")
    assert outcomes(again / "r.sqlite") == outcomes(folder / "r.sqlite")


@pytest.mark.needs("cpbench_solvers")
def test_what_is_missing_or_changed_is_named(folder: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    copy.mkdir()
    (copy / "r.sqlite").write_bytes((folder / "r.sqlite").read_bytes())
    (copy / "scenes").mkdir()
    (copy / "scenes" / "p.h5").write_bytes(b"other")
    said = cpbench(copy, "results", "bundle", "r.sqlite", "-o", "run.zip")
    with zipfile.ZipFile(copy / "run.zip") as archive:
        text = archive.read("README.md").decode()
    for line in ("not in the bundle: ../other.h5", "problem files that changed after the run read them: scenes/p.h5"):
        assert line in said
        assert line in text
    refused = cpbench(copy, "results", "bundle", "r.sqlite", "-o", "run.zip", rc=2)
    assert "exists already: --force replaces it" in refused
