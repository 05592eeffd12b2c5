"""Solvers two by two: counts against a double loop, orders against profiles made anew."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cpbench.analysis.pairwise import ALL, flips, leave_one_out, profile_of_two, records, reversals
from cpbench.analysis.profiles import FLOOR, performance_profile

INF = math.inf
COSTS = arrays(
    float,
    st.tuples(st.integers(1, 6), st.integers(1, 5)),
    elements=st.one_of(st.sampled_from([0.0, 1e-5, 1.0, 2.0, 3.0]), st.floats(0.0, 1e3), st.just(INF)),
)


def each(found: pd.DataFrame) -> Iterator[Any]:
    yield from found.itertuples()


def frame(values: np.ndarray) -> pd.DataFrame:
    return pd.DataFrame(values, columns=list("dbeac"[: values.shape[1]]))


@settings(deadline=None, max_examples=60)
@given(values=COSTS, spare=st.integers(0, 3))
def test_records_by_a_double_loop(values: np.ndarray, spare: int) -> None:
    table = frame(values)
    found = records(table, problems=len(table) + spare)
    assert len(found) == table.shape[1] * (table.shape[1] - 1) // 2
    for r in each(found):
        count = {"wins": 0, "ties": 0, "losses": 0, "neither": spare}
        for one, other in zip(table[r.one], table[r.other], strict=True):
            a, b = max(one, FLOOR), max(other, FLOOR)
            count["neither" if a == b == INF else "ties" if a == b else "wins" if a < b else "losses"] += 1
        assert r.one < r.other
        assert (r.wins, r.ties, r.losses, r.neither) == tuple(count.values())


@settings(deadline=None, max_examples=60)
@given(values=COSTS, tau=st.sampled_from([1.0, 2.0, 10.0, INF]))
def test_leave_one_out_is_the_profile_of_the_others(values: np.ndarray, tau: float) -> None:
    table = frame(values)
    order = leave_one_out(table, tau)
    assert list(order.columns) == [ALL, *order.index]
    assert sorted(order.index) == sorted(table.columns)
    assert order[ALL].is_monotonic_decreasing
    for left in order.columns:
        rest = table.drop(columns=left) if left else table
        expected = {c.label: c.at(tau) for c in performance_profile(rest).curves}
        assert order[left].dropna().to_dict() == expected
    neighbours = {(f.above, f.below) for f in flips(order)}
    if tau == INF or table.shape[1] < 3:
        assert not neighbours, "solve rates do not depend on who is shown"


@settings(deadline=None, max_examples=40)
@given(values=COSTS)
def test_two_alone_at_one_are_wins_and_ties(values: np.ndarray) -> None:
    table = frame(values)
    for r in each(records(table)):
        first, second = profile_of_two(table, r.one, r.other).curves
        assert first.at(1.0) == (r.wins + r.ties) / len(table)
        assert second.at(1.0) == (r.losses + r.ties) / len(table)


def test_three_solvers_are_one_flip() -> None:
    """With three labels, leaving one out is comparing the other two alone."""
    rng = np.random.default_rng(4)
    seen = 0
    for _ in range(60):
        table = frame(rng.choice([1.0, 2.5, 3.0, 9.0, INF], (9, 3)))
        adjacent = {(f.above, f.below) for f in flips(leave_one_out(table))}
        assert adjacent <= set(reversals(table, list(table.columns)))
        seen += len(adjacent)
    assert seen, "some of these tables have one"


def test_planned_problems_count() -> None:
    table = pd.DataFrame({"a": [1.0], "b": [2.0]})
    assert leave_one_out(table, 1.0, problems=4).loc["a", ALL] == 0.25
    assert records(table, problems=4).loc[0, "neither"] == 3
    for refuses in (lambda: leave_one_out(table, problems=0), lambda: records(table, problems=0)):
        with pytest.raises(ValueError, match="planned"):
            refuses()


def test_nothing() -> None:
    assert records(pd.DataFrame()).empty
    assert flips(leave_one_out(pd.DataFrame({"a": []}, dtype=float))) == []
