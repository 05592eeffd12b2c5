"""The pages of reproduced results: they are those of their tables, and their problems are those of the publications."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from cpbench.foundation.matrices import dense
from cpbench.solvers import Budget, solvers
from cpbench.solvers.base import Claim
from cpbench_problems.generators.lcp_hard import cycling

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "reports" / "reproductions"


def _module(path: Path) -> ModuleType:
    """Import a script of the repository that is in no package."""
    spec = importlib.util.spec_from_file_location(f"_{path.stem}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.path.insert(0, str(path.parent))
    try:
        spec.loader.exec_module(module)
    finally:
        sys.path.remove(str(path.parent))
    return module


@pytest.fixture(scope="module")
def measured() -> ModuleType:
    return _module(ROOT / "benchmarks" / "reproductions.py")


@pytest.fixture(scope="module")
def pages() -> ModuleType:
    return _module(ROOT / "docs" / "generate" / "reproductions_page.py")


@pytest.mark.parametrize("name", ["fathi", "bg2012", "exponential", "mass-ratio", "orderings", "incline"])
def test_a_page_is_that_of_its_table(pages: ModuleType, name: str) -> None:
    assert (FOLDER / f"{name}.md").read_text("utf-8") == pages.text(name) + "\n"


def test_newton_min_cycles_on_the_problem_of_the_collection(measured: ModuleType) -> None:
    """Whose cycle of n sets a test of its generator follows over the rationals."""
    for n in range(3, 9):
        np.testing.assert_array_equal(measured.ben_gharbia_gilbert_matrix(n), dense(cycling(n).problem.M))


def test_paths_on_cyclic_polytopes(measured: ModuleType) -> None:
    """Twice the sum of every third Fibonacci number, 2, 8, 34, 144, counts the longest paths; all labels end."""
    for d, longest in ((2, 4), (4, 20), (6, 88), (8, 376)):
        lengths = [measured.lemke_howson_path(d, label) for label in range(2 * d)]
        assert max(lengths) == longest == 2 * sum((2, 8, 34, 144)[: d // 2])


@pytest.mark.parametrize("n", [3, 6, 17])
def test_one_kink_a_step(measured: ModuleType, n: int) -> None:
    """From zero, each step on Fathi's problem brings one index to its side: n steps."""
    before = dict(solvers._items)
    try:
        plugin = _module(FOLDER / "newton_min.py")
        output = plugin.HarkerPang().solve(measured.fathi(n).problem, Budget(tolerance=1e-9, seconds=60.0), None)
    finally:
        solvers._items.clear()
        solvers._items.update(before)
    assert output.claim is Claim.SOLVED
    assert output.counters == {"iterations": n}
    np.testing.assert_allclose(output.point.z, np.eye(n)[0], atol=1e-9)
