"""Performance profiles: values by hand, published examples, properties on random tables; what other packages get wrong.

The wrong figures are recomputed from their formulas where that is one line.
"""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cpbench.analysis.profiles import FLOOR, Curve, Profile, performance_profile, ratios

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


def test_floor_makes_short_times_equal() -> None:
    table = frame([[1e-6, 9e-5], [1e-6, 1e-3]])
    assert ratios(table, floor=1e-4).to_numpy().tolist() == [[1.0, 1.0], [1.0, 10.0]]
    assert ratios(table, floor=1e-9).loc["p0", "b"] == pytest.approx(90)


def test_without_a_floor_costs_must_not_be_zero() -> None:
    assert ratios(frame([[1e-9, 4e-9]]), floor=None).to_numpy().tolist() == [[1.0, 4.0]]
    assert performance_profile(frame([[1.0]]), floor=None).floor == 0.0
    with pytest.raises(ValueError, match="needs a floor"):
        ratios(frame([[0.0, 1.0]]), floor=None)


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


def steps_of(curve: Curve) -> list[float]:
    """Where a curve steps, as often as it has problems there."""
    return np.repeat(curve.ratios, np.diff([0, *curve.count])).tolist()


class TestPublished:
    """SolverBenchmark.jl prints the data of its examples with three digits and draws their profiles with Matplotlib,
    so that the corners of the curves stand in the SVG files: at x = zero + unit·log2(ratio) points.

    Three digits of two times leave log2 of their ratio uncertain by 2·log2(1 + 0.005).
    """

    def compare(
        self, times: dict[str, list[float]], drawn: dict[str, list[float]], zero: float, unit: float
    ) -> dict[str, float]:
        profile = performance_profile(pd.DataFrame(times))
        for curve in profile.curves:
            corners = (np.array(drawn[curve.label]) - zero) / unit
            assert np.log2(steps_of(curve)) == pytest.approx(corners, abs=2 * math.log2(1.005))
        return {curve.label: curve.at(INF) for curve in profile.curves}

    def test_all_solved(self) -> None:
        """assets/joined.tex (762112f) and assets/profile1.svg (2cbab75); this example does not look at the status."""
        x = 37.424646
        assert self.compare(
            {
                "alpha": [62.4, 353, 768, 43.1, 268, 66.8, 157, 605, 136, 838],
                "beta": [392, 479, 68.2, 480, 468, 452, 644, 669, 94.8, 949],
                "gamma": [697, 435, 986, 997, 508, 216, 859, 905, 435, 65.9],
            },
            {
                "alpha": [*[x] * 7, 78.146042, 311.911386, 325.813201],
                "beta": [x, x, 48.81892, 72.08162, 100.74676, 197.78595, 245.89838, 254.28163, 310.63136, 339.88955],
                "gamma": [x, 61.0942, 83.0578, 109.8605, 170.3281, 210.2475, 230.3894, 311.1638, 340.3601, 393.5526],
            },
            zero=x,
            unit=78.604448,
        ) == {"alpha": 1.0, "beta": 1.0, "gamma": 1.0}

    def test_with_failures(self) -> None:
        """test/output_results.jl (502630d) and the tutorial's profile2.svg (f911235), where failures cost Inf."""
        x = 38.864646
        assert self.compare(
            {
                "alpha": [INF, INF, 768, 43.1, 268, 66.8, 157, 605, 136, INF],
                "beta": [177, INF, 682, INF, INF, 652, 597, 479, INF, 471],
                "gamma": [32.6, 686, 841, INF, INF, 897, 95.4, INF, INF, 838],
            },
            {
                "alpha": [x, x, x, x, 54.979648, 70.761036, 106.662748],
                "beta": [x, x, x, 270.34034, 289.346828, 349.981227],
                "gamma": [x, x, x, 67.492097, 117.645853, 393.683472],
            },
            zero=x,
            unit=94.695625,
        ) == {"alpha": 0.7, "beta": 0.6, "gamma": 0.6}


def test_failures_are_not_the_best_when_every_ratio_is_one() -> None:
    """BenchmarkProfiles.jl charges a failure twice the largest log ratio: when all of them are 0, that is the best."""
    table = frame([[5, 5], [7, INF], [3, 3]])
    logs = np.log2(ratios(table).to_numpy())
    theirs = np.where(np.isinf(logs), 2 * logs[np.isfinite(logs)].max(), logs)
    assert theirs.max() <= 0, "both at 100 % from the start"
    profile = performance_profile(table)
    assert heights(profile, "a", 1, INF) == [1.0, 1.0]
    assert heights(profile, "b", 1, 1e300, INF) == [2 / 3] * 3


def test_one_zero_touches_no_other_problem() -> None:
    """BenchmarkProfiles.jl adds 1 to every measure when one of them is 0: a ratio of 100 becomes 1.099."""
    table = frame([[0.001, 0.1], [0.0, 0.5]])
    theirs = (table + 1).loc["p0"]
    assert float(theirs["b"]) / float(theirs["a"]) == pytest.approx(1.099, abs=1e-3)
    assert ratios(table, floor=1e-6).loc["p0", "b"] == pytest.approx(100.0)
    assert table.loc["p1", "a"] == 0.0, "the input is not changed"
