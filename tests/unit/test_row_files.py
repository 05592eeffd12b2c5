"""Rows beside a report and exported: every digit of them; what is left out is told."""

from __future__ import annotations

import math
from pathlib import Path

import pandas as pd
import pytest
from click.testing import CliRunner
from synthetic_results import meta, results_file, row, table

from cpbench.cli import cli
from cpbench.errors import FormatError
from cpbench.report import row_files

INF = math.inf


def small() -> pd.DataFrame:
    return table(
        row("a-1", "lemke", "solved", 1 / 3, error=1.2345678901234567e-13, measure="natürlich"),
        row("a-1", "pgs", "timeout", error=INF, signal=-9),
        row("a-2", "lemke", "unsupported", message='needs "M" = Mᵀ,\nand more'),
    )


def test_a_file_is_whole_or_what_it_was(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_text("before")
    with pytest.raises(FormatError, match=r"unknown suffix '.xlsx'; use .csv"):
        row_files.write(small(), tmp_path / "r.xlsx")
    with pytest.raises(FormatError, match="cannot be written"):
        row_files.write(small(), tmp_path / "none" / "r.csv")
    assert [p.name for p in tmp_path.iterdir()] == ["r.csv"]
    assert path.read_text() == "before"


def report(path: Path, *options: str) -> tuple[set[str], str]:
    """The files with rows, and what was said, of a report."""
    done = CliRunner().invoke(cli, ["report", str(path), "-o", str(path.parent / "out"), *options])
    assert done.exit_code == 0, done.output
    return {p.name for p in (path.parent / "out").glob("results.*")}, done.output


def test_many_rows_are_written_where_they_are_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(row_files, "MOST", 1)
    sheets = {"lemke": {"name": "lemke"}, "gams": {"name": "gams", "publishing": "ask before publishing"}}
    rows = table(row("a-1", "lemke", "solved", 1.0), row("a-2", "lemke", "solved", 1.0), row("a-1", "gams", "solved"))
    path = results_file(tmp_path / "r.sqlite", rows, meta(solvers=sheets))
    found, told = report(path, "--publishable")
    assert found == set()
    assert "no results.csv: 3 rows are more than 1; --csv writes it all the same" in told
    assert "results.csv" not in (tmp_path / "out" / "report.md").read_text()
    assert report(path, "--publishable", "--csv")[0] == {"results.csv"}
    frame = pd.read_csv(tmp_path / "out" / "results.csv")
    assert (frame["solver"].tolist(), frame["time"].tolist()) == (["lemke"] * 2, [1.0, 1.0])


def test_export_has_the_digits_too(tmp_path: Path) -> None:
    path = results_file(tmp_path / "r.sqlite", small())
    words = ["results", "export", str(path), "--rows", str(tmp_path / "r.csv")]
    done = CliRunner().invoke(cli, words)
    assert done.exit_code == 0, done.output
    read = pd.read_csv(tmp_path / "r.csv", dtype=str).set_index("status")
    assert float(read.at["solved", "error"]) == 1.2345678901234567e-13
    assert float(read.at["solved", "solve"]) == 1 / 3
    assert "\n" not in str(read.at["unsupported", "message"])
    assert CliRunner().invoke(cli, words).exit_code != 0


def test_columns_of_an_export_are_sorted_and_say_the_decade_of_the_error(tmp_path: Path) -> None:
    rows = table(
        row("b", "lemke", "solved", 1.0, error=3e-9),
        row("a", "pgs", "wrong", 2.0, error=2e-3),
        row("a", "lemke", "failed", 3.0, error=0.5),
        row("a", "psor", "timeout", error=INF),
    )
    path = results_file(tmp_path / "r.sqlite", rows)
    words = ["results", "export", str(path), "--columns", "problem,solver,status,decade"]
    expected = (
        "problem,solver,status,decade\na,lemke,failed,\na,pgs,wrong,1e-02\na,psor,timeout,inf\nb,lemke,solved,<=1e-06\n"
    )
    done = CliRunner().invoke(cli, words)
    assert done.exit_code == 0, done.exception
    assert done.output == expected
    assert CliRunner().invoke(cli, [*words, "--rows", str(tmp_path / "kept.csv")]).exit_code == 0
    assert (tmp_path / "kept.csv").read_text() == expected
    unknown = CliRunner().invoke(cli, ["results", "export", str(path), "--columns", "statsu"])
    assert unknown.exit_code != 0
    assert "unknown column of the rows 'statsu'" in str(unknown.exception)


def test_cells_of_text_are_safe_and_numbers_are_as_they_were(tmp_path: Path) -> None:
    """Text that repeats is made safe wherever it stands; a number that begins with a sign is no text."""
    rows = pd.DataFrame({"text": ["=1+1", "=1+1", None, "\x1b[31m"], "number": [-1.5, math.nan, -INF, 1 / 3]})
    row_files.write(rows, tmp_path / "r.csv")
    expected = "text,number\n'=1+1,-1.5\n'=1+1,\n,-inf\n\\x1b[31m,0.3333333333333333\n"
    assert (tmp_path / "r.csv").read_bytes().decode() == expected
