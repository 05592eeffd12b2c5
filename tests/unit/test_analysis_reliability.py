"""Claims against verdicts, counted by hand, and Wilson's interval against SciPy's."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats
from synthetic_results import row, small, suite, table

from cpbench.analysis import reliability
from cpbench.analysis import table as rows_of


def test_claims_and_false_claims() -> None:
    rows = small()
    found = reliability.claims(rows)
    assert found.loc["lemke", ["true", "false", "modest", "honest"]].tolist() == [1, 1, 0, 0]
    assert found.loc["pgs", ["true", "false", "modest", "honest"]].tolist() == [1, 1, 1, 0]
    assert found.loc["pgs@inner8", ["true", "false", "modest", "honest"]].tolist() == [0, 1, 0, 1]
    assert found.loc["pgs", "correct"] == 0.5
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


def test_wilson_is_scipys() -> None:
    trials = [(0, 1), (1, 1), (0, 30), (30, 30), (7, 9), (450, 1000), (1, 10**6)]
    for level in (0.9, 0.95, 0.99):
        low, high = reliability.wilson([k for k, _ in trials], [n for _, n in trials], level)
        wanted = [stats.binomtest(k, n).proportion_ci(level, method="wilson") for k, n in trials]
        np.testing.assert_allclose(low, [w.low for w in wanted], rtol=1e-10, atol=1e-15)
        np.testing.assert_allclose(high, [w.high for w in wanted], rtol=1e-10)
    assert np.isnan(reliability.wilson(0, 0)).all()


def test_rates_of_the_silent_the_absent_and_the_liar() -> None:
    rows = [row(f"p-{i}", "silent", "solved", 1.0, claim="max_iter") for i in range(4)]
    rows += [row(f"p-{i}", "absent", "unavailable") for i in range(4)]
    rows += [row(f"p-{i}", "liar", "wrong", 1.0) for i in range(4)]
    rows += [row("p-0", "killed", "timeout"), row("p-1", "killed", "solved", 1.0)]
    found = reliability.reliability(rows_of.normalised(table(*rows)))
    assert found.loc["silent", ["planned", "judged", "solved", "modest", "recognised", "rate"]].tolist() == [
        *(4, 4, 4, 4),
        *(0.0, 1.0),
    ]
    assert found.loc["silent", ["correct", "correct_low", "correct_high"]].isna().all(), "it never claimed"
    assert found.loc["absent", ["planned", "started", "judged", "solved"]].tolist() == [4, 0, 0, 0]
    assert found.loc["absent", ["correct", "rate", "rate_low", "rate_high", "recognised"]].isna().all()
    assert found.loc["liar", ["correct", "correct_low", "rate", "rate_low"]].tolist() == [0.0] * 4
    assert found.loc["liar", "correct_high"] == pytest.approx(0.4899, abs=1e-4)
    assert math.isnan(found.loc["liar", "recognised"])
    assert found.loc["killed", ["planned", "started", "judged", "rate"]].tolist() == [2, 2, 1, 0.5]
    said = reliability.claims(rows_of.normalised(suite(20, 12)))
    known = said[said["correct"].notna()]
    assert ((known["low"] <= known["correct"]) & (known["correct"] <= known["high"])).all()
    assert reliability.reliability(rows_of.normalised(table())).empty
