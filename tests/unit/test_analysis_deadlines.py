"""Deadline statistics against values worked out by hand, numpy's and SciPy's quantiles, SciPy's intervals of Wilson,
and runs of misses counted by `itertools.groupby`."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from synthetic_results import row, table

from cpbench.analysis import deadlines as late
from cpbench.analysis import histories as paths
from cpbench.analysis import table as rows_of


def _sequence(name: str, label: str, times: list[float], first: int = 0) -> list[dict[str, object]]:
    return [
        row(
            f"{name}-{k}",
            label,
            "solved" if math.isfinite(t) else "timeout",
            t if math.isfinite(t) else math.nan,
            sequence=name,
            step=first + k,
        )
        for k, t in enumerate(times)
    ]


def _rows(*parts: list[dict[str, object]]) -> pd.DataFrame:
    whole = [one for part in parts for one in part]
    shuffled = np.random.default_rng(3).permutation(len(whole))
    columns = [*table().columns, "sequence", "step"]
    return rows_of.normalised(pd.DataFrame([whole[k] for k in shuffled], columns=columns))


INF = math.inf


def test_quantiles_are_those_of_numpy_where_all_is_finite() -> None:
    rng = np.random.default_rng(0)
    for count in (1, 2, 3, 20, 99, 100, 101, 1000):
        values = rng.lognormal(size=count)
        levels = (0.01, 0.25, 0.5, 0.9, 0.95, 0.99, 0.999, 1.0)
        found = late.quantiles(pd.DataFrame({"s": values}), levels)["s"].to_numpy()
        assert found.tolist() == np.quantile(values, levels, method="inverted_cdf").tolist()
        assert found.tolist() == stats.quantile(values, levels, method="inverted_cdf").tolist()


def test_a_rounded_product_does_not_skip_a_value() -> None:
    """0.07 · 100 is a little more than 7 in doubles; numpy and SciPy take the eighth value for that."""
    assert late.quantiles(pd.DataFrame({"s": np.arange(1.0, 101.0)}), (0.07,)).to_numpy().tolist() == [[7.0]]


def test_a_quantile_says_how_many_are_late() -> None:
    """p99 ≤ D exactly when at most 1 % missed D, whichever D, failures among the times."""
    rng = np.random.default_rng(1)
    times = pd.DataFrame(rng.lognormal(size=(200, 40)))
    times[times > rng.uniform(2, 30, 40)] = INF
    p99 = late.quantiles(times, (0.99,)).to_numpy()[0]
    for deadline in (0.5, 2.0, 10.0, 25.0):
        assert ((p99 <= deadline) == ((times > deadline).sum().to_numpy() <= 2)).all()


def test_failures_stay_among_the_times() -> None:
    """Two failures of a hundred: p95 is the 95th time, p99 and the largest are infinite."""
    rows = _rows(_sequence("walk", "s", [*(k / 1000 for k in range(1, 99)), INF, INF]))
    (found,) = late.deadlines(rows, 0.0905).to_dict("records")
    assert (found["problems"], found["solved"]) == (100, 98)
    assert (found["p50"], found["p95"], found["p99"], found["max"]) == (0.05, 0.095, INF, INF)
    assert (found["misses"], found["share"], found["longest"], found["longest_from"]) == (10, 0.1, 10, 90)


def test_a_wrong_answer_misses_every_deadline() -> None:
    rows = rows_of.normalised(table(row("a", "liar", "wrong", 1e-6), row("a", "late", "solved", 9.0)))
    found = late.deadlines(rows, 1.0).set_index("label")
    assert found["misses"].to_dict() == {"liar": 1, "late": 1}
    assert found.loc["liar", ["p50", "max", "error_p50"]].tolist() == [INF, INF, INF]
    assert late.deadlines(rows, 10.0).set_index("label")["misses"].to_dict() == {"liar": 1, "late": 0}


def test_a_pair_that_was_not_planned_is_late() -> None:
    """Every label has the same N."""
    found = late.deadlines(rows_of.normalised(table(row("a", "s", "solved", 1.0), row("b", "t", "solved", 1.0))), 2.0)
    assert found["problems"].tolist() == [2, 2]
    assert found["misses"].tolist() == [1, 1]


def test_shares_have_the_interval_of_wilson() -> None:
    times = [9.0] * 13 + [1.0] * 37
    for level in (0.8, 0.95):
        (found,) = late.deadlines(_rows(_sequence("a", "s", times)), 2.0, level=level).to_dict("records")
        expected = stats.binomtest(13, 50).proportion_ci(level, method="wilson")
        assert (found["low"], found["high"]) == pytest.approx((expected.low, expected.high), abs=1e-12)


def test_runs_end_with_their_sequence() -> None:
    """Misses at the end of one sequence and at the begin of the next are two runs; problems of no sequence have
    none."""
    a, b = [1.0, 9.0, 9.0, INF], [9.0, 9.0, 1.0, 9.0]
    rows = _rows(_sequence("a", "s", a, first=10), _sequence("b", "s", b), [row("z", "s", "solved", 9.0)])
    (found,) = late.deadlines(rows, 2.0).to_dict("records")
    assert (found["misses"], found["longest"], found["longest_in"], found["longest_from"]) == (7, 3, "a", 11.0)


def test_longest_runs_of_random_sequences() -> None:
    rng = np.random.default_rng(7)
    labels, parts, expected = ["s", "t", "u"], [], {}
    for label in labels:
        longest = 0
        for name in "abcdefgh":
            times = rng.choice([1.0, 9.0, INF], size=int(rng.integers(1, 30)), p=[0.4, 0.4, 0.2]).tolist()
            longest = max(longest, *(len(list(g)) for miss, g in itertools.groupby(t > 2 for t in times) if miss), 0)
            # every label has every step: what is not planned is missed
            times += [1.0] * (30 - len(times))
            parts.append(_sequence(name, label, times))
        expected[label] = longest
    found = late.deadlines(_rows(*parts), 2.0).set_index("label")["longest"]
    assert found.to_dict() == expected


def test_without_misses_there_is_no_run() -> None:
    (found,) = late.deadlines(_rows(_sequence("a", "s", [1.0, 1.0])), 2.0).to_dict("records")
    assert (found["longest"], found["longest_in"]) == (0, "")
    assert math.isnan(found["longest_from"])
    assert (found["low"], found["share"]) == (0.0, 0.0)


def _path(key: str, *steps: tuple[float, float]) -> pd.DataFrame:
    time, error = (np.array(column) for column in zip(*steps, strict=True))
    return pd.DataFrame(
        {"key": key, "time": time, "iteration": 0, "residual": 0.0, "error": error, "share": time / 4.0}
    )


def test_the_error_at_the_deadline_is_the_best_so_far() -> None:
    """An iterate that is worse than an earlier one takes nothing back; a label without iterates has its answers."""
    rows = rows_of.normalised(
        table(
            row("a", "anytime", "solved", 4.0),
            row("b", "anytime", "timeout", 4.0),
            row("a", "late", "solved", 3.0),
            row("b", "late", "solved", 1.0),
        )
    )
    history = pd.concat(
        [_path("a/anytime", (1.0, 1e-3), (1.5, 1e-1), (4.0, 1e-9)), _path("b/anytime", (0.5, 1e-2), (3.0, 1e-4))]
    )
    found = late.deadlines(rows, 2.0, history).set_index("label")
    assert found.loc["anytime", ["error_p50", "error_max"]].tolist() == [1e-3, 1e-2]
    assert found.loc["late", ["error_p50", "error_max"]].tolist() == [1e-9, INF]
    assert paths.error_at(rows, history, 3.5).to_dict("index")["f-b"] == {"anytime": 1e-4, "late": 1e-9}
    assert paths.error_at(rows, None, 10.0).to_dict("index")["f-b"] == {"anytime": INF, "late": 1e-9}


def test_error_at_a_time_against_a_loop() -> None:
    rng = np.random.default_rng(5)
    rows = rows_of.normalised(
        table(*(row(f"p-{k}", s, "solved", float(rng.uniform(1, 8))) for k in range(20) for s in "xyz"))
    )
    history = pd.concat(
        [
            _path(key, *zip(np.sort(rng.uniform(0, 4, 9)), rng.lognormal(-5, 3, 9), strict=True))
            for key in rows["key"]
            if rng.uniform() < 0.7
        ],
        ignore_index=True,
    )
    for seconds in (0.0, 0.7, 2.0, 5.0, 9.0):
        found: dict[Any, Any] = paths.error_at(rows, history, seconds).to_dict()
        for r in rows.to_dict("records"):
            own = history[history["key"] == r["key"]]
            expected = r["error"] if r["solve"] <= seconds else INF
            if len(own):
                early = own["share"] * r["solve"] <= seconds
                expected = min(own.loc[early, "error"], default=INF)
            assert found[r["label"]][r["fingerprint"]] == expected
    times: dict[Any, Any] = paths.times_to(rows, history, 1e-3).to_dict()
    for seconds in (0.7, 2.0, 5.0):
        reached: dict[Any, Any] = (paths.error_at(rows, history, seconds) <= 1e-3).to_dict()
        for r in rows[rows["key"].isin(history["key"])].to_dict("records"):
            p, s = r["fingerprint"], r["label"]
            assert reached[s][p] == (times[s][p] <= seconds)


def test_what_is_refused() -> None:
    rows = rows_of.normalised(table(row("a", "s", "solved", 1.0)))
    with pytest.raises(ValueError, match="must be positive"):
        late.deadlines(rows, 0.0)
    with pytest.raises(ValueError, match="not in"):
        late.quantiles(pd.DataFrame({"s": [1.0]}), (0.0,))
