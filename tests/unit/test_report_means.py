"""What a report says beside its means: over what, how sure, and what the choice of shift and penalty decides."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from synthetic_results import meta, row, suite, table
from written_reports import write_report

from cpbench.analysis import bootstrap, means, profiles
from cpbench.analysis import table as rows_of
from cpbench.analysis.participation import participating
from cpbench.report import figures
from cpbench.report.text import seconds


def section(rows: pd.DataFrame, folder: Path, heading: str) -> str:
    """The text under a heading, '' where the report has none."""
    write_report(rows, meta(), folder, "t")
    text = (folder / "details-lcp.md").read_text(encoding="utf-8")
    return text.partition(f"\n### {heading}\n")[2].partition("\n### ")[0]


def cells(text: str) -> dict[str, list[str]]:
    """Cells of each row of the table, by its first."""
    rows = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("| `")]
    return {first.strip("`"): rest for first, *rest in rows}


def test_means_stand_beside_their_counts_and_intervals(tmp_path: Path) -> None:
    text = section(suite(), tmp_path, "Means")
    group = participating(rows_of.normalised(suite()))
    times = rows_of.times(group)
    leading = profiles.performance_profile(times).leading(figures.EMPHASISED)
    every, common = means.means(times, limit=10.0), means.means(times, limit=10.0, common=leading)
    around = bootstrap.intervals(bootstrap.mean_time(times, every.shift, 10.0), bootstrap.families_of(group)).table
    shown = cells(text)
    assert set(shown) == set(times.columns)
    for label, found in shown.items():
        own = every.table.loc[label]
        assert found[:3] == [str(own["solved"]), str(own["charged"]), "0"]
        assert found[3] == seconds(float(own["mean"]))
        assert found[4] == f"{seconds(around.at[label, 'low'])} to {seconds(around.at[label, 'high'])}"
        assert (found[5] == "—") == (label not in leading)
    assert f"mean over all 45 | 95 % interval | mean over {common.problems} in common |" in text
    assert "- interval: bootstrap of 5 families\n" in text
    assert f"shift {seconds(every.shift)} (median of all times); a problem not solved is charged 10 s" in text


@pytest.mark.nightly
def test_little_to_resample_or_to_charge_is_reported(tmp_path: Path) -> None:
    rows = table(*(row(f"f-{i}", s, "solved" if i % 3 else "timeout", 1.0 + i) for i in range(6) for s in ("a", "b")))
    text = section(rows, tmp_path, "Means")
    assert "interval" not in text
    assert "all solve: **few**" in text
    few = table(*(row(f"f{i % 3}-{i}", s, "solved", 1.0 + i) for i in range(6) for s in ("a", "b")))
    assert "interval" not in section(few, tmp_path, "Means"), "of 3 families it would say nothing"
    boundless = section(rows.assign(seconds=math.inf), tmp_path, "Means")
    assert "a problem not solved leaves none (no limit was set)" in boundless
    assert "rank" not in boundless
    assert cells(boundless)["a"][3] == "—"
    nothing = table(*(row(f"f-{i}", s, "timeout") for i in range(3) for s in ("a", "b")))
    assert section(nothing, tmp_path, "Means") == section(nothing, tmp_path, "Gap to the virtual best") == ""


def test_the_gap_and_the_floor(tmp_path: Path) -> None:
    rows = table(
        *(row(f"p-{i}", "a", "solved", t) for i, t in enumerate((1e-5, 1.0, 1.0))),
        *(row(f"p-{i}", "b", "solved", t) for i, t in enumerate((2e-5, 4.0, 1.0))),
        row("p-3", "a", "crash"),
        row("p-3", "b", "solved", 2.0),
    )
    text = section(rows, tmp_path, "Gap to the virtual best")
    assert cells(text) == {
        "a": ["3", "75%", "1", "1", "0", f"{4 ** (1 / 4):.3g}"],
        "b": ["4", "75%", f"{4 ** (1 / 4):.3g}", f"{np.cbrt(4):.3g}", "1", "1"],
    }
    assert "taken together, solves 4 of 4." in text
    assert cells(section(rows, tmp_path, "Solved and times"))["a"][-1] == "1"


def test_a_solver_that_solved_nothing_is_counted_and_not_listed(tmp_path: Path) -> None:
    rows = [row(f"f-{i}", label, "solved", 1e-3) for i in range(4) for label in ("one", "two")]
    rows += [row(f"f-{i}", label, "timeout") for i in range(4) for label in ("idle", "late", "none")]
    text = section(table(*rows), tmp_path, "Means")
    assert set(cells(text)) == {"one", "two"}
    assert "- not listed: 3 solvers without an answer\n" in text
    assert set(cells(section(table(*rows), tmp_path, "Gap to the virtual best"))) == {"one", "two"}
