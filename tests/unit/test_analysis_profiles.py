"""Performance profiles: values by hand, known errors of other packages, and properties on random tables."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cpbench.analysis.profiles import FLOOR, Profile, performance_profile, ratios

INF = math.inf


def frame(values: list[list[float]], labels: str = "abcdefgh") -> pd.DataFrame:
    wide = np.array(values, dtype=float)
    return pd.DataFrame(wide, index=[f"p{i}" for i in range(len(wide))], columns=list(labels[: wide.shape[1]]))


def heights(profile: Profile, label: str, *taus: float) -> list[float]:
    curve = next(c for c in profile.curves if c.label == label)
    return [curve.at(tau) for tau in taus]


def test_values_by_hand() -> None:
    """Ratios: a 1 1 2 ∞ ∞, b 4 1 1 1 ∞, c 2 3 ∞ 2 ∞; the last problem is solved by nobody."""
    profile = performance_profile(frame([[1, 4, 2], [2, 2, 6], [6, 3, INF], [INF, 5, 10], [INF, INF, INF]]), floor=1e-3)
    assert profile.problems == 5
    assert heights(profile, "a", 1, 1.999, 2, INF) == [0.4, 0.4, 0.6, 0.6]
    assert heights(profile, "b", 1, 3.999, 4, INF) == [0.6, 0.6, 0.8, 0.8]
    assert heights(profile, "c", 1, 2, 3, INF) == [0.0, 0.4, 0.6, 0.6]
    assert heights(profile, "a", 0.999) == [0.0]
    assert profile.widest == 4.0
    assert [c.label for c in profile.by_height()] == ["b", "a", "c"]


def test_failures_stay_failures_when_every_ratio_is_one() -> None:
    """BenchmarkProfiles.jl charges a failure twice the largest log ratio: when all are 0, that is the best."""
    profile = performance_profile(frame([[5, 5], [7, INF], [3, 3]]))
    assert heights(profile, "a", 1, INF) == [1.0, 1.0]
    assert heights(profile, "b", 1, 1e300, INF) == [2 / 3] * 3


def test_one_zero_touches_no_other_problem() -> None:
    """BenchmarkProfiles.jl adds 1 to every measure when one of them is 0: a ratio of 100 becomes 1.099."""
    table = frame([[0.001, 0.1], [0.0, 0.5]])
    assert ratios(table, floor=1e-6).loc["p0", "b"] == pytest.approx(100.0)
    assert table.loc["p1", "a"] == 0.0, "the input is not changed"


def test_a_failure_lands_on_its_own_problem_whatever_the_order_of_rows() -> None:
    """perprof-py takes the failure mask of one solver's row order and applies it to another's."""
    from synthetic_results import row
    from synthetic_results import table as rows_table

    from cpbench.analysis.table import normalised, times

    first = [row(p, "s1", "solved", t) for p, t in (("a", 1.0), ("b", 2.0), ("c", 3.0))]
    second = [row("c", "s2", "wrong", 1e-3), row("a", "s2", "solved", 2.0), row("b", "s2", "solved", 2.0)]
    wide = times(normalised(rows_table(*second, *first)))
    assert wide["s1"].tolist() == [1.0, 2.0, 3.0]
    assert wide["s2"].tolist() == [2.0, 2.0, INF]
    assert heights(performance_profile(wide), "s2", 1, 2, INF) == [1 / 3, 2 / 3, 2 / 3]


def test_nan_is_a_failure_of_its_own_solver_only() -> None:
    profile = performance_profile(frame([[math.nan, 2.0], [1.0, math.nan]]))
    assert heights(profile, "a", 1, INF) == heights(profile, "b", 1, INF) == [0.5, 0.5]


def test_floor_makes_short_times_equal() -> None:
    table = frame([[1e-6, 9e-5], [1e-6, 1e-3]])
    assert ratios(table, floor=1e-4).to_numpy().tolist() == [[1.0, 1.0], [1.0, 10.0]]
    assert ratios(table, floor=1e-9).loc["p0", "b"] == pytest.approx(90)


@pytest.mark.parametrize("floor", [0.0, -1.0, math.nan])
def test_a_floor_that_is_not_positive_is_refused(floor: float) -> None:
    with pytest.raises(ValueError, match="floor"):
        ratios(frame([[1.0]]), floor)


def test_negative_costs_are_refused() -> None:
    with pytest.raises(ValueError, match="negative cost"):
        ratios(frame([[1.0, -1.0]]))


def test_planned_problems_without_any_row_count() -> None:
    table = frame([[1.0, 2.0]])
    assert heights(performance_profile(table, problems=4), "a", 1, INF) == [0.25, 0.25]
    with pytest.raises(ValueError, match="planned"):
        performance_profile(table, problems=0)


@pytest.mark.parametrize(
    "table",
    [frame([[INF, INF]]), frame([[math.nan]]), pd.DataFrame(columns=["a"], dtype=float), pd.DataFrame()],
    ids=["all fail", "nan", "no problem", "nothing"],
)
def test_nothing_solved(table: pd.DataFrame) -> None:
    profile = performance_profile(table)
    assert profile.widest == 1.0
    assert profile.leading(3) == []
    assert [c.at(INF) for c in profile.curves] == [0.0] * len(profile.curves)
    assert all(c.steps(2.0)[1].tolist() == [0.0, 0.0] for c in profile.curves)


def test_gould_and_scott_the_order_of_two_depends_on_a_third() -> None:
    """Profiles rank against the best only; made-up times where leaving `a` out turns b < c into b > c at τ = 2."""
    table = frame([[1, 2.5, 6]] * 3 + [[1, 9, 2]] * 4 + [[5, 1, 2.5]] * 3)
    with_a, without = performance_profile(table), performance_profile(table[["b", "c"]])
    assert (heights(with_a, "b", 2), heights(with_a, "c", 2)) == ([0.3], [0.4])
    assert (heights(without, "b", 2), heights(without, "c", 2)) == ([0.6], [0.4])


def test_steps_and_area() -> None:
    profile = performance_profile(frame([[1, 2], [1, 8], [1, INF]]))
    b = profile.curves[1]
    x, y = b.steps(16.0)
    assert x.tolist() == [1, 2, 8, 16]
    assert y.tolist() == [0, 1 / 3, 2 / 3, 2 / 3]
    assert b.area(16.0) == pytest.approx((0 * 1 + 2 * 1 / 3 + 1 * 2 / 3) / 4)
    assert b.area(1.0) == 0.0
    x, y = profile.envelope(16.0)
    assert x.tolist() == [1, 16]
    assert y.tolist() == [1, 1]


TIMES = arrays(
    float,
    st.tuples(st.integers(1, 6), st.integers(1, 5)),
    elements=st.one_of(st.floats(0.0, 1e3), st.just(INF), st.just(math.nan)),
)


def as_dict(profile: Profile) -> dict[str, tuple[list[float], tuple[int, ...]]]:
    return {c.label: (c.ratios.tolist(), c.count) for c in profile.curves}


@settings(deadline=None, max_examples=60)
@given(values=TIMES, seed=st.integers(0, 2**16))
def test_properties(values: np.ndarray, seed: int) -> None:
    table = frame(values.tolist())
    before = table.copy()
    profile = performance_profile(table)
    pd.testing.assert_frame_equal(table, before)

    rng = np.random.default_rng(seed)
    mixed = table.iloc[rng.permutation(len(table)), rng.permutation(table.shape[1])]
    assert as_dict(performance_profile(mixed)) == as_dict(profile), "order of rows and columns"

    more = as_dict(performance_profile(table.assign(zzz=INF)))
    assert more.pop("zzz") == ([], ())
    assert more == as_dict(profile), "a solver that solves nothing changes nothing for the others"

    for curve in profile.curves:
        solve_rate = float(np.isfinite(table[curve.label]).mean())
        assert curve.at(INF) == curve.at(profile.widest) == pytest.approx(solve_rate)
        assert list(curve.count) == sorted(set(curve.count)), "every step goes up"
        assert (np.diff(curve.ratios) > 0).all()
        assert (curve.ratios >= 1.0).all()
        brute = ratios(table, FLOOR)[curve.label].to_numpy()
        for tau in (1.0, 1.5, 2.0, 10.0, *curve.ratios):
            assert curve.at(tau) == np.sum(brute <= tau) / len(table)

    solvable = int(np.isfinite(table.to_numpy()).any(axis=1).sum())
    assert sum(c.at(1.0) for c in profile.curves) * len(table) >= solvable - 1e-9, "somebody leads on each"


@settings(deadline=None, max_examples=30)
@given(values=TIMES, scale=st.sampled_from([2.0, 1024.0]))
def test_ratios_have_no_unit(values: np.ndarray, scale: float) -> None:
    """Powers of two scale exactly, so even ties must stay ties."""
    table = frame(values.tolist())
    scaled = performance_profile(table * scale, floor=FLOOR * scale)
    assert as_dict(scaled) == as_dict(performance_profile(table))
