"""The table of claims: each claim is in one column, and solvers of cpbench stand first."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest
from synthetic_results import meta, row
from written_reports import whole, write_report

from cpbench.analysis.reliability import NEAR, claim_counts, near
from cpbench.analysis.table import normalised


def _rows() -> pd.DataFrame:
    return pd.DataFrame(
        [
            row("a", "mine", "solved", 1.0),
            row("b", "mine", "inaccurate", 1.0, error=1.2e-6),  # within twice the tolerance of 1e-6
            row("c", "mine", "inaccurate", 1.0, error=2.2e-6),
            row("d", "mine", "wrong", 1.0),
            row("e", "mine", "failed", 1.0, claim="failed"),  # no claim
            row("f", "mine", "lost", 1.0, claim="solved", error=0.5, target_error=1e-7, target_tolerance=1e-6),
            # the error on its own problem decides, not that on the asked one
            row("g", "mine", "inaccurate", 1.0, error=1e-3, target_error=1.5e-7, target_tolerance=1e-7),
            row("a", "guest", "failed", 1.0, claim="infeasible"),  # `mine` has an answer
            row("e", "guest", "failed", 1.0, claim="infeasible"),
            row("h", "guest", "infeasible", 1.0, claim="infeasible"),
            row("b", "guest", "unresolvable", 1.0, claim="solved"),
        ]
    )


def test_every_claim_is_in_one_column() -> None:
    found = claim_counts(normalised(_rows()))
    columns = ["made", "confirmed", "near", "false", "nonexistence", "open"]
    assert found.loc["mine", columns].tolist() == [6, 2, 2, 2, 0, 0]
    assert found.loc["guest", columns].tolist() == [4, 1, 0, 0, 1, 2]


@pytest.mark.parametrize(("factor", "is_near"), [(1.0, False), (1.01, True), (1.99, True), (2.01, False), (4.0, False)])
def test_near_ends_at_twice_the_tolerance(factor: float, is_near: bool) -> None:
    rows = normalised(pd.DataFrame([row("a", "s", "inaccurate", 1.0, error=factor * 1e-6)]))
    assert near(rows).tolist() == [is_near]
    assert NEAR == 2.0


def test_the_report_has_the_solvers_of_cpbench_first(tmp_path: Path) -> None:
    about = meta(solvers={"mine": {"name": "mine", "native": True}, "guest": {"name": "guest"}})
    text = whole(write_report(_rows(), about, tmp_path, "run"))
    head = "| solver | claims made | confirmed | near | false | false: no solution | undecided |"
    lines = text[text.index(head) :].splitlines()
    assert lines[2:4] == ["| `mine` | 6 | 2 | 2 | 2 | · | · |", "| `guest` | 4 | 1 | · | · | 1 | 2 |"]
