"""Several starts of one problem: the plan has a pair for each, and each is a case of one formulation."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from synthetic_results import meta, row, table
from written_reports import whole, write_report

from cpbench.analysis import starts
from cpbench.analysis import table as rows_of
from cpbench.analysis.ranking import rankings
from cpbench.bench.planning.assembly import assemble
from cpbench.bench.planning.run_plan import ProblemSet, RunPlan
from cpbench.bench.slot import Slot
from cpbench.bench.starts import each_start, parse_start
from cpbench.errors import CpbenchError
from cpbench.generators.collection import builtin_folder


def rows() -> pd.DataFrame:
    """Two solvers and three starts: one finds both solutions, the other one of them, and fails from the third."""

    def at(start: str, label: str, status: str = "solved") -> dict[str, Any]:
        return row("kojima", label, status, 1e-3, node="ncp", start=start, started=start, key=f"{start}/{label}")

    found = [at(start, label) for start in ("file", "file:2") for label in ("newton", "path")]
    return table(*found, at("file:10", "newton"), at("file:10", "path", "max_iter"))


def test_starts_are_cases_of_one_formulation_and_no_formulations(tmp_path: Path) -> None:
    [ranking] = rankings(rows_of.normalised(rows()))
    assert (ranking.formulation, ranking.problems_and_starts) == ("ncp", "1 problem, 3 starts")
    assert ranking.sentence == ("ncp: a hint from 1 problem, 3 starts: newton solves 3 of 3, alone on 1, fastest on 2.")
    text = whole(write_report(rows(), meta(), tmp_path, "t"))
    assert "one solver: ncp (1 problem, 3 starts).\n" in text
    assert "(1 problem, 2 solver configurations)" in text
    assert "--start file:10" in text, "the command that runs the failure again names its start"
    assert set(pd.read_csv(tmp_path / "results.csv")["start"]) == {"file", "file:2", "file:10"}


def test_one_start_is_as_it_was() -> None:
    clean = rows_of.normalised(rows()[lambda d: d["start"] == "file"])
    assert starts.merged(clean) is clean


@pytest.mark.needs("cpbench_solvers")
def test_a_plan_has_a_pair_for_each_start_of_a_file() -> None:
    """The file of Kojima and Shindo's problem has 8 starting points."""
    place = f"{builtin_folder()}/ncp/ncp-classics.h5::kojima-shindo"
    asked = ProblemSet(problems=(place,), solvers=("path-search",), start=("cold", "file:all"))
    with Slot() as slot:
        found = assemble(RunPlan(sets=(asked,)), slot, builtin_folder)
    assert [pair.start for pair in found.pairs] == ["cold", "file", *(f"file:{k}" for k in range(2, 9))]


def test_each_start_is_read() -> None:
    assert str(parse_start("file:all")) == "file:all"
    assert each_start("previous", 4) == ["previous"]
    with pytest.raises(CpbenchError, match="file:all"):
        parse_start("file:every")
