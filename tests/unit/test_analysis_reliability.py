"""Claims against verdicts, counted by hand."""

from __future__ import annotations

import numpy as np
from synthetic_results import row, small, table

from cpbench.analysis import reliability
from cpbench.analysis import table as rows_of


def test_claims_and_false_claims() -> None:
    rows = small()
    untrue = reliability.false_claims(rows)
    assert list(zip(untrue["problem"], untrue["label"], strict=True)) == [("a-2", "lemke"), ("b-1", "pgs")]
    measured = rows.assign(target_error=rows["error"].where(rows["label"] == "pgs@inner8"))
    untrue = reliability.false_claims(measured)
    assert untrue["label"].tolist() == ["pgs@inner8", "lemke", "pgs"], "wrong on the facets too: that is the solver"
    timeout = table(row("p", "s", "timeout", claim="solved"))
    assert reliability.false_claims(rows_of.normalised(timeout)).empty, "killed or late: the limit decided, not a lie"


def test_inexact_routes() -> None:
    found = reliability.inexact_routes(small())
    assert found[["label", "kind", "pairs", "solved", "missed"]].to_numpy().tolist() == [
        ["pgs@inner8", "approximate", 2, 0, 1]
    ]
    assert found["median"].tolist() == [0.2]
    rows = small()
    for there, missed in ((1e-9, 1), (1e-3, 0)):  # the route's error, or the solver's
        measured = rows.assign(target_error=np.where(rows["key"] == "a-1/pgs@inner8", there, np.nan))
        assert reliability.inexact_routes(measured)["missed"].tolist() == [missed]
