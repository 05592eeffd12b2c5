"""Reports on solvers whose figures must not be published, and on solvers that could not run."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from command_line import cpbench
from matplotlib.text import Text
from synthetic_results import meta, row, table
from written_reports import write_report

from cpbench import storage
from cpbench.analysis.participation import absences, participating, restricted
from cpbench.bench.results.store import Store
from cpbench.formulations import LCP
from cpbench.report import canvas
from cpbench.report.figure_kinds import Drawing

TERMS = "benchmark figures need the vendor's permission"


def rows() -> pd.DataFrame:
    return table(
        *(row(f"p-{i}", "lemke", "solved", 1e-3 * (i + 1)) for i in range(3)),
        *(row(f"p-{i}", "vendor", "solved", 1e-4 * (i + 1)) for i in range(3)),
        *(row(f"p-{i}", "absent", "unavailable", message="missing: pip install absent") for i in range(3)),
        *(row(f"p-{i}", "twin", "unavailable", message="missing: pip install absent") for i in range(3)),
        row("p-0", "partly", "solved", 2e-3),
        row("p-1", "partly", "unavailable", message="licence: at most 1000 rows, found 1200"),
    )


def sheets() -> dict[str, Any]:
    return {
        name: {"name": name, "node": "lcp", "licence": "x", "publishing": TERMS if name == "vendor" else ""}
        for name in ("lemke", "vendor", "absent", "partly", "twin")
    }


def test_a_restriction_is_printed_before_any_figure(tmp_path: Path) -> None:
    told = write_report(rows(), meta(solvers=sheets()), tmp_path, "T").read_text()
    assert told.index("Publishing these figures is restricted: `vendor`") < told.index("![Performance profiles]")
    assert TERMS in told
    assert "--publishable" in told


def test_a_publishable_report_shows_nothing_of_the_restricted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawings: list[Drawing] = []
    monkeypatch.setattr(canvas, "write", lambda drawn, *_, **__: drawings.append(drawn))
    told = write_report(rows(), meta(solvers=sheets()), tmp_path, "T", publishable=True, drawn=True).read_text()
    assert "Left out" in told
    assert "restricted: `vendor`" in told
    assert told.count("vendor") == 1, "where it is said that it is left out"
    assert set(pd.read_csv(tmp_path / "results.csv")["solver"]) == {"lemke", "absent", "partly", "twin"}
    figures = " ".join(text.get_text() for drawn in drawings for text in drawn.figure.findobj(Text))
    assert "lemke" in figures
    assert "vendor" not in figures
    assert "fastest" in told


def test_a_restricted_solver_that_was_never_started_restricts_nothing() -> None:
    never = table(row("p-1", "vendor", "unavailable", message="licence: expired"))
    assert restricted(never, sheets()) == {}


def test_absent_solvers_are_listed_once_with_the_reason(tmp_path: Path) -> None:
    told = write_report(rows(), meta(solvers=sheets()), tmp_path, "T").read_text()
    assert "`absent`" not in told, "it measured nothing"
    whole = (tmp_path / "details.md").read_text()
    assert "| missing | pip install absent | `absent`, `twin` | 6 |" in whole
    assert "| licence | at most 1000 rows, found 1200 | `partly` | 1 |" in whole
    assert "Never started" not in whole


def test_the_number_of_problems_does_not_depend_on_installed_solvers() -> None:
    group = rows()
    assert set(participating(group)["label"]) == {"lemke", "vendor", "partly"}
    alone = table(row("p-0", "lemke", "solved", 1.0), row("p-9", "absent", "unavailable", message="missing: x"))
    assert len(participating(alone)) == 2, "p-9 stays a problem"


def test_reasons_are_counted_by_solver() -> None:
    found = {detail: solvers for (_, detail), solvers in absences(rows()).items()}
    assert found == {"pip install absent": {"absent": 3, "twin": 3}, "at most 1000 rows, found 1200": {"partly": 1}}


@pytest.mark.nightly
def test_the_command_leaves_them_out(tmp_path: Path) -> None:
    storage.save(LCP(M=np.array([[2.0, 1], [1, 2]]), q=[-5.0, -6.0], name="deudeu"), tmp_path / "p.h5")
    cpbench(tmp_path, "run", "p.h5", "-s", "lemke", "-s", "bpp", "-o", "r.sqlite", "--no-report", "--plan", "none")
    with Store(tmp_path / "r.sqlite", create=True) as store:
        told = store.meta()["solvers"]
        assert told["bpp"]["publishing"] == ""
        store.set_meta(solvers={**told, "bpp": {**told["bpp"], "publishing": TERMS}})
    cpbench(tmp_path, "report", "r.sqlite", "-o", "whole")
    assert TERMS in Path(tmp_path, "whole/report.md").read_text()
    cpbench(tmp_path, "report", "r.sqlite", "-o", "open", "--publishable")
    assert TERMS not in Path(tmp_path, "open/report.md").read_text()
    assert set(pd.read_csv(tmp_path / "open/results.csv")["solver"]) == {"lemke"}
    assert math.isfinite(pd.read_csv(tmp_path / "open/results.csv")["time"].iloc[0])
