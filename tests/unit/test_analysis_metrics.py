"""What solvers spent, by every measure: verified rows only, and what nobody counted is told."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from synthetic_results import row, suite, table

from cpbench.analysis import table as rows_of
from cpbench.analysis.metrics import METRICS, MetricValues, counters, matrix, measured, metric
from cpbench.errors import StoreError, UnknownName

INF = math.inf


def of(name: str, *rows: dict[str, object]) -> MetricValues:
    group = rows_of.normalised(pd.DataFrame(list(rows)))
    return measured(group, metric(name))


def test_time_is_what_with_time_says() -> None:
    group = rows_of.normalised(suite(20, 12))
    pd.testing.assert_frame_equal(matrix(group, METRICS["time"]), rows_of.times(group))
    timed, wide = rows_of.with_time(group), rows_of.times(group)
    for fingerprint, label, time in zip(timed["fingerprint"], timed["label"], timed["time"], strict=True):
        assert wide.at[fingerprint, label] == time


def test_columns() -> None:
    spent = {"convert": 0.5, "setup": 0.25, "lift": 0.125, "cpu": 3.0, "peak": 4e6, "reported": 0.75}
    rows = row("p", "s", "solved", 1.0, **spent), row("p", "t", "wrong", 1e-9, **spent)
    expected = {"time": 1.875, "solve": 1.0, "cpu": 3.0, "memory": 4e6, "reported": 0.75}
    for name, value in expected.items():
        assert of(name, *rows).values.to_dict("list") == {"s": [value], "t": [INF]}, name


def test_counters_by_name() -> None:
    rows = (
        row("p", "s", "solved", 1.0, counters='{"iterations": 7, "factorizations": 0}'),
        row("q", "s", "max_iter", 1.0, counters='{"iterations": 9, "factorizations": 2}'),
        row("p", "t", "solved", 1.0, counters='{"factorizations": 5}'),
    )
    found = of("counter:factorizations", *rows)
    assert found.values.to_dict("index") == {"f-p": {"s": 0.0, "t": 5.0}, "f-q": {"s": INF, "t": INF}}
    assert (found.left_out, found.metric.floor) == ({}, 1.0)
    iterations = of("iterations", *rows)
    assert iterations.values.to_dict("list") == {"s": [7.0, INF]}
    assert iterations.left_out == {"t": 1}
    assert counters(table(*rows)) == {"iterations", "factorizations"}


def test_unknown_is_no_failure_and_no_number() -> None:
    """One verified answer without the count is enough: neither ∞ nor a guess may stand for it."""
    rows = (
        row("p", "partly", "solved", 1.0, counters='{"iterations": 7}'),
        row("q", "partly", "solved", 1.0, counters="{}"),
        row("p", "text", "solved", 1.0, counters='{"iterations": "many"}'),
        row("q", "text", "solved", 1.0, counters=None),
        row("p", "never", "timeout"),
        row("q", "never", "wrong", 1.0),
    )
    found = of("iterations", *rows)
    assert found.left_out == {"partly": 1, "text": 2}
    assert found.values.to_dict("list") == {"never": [INF, INF]}, "who solves nothing fails by every measure"
    assert len(found.values) == 2, "problems stay"
    assert of("time", row("p", "imported", "solved")).left_out == {"imported": 1}


def test_names() -> None:
    group = table(row("p", "s", "solved", 1.0, counters='{"factorizations": 1}'))
    assert metric("counter:factorizations", group).doc == "factorizations as the solver counts them"
    for name, near in (
        ("iteration", "did you mean iterations"),
        ("counter:factorisations", "did you mean counter:factorizations"),
        ("factorizations", "did you mean counter:factorizations"),
        ("xyz", "known: counter:factorizations, cpu, iterations, memory"),
    ):
        with pytest.raises(UnknownName, match=near):
            metric(name, group)
    with pytest.raises(UnknownName, match="counter:NAME"):
        metric("xyz")
    assert all(name == m.name and m.doc and (m.floor or 0) > 0 for name, m in METRICS.items())


def test_what_is_no_table_of_counters() -> None:
    with pytest.raises(StoreError, match=r"column counters: .*one JSON object a row"):
        of("iterations", row("p", "s", "solved", 1.0, counters='{"iterations": '))


def test_order_is_by_name_of_problem_whatever_the_order_of_rows() -> None:
    """Names shared by two problems carry their address; rows that call one problem differently count once."""
    rows = [
        row("z", "s", "solved", 1.0, fingerprint="1", address="b.h5"),
        row("z", "s", "solved", 2.0, fingerprint="2", address="a.h5", key="k2"),
        row("a", "s", "solved", 3.0, fingerprint="3"),
        row("m", "t", "solved", 4.0, fingerprint="3", key="k4"),
    ]
    for order in ([0, 1, 2, 3], [3, 2, 1, 0], [2, 0, 3, 1]):
        group = rows_of.normalised(table(*(rows[k] for k in order)))
        assert rows_of.times(group).to_dict("index") == {
            "3": {"s": 3.0, "t": 4.0},
            "2": {"s": 2.0, "t": INF},
            "1": {"s": 1.0, "t": INF},
        }


def test_rows_come_in_one_order() -> None:
    """By problem, fingerprint, label, key, as sorting all rows by these columns has it; found without sorting."""
    rng = np.random.default_rng(2)
    names = [(f"p{k}", f"f{rng.integers(3)}", f"s{rng.integers(4)}", f"k{key}") for key, k in enumerate([0, 1, 2] * 20)]
    raw = pd.DataFrame(names, columns=["problem", "fingerprint", "label", "key"])
    expected = raw.sort_values(["problem", "fingerprint", "label", "key"], ignore_index=True)
    for given in (raw, expected, expected[::-1], expected.drop(index=3), raw.sort_values("problem"), raw.iloc[:0]):
        found = rows_of.normalised(given)
        assert list(found.index) == list(range(len(given)))
        own = expected[expected["key"].isin(given["key"])].to_numpy().tolist()
        assert found[["problem", "fingerprint", "label", "key"]].to_numpy().tolist() == own
        pd.testing.assert_frame_equal(rows_of.normalised(found), found)


def test_the_normalised_table_is_a_copy() -> None:
    raw = table(row("p", "s", "solved", 1.0)).assign(own=1.0)
    before = raw.copy()
    clean = rows_of.normalised(raw)
    clean.loc[0, ["own", "solve", "tolerance"]] = 7.0
    clean.loc[0, ["label", "status"]] = "changed"
    pd.testing.assert_frame_equal(raw, before)
