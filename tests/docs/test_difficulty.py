"""The page on how hard the collection is: it is that of its tables, and counts as it says."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAIRS = """tier,node,family,problem,solver,status,solved,seconds
small,lcp,a,p1,quick,solved,1,0.001
small,lcp,a,p1,slow,solved,1,0.1
small,lcp,a,p1,third,failed,0,
standard,lcp,a,p1,quick,timeout,0,
standard,lcp,a,p1,slow,solved,1,3
standard,lcp,a,p2,quick,solved,1,0.5
standard,lcp,a,p2,slow,solved,1,0.75
standard,lcp,b,p1,quick,unsupported,0,
standard,lcp,b,p1,slow,failed,0,
standard,lcp,b,p1,third,unsupported,0,
"""
RANKING = """tier,node,place,solver,started,solved,median
small,lcp,1,quick,1,1,0.001
small,lcp,2,slow,1,1,0.1
small,lcp,3,third,1,0,
standard,lcp,1,slow,3,2,1.9
standard,lcp,2,third,1,0,
standard,lcp,3,quick,2,1,0.5
"""
RUNS = """tier,pairs,problems,of,largest,hours,peak_gb,timeout,tolerance,version,processor,collection
small,3,1,1,10,0.01,0.10,5,1e-06,0.1.0,X,the collection
standard,7,3,8,2500,0.50,2.00,5,1e-06,0.1.0,X,the collection
"""


@pytest.fixture
def page() -> ModuleType:
    path = ROOT / "docs" / "generate" / "difficulty_page.py"
    spec = importlib.util.spec_from_file_location("_difficulty_page", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.path.insert(0, str(path.parent))
    sys.modules["_difficulty_page"] = module
    try:
        spec.loader.exec_module(module)
    finally:
        sys.path.remove(str(path.parent))
    return module


def test_the_page_is_that_of_its_tables(page: ModuleType) -> None:
    assert (page.FOLDER / "difficulty.md").read_text("utf-8") == page.page() + "\n"


def test_shares_rankings_and_hard_problems_are_counted(page: ModuleType, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(page, "FOLDER", tmp_path)
    for name, text in (("pairs", PAIRS), ("ranking", RANKING), ("runs", RUNS)):
        (tmp_path / f"{name}.csv").write_text(text, encoding="utf-8")
    lines = page.page().splitlines()
    # small: quick and slow solve 1 of 1; standard: slow 2 and quick 1 of 3; third was not started there
    assert (
        "| lcp | 100 % (1 of 1), 2 solvers | 100 % (1 of 1) | 67 % (2 of 3), `slow` | 50 % (1.5 of 3) | 1 | 1 |"
        in lines
    )
    assert "| lcp | a | 100 % (2 of 2), `slow` | 75 % (1.5 of 2) | 1 | 0 |" in lines
    assert "| lcp | b | 0 % (0 of 1), `slow` | 0 % (0 of 1) | 0 | 1 |" in lines
    change = "`slow` leads instead of `quick`"
    order = "`quick` 1/1, `slow` 1/1 | `slow` 2/3, `quick` 1/2"
    assert f"| lcp | {order} | {change} |" in lines
    assert lines[2] == (
        "Of the small tier the best solver of each formulation solves 100 %, the median 100 %. Of the standard tier "
        "the best solver of each formulation solves 67 %, the median 50 %. On 1 of 1 formulations another solver is "
        "first on the standard tier."
    )
    for start in (
        "- small: 3 pairs on all 1 problems of the formulations below, of at most 10 unknowns, in 0.01 h, 5 s for each",
        "- standard: 7 pairs on 3 of 8 problems of the formulations below, of at most 2500 unknowns, in 0.50 h",
    ):
        assert any(line.startswith(start) for line in lines), start


def test_a_formulation_that_keeps_its_order_is_reported(page: ModuleType) -> None:
    rows = [{"place": "1", "solver": "s"}, {"place": "2", "solver": "t"}]
    assert page.change(rows, rows) == "`s` stays first"
    assert page.change(rows, []) == "ranked on one tier only"
    other = [{"place": "1", "solver": "t"}, {"place": "2", "solver": "u"}, {"place": "3", "solver": "s"}]
    assert page.change(rows, other) == "`t` leads instead of `s`; `s` falls from place 1 to 3"
