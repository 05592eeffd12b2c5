"""Warm starts beside cold ones, on tables made up."""

from __future__ import annotations

import json
import math

import pytest
from synthetic_results import row, table

from cpbench.analysis import table as rows_of
from cpbench.analysis.starts import paired


def _counted(count: int) -> str:
    return json.dumps({"iterations": count})


def test_pairs_are_compared_where_both_solved() -> None:
    """Ratios 1/2 and 1/8 have the geometric mean 1/4; a step that fell back and one that failed are only counted."""
    cold = [row(f"p-{i}", "s", "solved", 8.0, counters=_counted(16)) for i in range(4)]
    warm = [
        row("p-0", "s", "solved", 4.0, start="previous", started="previous", counters=_counted(0)),
        row("p-1", "s", "solved", 1.0, start="previous", started="previous", counters=_counted(4)),
        row("p-2", "s", "solved", 8.0, start="previous", started="cold: first step", counters=_counted(16)),
        row("p-3", "s", "timeout", 10.0, start="previous", started="previous"),
    ]
    (found,) = paired(rows_of.normalised(table(*cold, *warm))).to_dict("records")
    assert (found["pairs"], found["warm"], found["cold"], found["fell_back"]) == (4, 3, 4, 1)
    assert found["time"] == pytest.approx(0.25)
    assert found["iterations"] == pytest.approx(math.sqrt(1 / 16 * 4 / 16)), "0 iterations count as 1"


def test_settings_are_not_mixed() -> None:
    cold = row("p-0", "s", "solved", 1.0)
    warm = row("p-0", "s", "solved", 1.0, start="file", started="file", tolerance=1e-8)
    assert paired(rows_of.normalised(table(cold, warm))).empty


def test_without_warm_rows_there_is_nothing() -> None:
    rows = rows_of.normalised(table(row("p-0", "s", "solved", 1.0)))
    assert paired(rows).empty
