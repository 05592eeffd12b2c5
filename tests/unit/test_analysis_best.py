"""The virtual best counted by hand, and a liar in every statistic there is."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from synthetic_results import row, suite, table

from cpbench.analysis import best, bootstrap, means, profiles, reliability, summary
from cpbench.analysis import table as rows_of

INF = math.inf
TIMES = pd.DataFrame(
    {"a": [1.0, 1.0, INF, INF, 4.0], "b": [2.0, 1.0, 3.0, INF, INF], "c": [8.0, INF, INF, INF, 1.0]},
    index=list("pqrst"),
)


def test_gaps_by_hand() -> None:
    found = best.gaps(TIMES)
    assert found["planned"].tolist() == [5, 5, 5]
    assert found["solved"].tolist() == [3, 3, 2]
    assert found["fastest"].tolist() == [2, 2, 1]
    assert found["within"].tolist() == [0.4, 0.6, 0.2]
    assert found["median"].tolist() == [1.0, 1.0, 4.5]
    assert found["mean"].tolist() == pytest.approx([4 ** (1 / 3), 2 ** (1 / 3), math.sqrt(8)])
    assert found["alone"].tolist() == [0, 1, 0]
    assert found["marginal"].tolist() == pytest.approx([2 ** (1 / 4), 1.0, 4 ** (1 / 4)])


def test_marginal_is_the_best_of_the_others() -> None:
    rows = rows_of.normalised(suite(30, 9))
    times = rows_of.times(rows)
    found = best.gaps(times)
    whole = times.min(axis=1).clip(lower=profiles.FLOOR)
    for label in times.columns:
        without = times.drop(columns=label).min(axis=1).clip(lower=profiles.FLOOR)
        assert found.at[label, "alone"] == (np.isfinite(whole) & np.isinf(without)).sum()
        both = np.isfinite(without)
        assert found.at[label, "marginal"] == pytest.approx(np.exp(np.log(without[both] / whole[both]).mean()))


def test_little_to_compare() -> None:
    one = best.gaps(TIMES[["a"]])
    assert one.at["a", "alone"] == 3
    assert math.isnan(one.at["a", "marginal"])
    nothing = best.gaps(pd.DataFrame({"a": [INF], "b": [INF]}))
    assert nothing[["median", "mean", "marginal"]].isna().all(axis=None)
    assert nothing[["solved", "within", "alone"]].eq(0).all(axis=None)
    assert best.gaps(TIMES.iloc[:0])["within"].isna().all()
    assert best.gaps(TIMES[[]]).empty


def test_a_liar_is_last_in_every_statistic() -> None:
    """Fastest by a factor of a million, claims every problem, and all of it is wrong.

    Beside it a solver as bad as an honest one can be: the slowest, beyond the limit with its conversion, on little
    more than half of the problems.
    """
    rows = []
    for i in range(20):
        problem = f"family{i % 8}-{i:02d}"
        rows.append(row(problem, "good", "solved", 0.5 + 0.01 * i) if i else row(problem, "good", "timeout"))
        rows.append(row(problem, "liar", "wrong", 1e-6, claim="solved"))
        slow = row(problem, "poor", "solved", 9.9, convert=0.5 + 0.001 * i, claim="max_iter")
        rows.append(slow if i < 11 else row(problem, "poor", "timeout"))
    group = rows_of.normalised(table(*rows))
    times, families, limit = rows_of.times(group), bootstrap.families_of(group), rows_of.limit(group)

    def last(values: pd.Series, least_first: bool) -> bool:
        """Strictly; no value (NaN) is worse than any."""
        cost = values.fillna(INF) if least_first else -values.fillna(-INF)
        return bool(cost["liar"] > cost.drop("liar").max())

    for shift in (None, 0.0, 1e-6, 10.0):
        assert last(means.means(times, limit=limit, shift=shift).mean, least_first=True), shift
    assert math.isnan(means.means(times).mean["liar"]), "no limit: it has no mean at all"
    assert means.means(times, common=["good", "liar"], limit=limit).problems == 0
    gap = best.gaps(times)
    for column in ("solved", "within"):
        assert last(gap[column].astype(float), least_first=False), column
    for column in ("median", "mean"):
        assert last(gap[column], least_first=True), column
    assert gap.loc["liar", ["fastest", "alone"]].tolist() == [0, 0]
    assert gap.at["liar", "marginal"] == 1.0, "never missed"
    profile = profiles.performance_profile(times)
    assert [curve.label for curve in profile.by_height()][-1] == "liar"
    assert "liar" not in profile.leading(7)
    cost = means.charge(times, limit)
    mean = bootstrap.mean_time(times, means.default_shift(times), cost, families=families)
    assert last(mean["estimate"], least_first=True)
    assert mean.at["liar", "low"] == pytest.approx(cost)
    assert reliability.claim_counts(group).loc["liar", ["made", "false"]].tolist() == [20, 20]
    assert summary.quantile(times, 0.5)["liar"] == INF
    assert all(summary.families(group)["best"].map(lambda names: "liar" not in names))
