"""The bootstrap of families: against SciPy's, against planted truth, and where there is little to resample."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from synthetic_results import row, suite, table

from cpbench.analysis import bands, bootstrap, means, profiles
from cpbench.analysis import table as rows_of

INF = math.inf


def some(problems: int = 60, seed: int = 0) -> pd.DataFrame:
    """Two labels with correlated times; the second fails now and then."""
    rng = np.random.default_rng(seed)
    hard = rng.normal(0, 1, problems)
    first, second = np.exp(hard + rng.normal(0, 0.5, problems)), np.exp(hard + 0.3 + rng.normal(0, 0.5, problems))
    second[rng.random(problems) < 0.15] = INF
    return pd.DataFrame({"a": first, "b": second}, index=[f"p{i}" for i in range(problems)])


@pytest.mark.parametrize("method", ["percentile", "bca"])
def test_single_problems_are_scipys_bootstrap(method: str) -> None:
    """Same distribution of resamples, other random numbers: ends of 9999 replicates agree to their sampling error.

    The 2.5 % quantile of B replicates has a standard error √(0.025·0.975/B)/f(q): with B = 9999 and a nearly normal
    statistic of standard deviation σ, f(q) = 0.058/σ, so 0.027 σ each; 5 standard errors of the difference are 0.19 σ.
    """
    times = some()
    seconds = np.where(np.isfinite(times), times, 50.0)
    shift = means.default_shift(times)

    def mean(sample: np.ndarray, axis: int = -1) -> np.ndarray:
        return np.exp(np.mean(np.log(sample + shift), axis=axis)) - shift

    made = bootstrap.intervals(
        bootstrap.mean_time(times, shift, 50.0),
        replicates=9999,
        method=method,  # type: ignore[arg-type]
    )
    for k, label in enumerate(times.columns):
        theirs = stats.bootstrap(
            (seconds[:, k],), mean, n_resamples=9999, method=method, rng=np.random.default_rng(1), vectorized=True
        )
        ours = made.table.loc[label]
        assert ours["estimate"] == pytest.approx(mean(seconds[:, k]), rel=1e-12)
        room = 0.19 * theirs.standard_error
        assert ours["low"] == pytest.approx(theirs.confidence_interval.low, abs=room)
        assert ours["high"] == pytest.approx(theirs.confidence_interval.high, abs=room)
    assert (made.families, made.undefined) == (60, 0)


def test_all_replicates_are_what_resampling_by_hand_gives() -> None:
    """The product with multiplicities against building each resampled table, from the same draws."""
    times = some(24)
    families = pd.Series([f"f{i % 7}" if i < 20 else "" for i in range(24)], index=times.index)
    codes, count = bootstrap.clusters(times.index, families)
    assert count == 7 + 4
    (_, weights), *rest = bootstrap.multiplicities(count, 50, seed=5)
    assert not rest
    assert (weights.sum(axis=1) == count).all()
    started = pd.DataFrame(np.random.default_rng(3).random(times.shape) < 0.7, times.index, times.columns)
    rates, curves = [], []
    for weight in weights:
        drawn = times.iloc[np.repeat(np.arange(24), weight[codes].astype(int))]
        rates.append((np.isfinite(drawn) & started.loc[drawn.index]).sum() / started.loc[drawn.index].sum())
        alone = profiles.performance_profile(drawn.reset_index(drop=True))
        curves.append([[curve.at(tau) for curve in alone.curves] for tau in (1.0, 1.5, 3.0)])
    made = bootstrap.intervals(
        bootstrap.solve_rate(times.where(started), started),
        families,
        replicates=50,
        seed=5,
        level=0.8,
        method="percentile",
    )
    expected = np.quantile(np.array(rates), [0.1, 0.9], axis=0)
    np.testing.assert_allclose(made.table[["low", "high"]].to_numpy().T, expected, rtol=1e-12)
    band = bands.profile_bands(times, families, [1.0, 1.5, 3.0], replicates=50, seed=5, level=0.8)
    beyond = bootstrap.tail(0.8, count)
    low, high = np.quantile(np.array(curves), [beyond, 1 - beyond], axis=0)
    np.testing.assert_allclose(band.low, low, atol=1e-12)
    np.testing.assert_allclose(band.high, high, atol=1e-12)


def test_memory_blocks_change_no_number(monkeypatch: pytest.MonkeyPatch) -> None:
    times = some(30)
    one = bootstrap.intervals(bootstrap.solve_rate(times), replicates=200)
    band = bands.profile_bands(times, replicates=200)
    monkeypatch.setattr(bootstrap, "CELLS", 301)
    pd.testing.assert_frame_equal(bootstrap.intervals(bootstrap.solve_rate(times), replicates=200).table, one.table)
    pd.testing.assert_frame_equal(bands.profile_bands(times, replicates=200).low, band.low)


def test_resampling_problems_of_families_is_too_narrow() -> None:
    """Planted truth: 16 families of 10 problems that resemble each other, the true mean is 1, 150 trials.

    Nominal 95 %: families hold it in nearly that share (0.95 ± 4·√(0.95·0.05/150) reaches down to 0.88), problems
    one by one in about half.
    """
    rng = np.random.default_rng(0)
    family = np.repeat(np.arange(16), 10)
    names = pd.Series([f"f{k}" for k in family], index=[f"p{i}" for i in range(160)])
    held = {"families": 0, "problems": 0}
    for trial in range(150):
        logs = rng.normal(0, 1, 16)[family] + rng.normal(0, 0.5, 160)
        statistic = bootstrap.mean_time(pd.DataFrame({"s": np.exp(logs)}, index=names.index), 0.0, 1.0)
        for how, given in (("families", names), ("problems", None)):
            found = bootstrap.intervals(statistic, given, replicates=400, seed=trial).table.loc["s"]
            held[how] += bool(found["low"] <= 1.0 <= found["high"])
    assert held["families"] >= 0.88 * 150
    assert held["problems"] <= 0.65 * 150


def test_few_families_are_reported() -> None:
    times = some(20)
    by_four = pd.Series([f"f{i % 4}" for i in range(20)], index=times.index)
    found = bootstrap.intervals(bootstrap.solve_rate(times), by_four)
    assert found.families == 4
    assert found.table["few"].all()
    assert bands.profile_bands(times, by_four).few
    one = pd.Series("scene", index=times.index)
    found = bootstrap.intervals(bootstrap.solve_rate(times), one)
    assert found.table[["low", "high"]].isna().all(axis=None), "one family says nothing of others"
    assert found.table["estimate"].notna().all()
    alone = bands.profile_bands(times, one)
    assert alone.low.isna().all(axis=None)
    assert alone.estimate.notna().all(axis=None)
    nothing = bootstrap.intervals(bootstrap.solve_rate(times.iloc[:0]))
    assert nothing.table[["estimate", "low", "high"]].isna().all(axis=None)
    assert bands.profile_bands(times.iloc[:0]).estimate.isna().all(axis=None)


def test_a_rate_counts_the_problems_that_a_label_was_started_on() -> None:
    times = pd.DataFrame({"a": [1.0, 1.0, INF, INF], "b": [2.0, INF, INF, 1.0], "c": [INF] * 4}, index=list("pqrs"))
    started = pd.DataFrame({"a": [True, True, True, False], "b": [True, False, False, False], "c": [False] * 4})
    started.index = times.index
    found = bootstrap.intervals(bootstrap.solve_rate(times.where(started), started))
    assert found.table["estimate"].tolist() == pytest.approx([2 / 3, 1.0, math.nan], nan_ok=True)
    assert found.table["problems"].tolist() == [3, 1, 0]
    assert found.undefined > 0, "some draws have no problem that b was started on"


def test_bands_hold_the_profile_and_end_at_the_solve_rate() -> None:
    rows = rows_of.normalised(suite(45, 12))
    times, families = rows_of.times(rows), bootstrap.families_of(rows)
    band = bands.profile_bands(times, families)
    assert len(band.estimate) <= bands.GRID
    assert band.families == 5
    profile = profiles.performance_profile(times)
    for curve in profile.curves:
        np.testing.assert_allclose(band.estimate[curve.label], [curve.at(tau) for tau in band.estimate.index])
    for part in (band.low, band.estimate, band.high):
        assert (part.diff().iloc[1:] >= -1e-12).all(axis=None), "monotone"
        assert ((part >= 0) & (part <= 1)).all(axis=None)
    assert ((band.low <= band.estimate) & (band.estimate <= band.high)).all(axis=None)
    rate = bootstrap.intervals(bootstrap.solve_rate(times), families).table
    last = pd.DataFrame({"estimate": band.estimate.iloc[-1], "low": band.low.iloc[-1], "high": band.high.iloc[-1]})
    pd.testing.assert_frame_equal(last.loc[rate.index], rate[["estimate", "low", "high"]], check_names=False)


def test_seeds_and_bad_arguments() -> None:
    statistic = bootstrap.mean_time(some(), 1.0, 50.0)
    one, same, other = (bootstrap.intervals(statistic, seed=seed).table for seed in (0, 0, 1))
    pd.testing.assert_frame_equal(one, same)
    assert not one.equals(other)
    with pytest.raises(ValueError, match="level of 95"):
        bootstrap.intervals(statistic, level=95)
    with pytest.raises(ValueError, match="0 replicates"):
        bands.profile_bands(some(), replicates=0)
    rows = rows_of.normalised(table(row("p", "s", "solved", 1.0, family="x"), row("q", "s", "solved", 1.0, family="")))
    assert bootstrap.families_of(rows).to_dict() == {"f-p": "x", "f-q": ""}
