"""Rows beside a report and exported: the same in every format, every digit of them; what is left out is told."""

from __future__ import annotations

import importlib.util
import json
import math
import sys
from pathlib import Path
from types import ModuleType

import pandas as pd
import pytest
from click.testing import CliRunner
from synthetic_results import meta, results_file, row, suite, table

from cpbench.analysis.run_table import RunTable
from cpbench.cli import cli
from cpbench.errors import FormatError
from cpbench.report import row_files
from cpbench.report.folder import write_folder

INF = math.inf
PARQUET = importlib.util.find_spec("pyarrow") is not None
needs_parquet = pytest.mark.skipif(not PARQUET, reason="does not apply: pyarrow, the extra [arrow], is not installed")


def small() -> pd.DataFrame:
    return table(
        row("a-1", "lemke", "solved", 1 / 3, error=1.2345678901234567e-13, measure="natürlich"),
        row("a-1", "pgs", "timeout", error=INF, signal=-9),
        row("a-2", "lemke", "unsupported", message='needs "M" = Mᵀ,\nand more'),
    )


def test_json_keeps_every_digit_and_what_is_infinite(tmp_path: Path) -> None:
    row_files.write(small(), tmp_path / "r.json")
    first, second, third = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))
    assert first["error"] == 1.2345678901234567e-13
    assert first["solve"] == 1 / 3
    assert (second["error"], second["solve"]) == ("inf", None)
    assert third["message"] == 'needs "M" = Mᵀ,\nand more'
    row_files.write(small().iloc[:0], tmp_path / "none.json")
    assert json.loads((tmp_path / "none.json").read_text()) == []


@needs_parquet
def test_every_format_gives_the_same_rows(tmp_path: Path) -> None:
    rows = suite(12, 8)
    for name in row_files.FORMATS:
        row_files.write(rows, tmp_path / f"r.{name}")
    whole = pd.DataFrame(json.loads((tmp_path / "r.json").read_text()))
    parquet, text = pd.read_parquet(tmp_path / "r.parquet"), pd.read_csv(tmp_path / "r.csv")
    for column in ("error", "solve", "cpu"):
        for read in (parquet, text, whole):
            assert pd.to_numeric(read[column]).tolist() == pytest.approx(rows[column].tolist(), rel=0, nan_ok=True)
    assert parquet["label"].tolist() == whole["label"].tolist() == text["label"].tolist() == rows["label"].tolist()


def test_a_file_is_whole_or_what_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "r.parquet"
    path.write_text("before")
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(FormatError, match=r"needs pyarrow: pip install 'cpbench\[arrow\]'"):
        row_files.write(small(), path)
    with pytest.raises(FormatError, match=r"unknown suffix '.xlsx'; use .csv, .json or .parquet"):
        row_files.write(small(), tmp_path / "r.xlsx")
    with pytest.raises(FormatError, match="cannot be written"):
        row_files.write(small(), tmp_path / "none" / "r.csv")
    assert [p.name for p in tmp_path.iterdir()] == ["r.parquet"]
    assert path.read_text() == "before"


def report(path: Path, *options: str) -> tuple[set[str], str]:
    """The files with rows, and what was said, of a report."""
    done = CliRunner().invoke(cli, ["report", str(path), "-o", str(path.parent / "out"), *options])
    assert done.exit_code == 0, done.output
    return {p.name for p in (path.parent / "out").glob("results.*")}, done.output


@pytest.mark.nightly
def test_a_report_has_its_rows_in_every_format(tmp_path: Path) -> None:
    sheets = {"lemke": {"name": "lemke"}, "gams": {"name": "gams", "publishing": "ask before publishing"}}
    rows = table(row("a-1", "lemke", "solved", 1.0), row("a-1", "gams", "solved", 2.0))
    path = results_file(tmp_path / "r.sqlite", rows, meta(solvers=sheets))
    found, told = report(path, "--publishable")
    assert found == {"results.csv", "results.json", *(["results.parquet"] if PARQUET else [])}
    assert f"report: {tmp_path / 'out' / 'results.json'}" in told
    assert [r["solver"] for r in json.loads((tmp_path / "out" / "results.json").read_text())] == ["lemke"]
    for frame in [pd.read_parquet(tmp_path / "out" / "results.parquet")] if PARQUET else []:
        assert frame["solver"].tolist() == ["lemke"]
        assert frame["time"].tolist() == [1.0], "the time that the profiles are of"


