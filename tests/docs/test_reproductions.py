"""The pages of reproduced results: they are those of their tables, and their problems are those of the publications."""

from __future__ import annotations

import importlib.util
import sys
from fractions import Fraction
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from cpbench.solvers import Budget, solvers
from cpbench.solvers.base import Claim

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


def test_newton_min_in_exact_arithmetic(measured: ModuleType) -> None:
    """Plain Newton-min from -e1 comes back to its first set of indices after n steps, over the rationals."""
    for n in range(3, 9):
        M = [[Fraction(x).limit_denominator(6) for x in row] for row in measured.ben_gharbia_gilbert_matrix(n)]
        x = [Fraction(-int(i == 0)) for i in range(n)]
        seen = [_negative(M, x)]
        while seen.count(seen[-1]) == 1:
            x = _next(M, seen[-1])
            seen.append(_negative(M, x))
        assert len(seen) - 1 - seen.index(seen[-1]) == n


def _negative(M: list[list[Fraction]], x: list[Fraction]) -> frozenset[int]:
    """Return the indices at which Mx + q is the smaller of the two, for q = e."""
    return frozenset(i for i, row in enumerate(M) if sum(map(_product, row, x), Fraction(1)) < x[i])


def _product(a: Fraction, b: Fraction) -> Fraction:
    return a * b


def _next(M: list[list[Fraction]], chosen: frozenset[int]) -> list[Fraction]:
    """Solve (Mx + e)_i = 0 for the chosen i and x_i = 0 for the others, by Gauss and Jordan."""
    n, keep = len(M), sorted(chosen)
    rows = [[M[i][j] for j in keep] + [Fraction(-1)] for i in keep]
    for k in range(len(keep)):
        pivot = next(r for r in range(k, len(keep)) if rows[r][k])
        rows[k], rows[pivot] = rows[pivot], rows[k]
        rows[k] = [value / rows[k][k] for value in rows[k]]
        for r in range(len(keep)):
            if r != k:
                rows[r] = [value - rows[r][k] * other for value, other in zip(rows[r], rows[k], strict=True)]
    x = [Fraction(0)] * n
    for k, i in enumerate(keep):
        x[i] = rows[k][-1]
    return x


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
