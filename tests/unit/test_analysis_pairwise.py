"""Solvers two by two: counts against a double loop, orders against profiles made anew."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import permutations
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cpbench.analysis.pairwise import profile_of_two, records, reversals
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


@settings(deadline=None, max_examples=40)
@given(values=COSTS)
def test_two_alone_at_one_are_wins_and_ties(values: np.ndarray) -> None:
    table = frame(values)
    for r in each(records(table)):
        first, second = profile_of_two(table, r.one, r.other).curves
        assert first.at(1.0) == (r.wins + r.ties) / len(table)
        assert second.at(1.0) == (r.losses + r.ties) / len(table)


def test_the_order_of_two_turns_where_a_third_is_shown() -> None:
    """Both orders are those of profiles made anew: of all labels, and of the two alone."""
    rng = np.random.default_rng(4)
    seen = 0
    for _ in range(60):
        table = frame(rng.choice([1.0, 2.5, 3.0, 9.0, INF], (9, 3)))
        together = {c.label: c.at(2.0) for c in performance_profile(table).curves}
        expected: set[tuple[str, str]] = set()
        for one, other in permutations(table.columns, 2):
            alone = {c.label: c.at(2.0) for c in performance_profile(table[[one, other]]).curves}
            if together[one] > together[other] and alone[one] < alone[other]:
                expected.add((one, other))
        assert set(reversals(table, list(table.columns))) == expected
        seen += len(expected)
    assert seen, "some of these tables have one"


def test_planned_problems_count() -> None:
    table = pd.DataFrame({"a": [1.0], "b": [2.0]})
    assert records(table, problems=4).loc[0, "neither"] == 3
    with pytest.raises(ValueError, match="planned"):
        records(table, problems=0)


def test_nothing() -> None:
    assert records(pd.DataFrame()).empty
    assert reversals(pd.DataFrame({"a": []}, dtype=float), ["a"]) == []
