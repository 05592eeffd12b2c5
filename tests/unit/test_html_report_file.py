"""The file of the HTML report: what is in it, and what can never be."""

from __future__ import annotations

import base64
import hashlib
import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from synthetic_results import meta, row, suite, table
from written_reports import write_html

from cpbench.analysis import metrics
from cpbench.analysis import table as rows_of
from cpbench.analysis.run_table import RunTable
from cpbench.report.page import SCRIPTS
from cpbench.report.page_data import columns_of, packed, unpacked
from cpbench.report.run import assembled


def data_of(path: Path) -> tuple[dict[str, Any], Any]:
    found = re.search(r'id="data">([^<]*)</script>', path.read_text(encoding="utf-8"))
    assert found is not None
    return unpacked(found[1])


def test_every_row_is_there_with_its_numbers(tmp_path: Path) -> None:
    rows = suite(problems=30, labels=12)
    columns, facts = data_of(write_html(rows, meta(), tmp_path, "t"))
    clean = rows_of.normalised(rows)
    clean = clean[clean["label"] != "highs"]  # it was not installed, and has no row in any figure
    names = facts["labels"]["name"]
    told = pd.DataFrame(
        {
            "problem": [facts["problems"]["name"][k] for k in columns["problem"]],
            "label": [names[k] for k in columns["label"]],
            "status": [facts["status"]["names"][k] for k in columns["status"]],
            "time": columns["time"],
            "message": [facts["texts"]["message"][k] for k in columns["detail.message"]],
        }
    ).sort_values(["problem", "label"], ignore_index=True)
    wanted = clean.assign(time=metrics.spent(clean, metrics.METRICS["time"])).sort_values(["problem", "label"])
    wanted = wanted[list(told)].reset_index(drop=True)
    pd.testing.assert_frame_equal(told, wanted, check_dtype=False)


def test_solvers_are_in_order_of_the_area_under_their_profile(tmp_path: Path) -> None:
    rows = table(
        *(
            row(f"p{k}", label, "solved", time)
            for k in range(4)
            for label, time in (("a", 4.0), ("c", 1.0), ("d", 2.0))
        ),
        *(row(f"p{k}", "b", "failed") for k in range(4)),
    )
    _, facts = data_of(write_html(rows, meta(), tmp_path, "t"))
    assert [facts["labels"]["name"][code] for code in facts["groups"][0]["order"]] == ["c", "d", "a", "b"]


def test_the_same_run_gives_the_same_bytes(tmp_path: Path) -> None:
    first, second = (write_html(suite(9, 5), meta(), tmp_path / name, "t").read_bytes() for name in "ab")
    assert first == second


def test_only_our_scripts_may_run_and_nothing_is_fetched(tmp_path: Path) -> None:
    evil = "</script><script>alert(1)</script>"
    rows = table(row(evil, evil, "solved", 1.0, message=evil), row("p", evil, "failed", family=evil))
    text = write_html(rows, meta(command=evil), tmp_path, evil).read_text(encoding="utf-8")
    assert evil not in text
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', text)
    assert policy is not None
    assert "default-src 'none'" in policy[1]
    scripts = re.findall(r"<script(?: type=\"module\")?>(.*?)</script>", text, re.DOTALL)
    assert len(scripts) == len(SCRIPTS)
    for script in scripts:
        assert base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() in policy[1]
    around = re.sub(r"<script.*?</script>", "", text, flags=re.DOTALL)
    assert not re.search(r'(?:src|href)="(?!#)|url\(', around)


def test_restricted_solvers_leave_no_trace(tmp_path: Path) -> None:
    rows = table(row("p", "open", "solved", 1.0), row("p", "closed", "solved", 2.0))
    sheets = {name: {"name": name, "publishing": told} for name, told in (("open", ""), ("closed", "ask first"))}
    path = write_html(rows, meta(solvers=sheets), tmp_path, "t", publishable=True)
    columns, facts = data_of(path)
    assert facts["labels"]["name"] == ["open"]
    assert len(columns["label"]) == 1
    assert "Left out" in path.read_text(encoding="utf-8")


def test_the_page_opens_with_the_formulation_of_which_most_was_solved(tmp_path: Path) -> None:
    """And not with that of most pairs, which may all be refused."""
    refused = [row("a-1", f"s{k}", "unsupported", node="avi") for k in range(9)]
    rows = table(*refused, row("b-1", "s0", "solved", 1.0, node="lcp"), row("c-1", "s0", "failed", node="mlcp"))
    _, facts = data_of(write_html(rows, meta(), tmp_path, "t"))
    assert facts["groups"][facts["first"]]["name"] == "lcp"


def test_no_row_is_a_page_too(tmp_path: Path) -> None:
    text = write_html(table().iloc[:0], meta(), tmp_path, "t").read_text(encoding="utf-8")
    assert "No pair was planned" in text


def test_many_rows_keep_their_costs_and_some_failures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cpbench.report.page_data.WHOLE", 100)
    monkeypatch.setattr("cpbench.report.page_data.KEPT", 20)
    rows = suite(problems=30, labels=12)
    columns, facts = columns_of(assembled(RunTable.of(rows, meta()), Path("x")))
    assert facts["whole"] is False
    assert facts["kept"] == 20 == len(columns["detail.message"])
    shown = np.flatnonzero(columns["detail"])
    verified = np.array(facts["status"]["verified"])[columns["status"][shown]]
    assert not verified.any()
    assert len(np.unique(columns["label"][shown])) > 5, "failures of all solvers by turns"
    again, _ = unpacked(packed(columns, facts))
    np.testing.assert_allclose(again["time"], columns["time"], rtol=1e-6)
