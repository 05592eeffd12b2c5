"""Times to an error, over histories that are made up: two problems, three solvers, times in whole seconds."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pandas as pd
from synthetic_results import row, table
from written_reports import write_report

from cpbench.analysis import histories
from cpbench.report import tables


def _path(key: str, *steps: tuple[float, float]) -> pd.DataFrame:
    """Iterates (time, error) of a row whose recorded solve took 4 s."""
    time, error = (np.array(column) for column in zip(*steps, strict=True))
    return pd.DataFrame(
        {"key": key, "time": time, "iteration": time, "residual": 0.0, "error": error, "share": time / 4.0}
    )


ROWS = table(
    row("p", "fast", "solved", 4.0),
    row("p", "slow", "solved", 8.0, convert=1.0, setup=0.5, lift=0.25),
    row("p", "mute", "solved", 0.1),
    row("q", "fast", "solved", 4.0),
    row("q", "slow", "failed", 8.0, convert=1.0, setup=0.5, lift=0.25),
    row("q", "mute", "solved", 0.1),
)
PATHS = pd.concat(
    [
        _path("p/fast", (0.0, 1.0), (1.0, 1e-2), (2.0, 1e-4), (4.0, 1e-8)),
        _path("p/slow", (0.0, 1.0), (2.0, 1e-2), (3.0, 1e-1), (4.0, 1e-8)),
        _path("q/fast", (0.0, 1.0), (3.0, 1e-2), (4.0, 1e-8)),
        _path("q/slow", (0.0, 1.0), (4.0, 0.5)),
        _path("elsewhere", (0.0, 0.0)),
    ],
    ignore_index=True,
)


def test_times_are_shares_of_the_timed_solve_with_what_comes_before_and_after() -> None:
    seconds = histories.charged(ROWS, PATHS).set_index(["label", "fingerprint", "time"])["seconds"]
    assert seconds["slow", "f-p"].max() == 1.0 * 8.0 + 1.75


def test_without_any_history_there_is_nothing() -> None:
    none = PATHS.iloc[:0]
    assert not len(histories.work_precision(ROWS, none))
    assert not len(tables.precision(ROWS, none))


def test_medians_count_what_was_not_reached() -> None:
    found = histories.work_precision(ROWS, PATHS).itertuples(index=False)
    at = {(r.label, r.error): (r.reached, r.seconds) for r in found}
    assert at["fast", 1e-2] == (2, 2.0)
    assert at["fast", 1e-6] == (2, 4.0)
    assert at["slow", 1.0] == (2, 1.75)
    assert at["slow", 1e-2] == (1, math.inf)
    assert min(error for _, error in at) == 1e-6  # the tolerance of the rows
    assert {label for label, _ in at} == {"fast", "slow"}


def test_the_table_counts_what_was_reached() -> None:
    assert [row[:4] for row in tables.precision(ROWS, PATHS).cells()] == [
        ["`fast`", "2 s", "3 s", "4 s"],
        ["`slow`", "∞ (1)", "∞ (1)", "∞ (1)"],
    ]


def test_a_report_shows_the_histories_it_is_given(tmp_path: Path) -> None:
    write_report(ROWS, {}, tmp_path / "with", "t", PATHS)
    write_report(ROWS, {}, tmp_path / "without", "t")
    assert "### Error against time" in (tmp_path / "with" / "details.md").read_text()
    assert "### Error against time" not in (tmp_path / "without" / "details.md").read_text()
