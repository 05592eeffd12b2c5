"""The page of the laws of physics engines: its commands work, its code runs, and its numbers come out otherwise too."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "tests" / "unit"))

import cpbench  # noqa: E402


@pytest.fixture(scope="module")
def made() -> Iterator[Any]:
    """The module that makes the page."""
    sys.path.insert(0, str(ROOT / "docs" / "generate"))
    import engine_laws_page

    yield engine_laws_page
    sys.path.remove(str(ROOT / "docs" / "generate"))


def test_the_box_is_the_boxed_lcp(made: Any) -> None:
    """The law by the conversion, and by A, b, lo, hi, findex of the same contact: one contact has one answer."""
    problem = cpbench.load(f"{made.FILE}::one-slide")
    mu = float(problem.mu[0])
    boxed = cpbench.from_boxed_lcp(problem.W, -problem.q, [0.0, -mu, -mu], [np.inf, mu, mu], findex=[-1, 0, 0])
    r = boxed.lift(cpbench.solve(boxed.problem, tolerance=1e-10))
    law = next(law for law in made.LAWS if law.name == "box")
    assert made.reactions(law, problem) == pytest.approx(r, abs=1e-6)


def test_bounds_taken_once_by_hand(made: Any) -> None:
    """W = I + ½(e_N e_1ᵀ + e_1 e_Nᵀ), q = (−2, 1, 0), μ = ½: without friction n = 2, so that t₁ stays at −1 and
    n = 2.5; by the law of the box n − 2 = n/4, n = 8/3."""
    W = np.eye(3)
    W[0, 1] = W[1, 0] = 0.5
    problem = cpbench.FrictionContact(W=W, q=[-2.0, 5.0, 0.0], mu=[0.5])
    by_name = {law.name: law for law in made.LAWS}
    once = made.reactions(by_name["box, bounds taken once"], problem)
    assert once == pytest.approx([2.5, -1.0, 0.0], abs=1e-6)
    assert made.reactions(by_name["box"], problem) == pytest.approx([8 / 3, -4 / 3, 0.0], abs=1e-6)


def test_the_page_has_all_numbers_and_its_code_runs(made: Any) -> None:
    text = made.page()
    code = text.partition("```python\n")[2].partition("```")[0]
    found: dict[str, Any] = {}
    exec(code, found)
    assert found["x"] == pytest.approx([2.0, -1.0, -0.4], abs=1e-6)
    rows = [line for line in text.splitlines() if line.startswith("| ") and " %, " in line]
    assert len(rows) == len(made.LAWS)
    assert all(line.count(" %, ") == len(made.SCENES) for line in rows)
