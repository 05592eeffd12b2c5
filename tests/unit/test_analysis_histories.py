"""Times to an error, over histories that are made up: two problems, three solvers, times in whole seconds."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from synthetic_results import looks_of, row, table
from tiers import some_by_day
from written_reports import write_report

from cpbench.analysis import histories, reliability
from cpbench.report import convergence, figures
from cpbench.report.run import Run


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


def _run(folder: Path, paths: pd.DataFrame) -> Run:
    return Run(ROWS, {}, folder, paths, looks=looks_of(ROWS["label"]))


def test_times_are_shares_of_the_timed_solve_with_what_comes_before_and_after() -> None:
    times = histories.times_to(ROWS, PATHS, 1e-2)
    assert times.loc["f-p"].to_dict() == {"fast": 1.0, "slow": 0.5 * 8.0 + 1.75}
    assert times.loc["f-q"].to_dict() == {"fast": 3.0, "slow": math.inf}


def test_without_any_history_there_is_nothing() -> None:
    none = PATHS.iloc[:0]
    assert histories.times_to(ROWS, none, 1e-2).shape == (2, 0)
    assert not len(histories.work_precision(ROWS, none))
    assert not list(convergence.section(_run(Path(), none), ROWS, "", ""))


def test_medians_count_what_was_not_reached() -> None:
    found = histories.work_precision(ROWS, PATHS).itertuples(index=False)
    at = {(r.label, r.error): (r.reached, r.seconds) for r in found}
    assert at["fast", 1e-2] == (2, 2.0)
    assert at["fast", 1e-6] == (2, 4.0)
    assert at["slow", 1.0] == (2, 1.75)
    assert at["slow", 1e-2] == (1, math.inf)
    assert min(error for _, error in at) == 1e-6  # the tolerance of the rows
    assert {label for label, _ in at} == {"fast", "slow"}


def test_the_section_has_a_figure_and_a_table(tmp_path: Path) -> None:
    text = "\n".join(convergence.section(_run(tmp_path, PATHS), ROWS, "lcp", "errors-lcp"))
    assert "| `fast` | 2 s | 3 s | 4 s |" in text
    assert "| `slow` | ∞ (1) | ∞ (1) | ∞ (1) |" in text
    assert (tmp_path / "errors-lcp.png").stat().st_size > 10_000
    assert (tmp_path / "errors-lcp.svg").stat().st_size > 10_000


@pytest.mark.parametrize("solvers", some_by_day([1, 9, 40], 1))
def test_any_number_of_curves_can_be_drawn(tmp_path: Path, solvers: int) -> None:
    rows = table(*(row("p", f"s{k}", "solved", 1.0 + k) for k in range(solvers)))
    paths = pd.concat([_path(f"p/s{k}", (0.1, 1.0), (1.0, 1e-3), (4.0, 1e-7)) for k in range(solvers)])
    found = histories.work_precision(rows, paths)
    assert figures.save(convergence.figure(found, 1, "title", looks_of(found["label"])), tmp_path, "f")[0].exists()


@pytest.mark.nightly
def test_a_report_shows_the_histories_it_is_given(tmp_path: Path) -> None:
    with_figure = write_report(ROWS, {}, tmp_path / "with", "t", PATHS, drawn=True).read_text()
    without = write_report(ROWS, {}, tmp_path / "without", "t").read_text()
    assert "(details-lcp.md)" in with_figure
    assert "[![Error against time" in (tmp_path / "with" / "details-lcp.md").read_text()
    assert (tmp_path / "with" / "errors-lcp.svg").exists()
    assert "Error against time" not in without + (tmp_path / "without" / "details-lcp.md").read_text()


def test_a_row_without_a_claim_claims_nothing() -> None:
    rows = table(row("p", "s", "solved", 1.0), row("q", "s", "solved", 1.0, claim=""))
    found = reliability.claims(rows)
    assert (found.at["s", "true"], found.at["s", "modest"]) == (1, 0)
