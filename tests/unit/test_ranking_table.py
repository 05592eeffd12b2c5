"""`cpbench plot table`: the numbers of a ranking as text that can be pasted."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import pandas as pd
import pytest
from click.testing import CliRunner
from synthetic_results import results_file, row

from cpbench.cli import cli

ROWS = [
    *(row(f"p-{k}", "fast_one", "solved", 0.002, error=4e-9) for k in range(4)),
    *(row(f"p-{k}", "slow%", "solved" if k else "timeout", 0.05, error=2.5e-7) for k in range(4)),
]


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return results_file(tmp_path_factory.mktemp("table") / "r.sqlite", pd.DataFrame(ROWS))


def written(results: Path, *options: str) -> str:
    done = CliRunner().invoke(cli, ["plot", "table", str(results), *options], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.output


def test_csv_has_every_digit(results: Path) -> None:
    rows = list(csv.DictReader(io.StringIO(written(results, "--format", "csv"))))
    assert [(r["solver"], r["solved"], r["counted"]) for r in rows] == [("fast_one", "4", "4"), ("slow%", "3", "4")]
    assert [float(r["median_s"]) for r in rows] == [0.002, 0.05]
    assert [float(r["error"]) for r in rows] == [4e-9, 2.5e-7]
    assert float(rows[1]["times_fastest"]) == pytest.approx(25.0)


def test_markdown_is_printed_or_written(results: Path, tmp_path: Path) -> None:
    shown = written(results)
    assert "| `slow%` | 3 of 4 | 50 | 25 | 2.5e-07 |" in shown
    assert written(results, "-o", str(tmp_path / "t.md")).startswith("table: ")
    assert (tmp_path / "t.md").read_text() == shown


def test_a_formulation_that_is_not_there_is_refused(results: Path) -> None:
    done = CliRunner().invoke(cli, ["plot", "table", str(results), "--node", "qp"])
    assert "unknown formulation of the results 'qp'" in str(done.exception)
