"""What a report says beside its means: over what, how sure, and what the choice of shift and penalty decides."""

from __future__ import annotations

import math
from pathlib import Path

import pandas as pd
from synthetic_results import meta, row, suite, table
from written_reports import write_report

from cpbench.analysis import bootstrap, means, profiles
from cpbench.analysis import table as rows_of
from cpbench.analysis.participation import participating
from cpbench.report import figures
from cpbench.report.text import seconds


def section(rows: pd.DataFrame, folder: Path) -> str:
    """The table of times and what is said below it, '' where the report has none."""
    write_report(rows, meta(), folder, "t")
    text = (folder / "details.md").read_text(encoding="utf-8")
    return text.partition("\n### Times\n")[2].partition("\n### ")[0]


def cells(text: str) -> dict[str, dict[str, str]]:
    """Cells of each row of the table, by its first and the heading."""
    head, _, *rows = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("|")]
    return {row[0].strip("`"): dict(zip(head[1:], row[1:], strict=True)) for row in rows}


def test_means_stand_with_their_intervals(tmp_path: Path) -> None:
    text = section(suite(), tmp_path)
    group = participating(rows_of.normalised(suite()))
    times = rows_of.times(group)
    leading = profiles.performance_profile(times).leading(figures.EMPHASISED)
    every, common = means.means(times, limit=10.0), means.means(times, limit=10.0, common=leading)
    around = bootstrap.mean_time(times, every.shift, 10.0, families=bootstrap.families_of(group))
    shown = cells(text)
    assert set(shown) == set(times.columns)
    for label, found in shown.items():
        low, high = (float(around.at[label, end]) for end in ("low", "high"))
        assert found["mean over all 45"] == seconds(float(every.mean[label]))
        assert found["95 % interval"] == f"{seconds(low)} to {seconds(high)}"
        assert (found[f"mean over {common.problems} in common"] == "—") == (label not in leading)
    assert f"shift {seconds(every.shift)} (median of all times); a problem not solved is charged 10 s." in text


def test_little_to_resample_or_to_charge_is_reported(tmp_path: Path) -> None:
    rows = table(*(row(f"f-{i}", s, "solved" if i % 3 else "timeout", 1.0 + i) for i in range(6) for s in ("a", "b")))
    assert "interval" not in section(rows, tmp_path), "of one family it would say nothing"
    boundless = section(rows.assign(seconds=math.inf), tmp_path)
    assert "a problem not solved leaves none (no limit was set)" in boundless
    assert cells(boundless)["a"]["mean over all 6"] == "—"
    assert section(table(*(row(f"f-{i}", s, "timeout") for i in range(3) for s in ("a", "b"))), tmp_path) == ""


def test_solvers_that_solve_something_stand_with_their_distance_to_the_best(tmp_path: Path) -> None:
    rows = table(
        *(row(f"p-{i}", "a", "solved", t) for i, t in enumerate((1e-5, 1.0, 1.0))),
        *(row(f"p-{i}", "b", "solved", t) for i, t in enumerate((2e-5, 4.0, 1.0))),
        row("p-3", "a", "crash"),
        row("p-3", "b", "solved", 2.0),
        *(row(f"p-{i}", "idle", "timeout") for i in range(4)),
    )
    found = cells(section(rows, tmp_path))
    assert set(found) == {"a", "b"}
    assert (found["a"]["within 2 times"], found["a"]["best without it"]) == ("75%", f"{4 ** (1 / 4):.3g}")
    assert (found["b"]["within 2 times"], found["b"]["best without it"]) == ("75%", "1")
