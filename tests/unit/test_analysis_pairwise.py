"""Solvers two by two: counts against a double loop, orders against profiles made anew."""

from __future__ import annotations

import math
from itertools import combinations, permutations

import numpy as np
import pandas as pd
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cpbench.analysis.pairwise import profile_of_two, record, reversals
from cpbench.analysis.profiles import FLOOR, performance_profile

INF = math.inf
COSTS = arrays(
    float,
    st.tuples(st.integers(1, 6), st.integers(1, 5)),
    elements=st.one_of(st.sampled_from([0.0, 1e-5, 1.0, 2.0, 3.0]), st.floats(0.0, 1e3), st.just(INF)),
)


def frame(values: np.ndarray) -> pd.DataFrame:
    return pd.DataFrame(values, columns=list("dbeac"[: values.shape[1]]))


@settings(deadline=None, max_examples=60)
@given(values=COSTS)
def test_records_by_a_loop_and_by_the_profile_of_two(values: np.ndarray) -> None:
    table = frame(values)
    for one, other in combinations(table.columns, 2):
        wins, losses, ties = record(table, one, other)
        floored = [(max(a, FLOOR), max(b, FLOOR)) for a, b in zip(table[one], table[other], strict=True)]
        assert wins == sum(a < b for a, b in floored)
        assert losses == sum(a > b for a, b in floored)
        first, second = sorted(profile_of_two(table, one, other).curves, key=lambda curve: curve.label != one)
        assert first.at(1.0) == (wins + ties) / len(table)
        assert second.at(1.0) == (losses + ties) / len(table)


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


def test_nothing() -> None:
    assert reversals(pd.DataFrame({"a": []}, dtype=float), ["a"]) == []