@pytest.mark.nightly
def test_a_report_without_pyarrow_says_so_and_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = results_file(tmp_path / "r.sqlite", small())
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    found, told = report(path)
    assert found == {"results.csv", "results.json"}
    assert told.count("no results.parquet: Parquet needs pyarrow: pip install 'cpbench[arrow]'\n") == 1


@pytest.mark.nightly
def test_a_report_has_the_formats_that_were_environment(tmp_path: Path) -> None:
    path = results_file(tmp_path / "r.sqlite", small())
    assert report(path, "--data", "csv")[0] == {"results.csv"}
    found, told = report(path, "--data", "parquet")
    assert "results.json" not in found
    assert ("results.parquet" in found) != ("needs pyarrow" in told)
    refused = CliRunner().invoke(cli, ["report", str(path), "-o", str(tmp_path / "no"), "--data", "jsn"])
    assert refused.exit_code != 0
    assert not (tmp_path / "no").exists()


def test_many_rows_are_written_where_they_are_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", ModuleType("pyarrow"))
    found, told = row_files.chosen(row_files.MOST["json"] + 1)
    assert found == ["csv", "parquet"]
    assert told == ["no results.json: 20001 rows are more than 20000; --data json writes it all the same"]
    assert row_files.chosen(row_files.MOST["json"] + 1, ["json"]) == (["csv", "json"], [])
    many = row_files.MOST["csv"] + 1
    found, told = row_files.chosen(many)
    assert found == []
    assert told[0] == "no results.csv: 200001 rows are more than 200000; --data csv writes it all the same"
    assert told[2] == "no results.parquet: 200001 rows are more than 200000; --data parquet writes it all the same"
    assert row_files.chosen(many, ["parquet"]) == (["parquet"], [])
    assert row_files.chosen(many, ["csv"]) == (["csv"], [])


@pytest.mark.nightly
def test_a_report_without_csv_does_not_speak_of_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(row_files.MOST, "csv", 1)
    sheets = {"lemke": {"name": "lemke"}, "gams": {"name": "gams", "publishing": "ask before publishing"}}
    rows = table(row("a-1", "lemke", "solved", 1.0), row("a-2", "lemke", "solved", 1.0), row("a-1", "gams", "solved"))
    path = results_file(tmp_path / "r.sqlite", rows, meta(solvers=sheets))
    found, told = report(path, "--publishable")
    assert "results.csv" not in found
    assert "no results.csv: 3 rows are more than 1; --data csv writes it all the same" in told
    text = (tmp_path / "out" / "report.md").read_text()
    assert "results.csv" not in text
    assert "results.csv" in report(path, "--data", "csv")[0]


def test_export_has_the_digits_too(tmp_path: Path) -> None:
    path = results_file(tmp_path / "r.sqlite", small())
    done = CliRunner().invoke(cli, ["results", "export", str(path), "--rows", str(tmp_path / "r.json")])
    assert done.exit_code == 0, done.output
    errors = {r["status"]: r["error"] for r in json.loads((tmp_path / "r.json").read_text())}
    assert errors["solved"] == 1.2345678901234567e-13
    assert errors["timeout"] in (None, "inf")
    assert CliRunner().invoke(cli, ["results", "export", str(path), "--rows", str(tmp_path / "r.json")]).exit_code != 0


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


def test_a_report_without_rows_as_csv_has_none(tmp_path: Path) -> None:
    write_folder(RunTable.of(suite(4, 3), meta()), tmp_path, "t", data=["json"])
    assert {path.name for path in tmp_path.glob("results.*")} == {"results.json"}


def test_cells_of_text_are_safe_and_numbers_are_as_they_were(tmp_path: Path) -> None:
    """Text that repeats is made safe wherever it stands; a number that begins with a sign is no text."""
    rows = pd.DataFrame({"text": ["=1+1", "=1+1", None, "\x1b[31m"], "number": [-1.5, math.nan, -INF, 1 / 3]})
    row_files.write(rows, tmp_path / "r.csv")
    expected = "text,number\n'=1+1,-1.5\n'=1+1,\n,-inf\n\\x1b[31m,0.3333333333333333\n"
    assert (tmp_path / "r.csv").read_bytes().decode() == expected
