"""The bootstrap of families: against SciPy's, against planted truth, and where there is little to resample."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from synthetic_results import row, table

from cpbench.analysis import bootstrap, means
from cpbench.analysis import table as rows_of

INF = math.inf


def some(problems: int = 60, seed: int = 0) -> pd.DataFrame:
    """Two labels with correlated times; the second fails now and then."""
    rng = np.random.default_rng(seed)
    hard = rng.normal(0, 1, problems)
    first, second = np.exp(hard + rng.normal(0, 0.5, problems)), np.exp(hard + 0.3 + rng.normal(0, 0.5, problems))
    second[rng.random(problems) < 0.15] = INF
    return pd.DataFrame({"a": first, "b": second}, index=[f"p{i}" for i in range(problems)])


def test_single_problems_are_scipys_bootstrap() -> None:
    """Same distribution of resamples, other random numbers: ends of 9999 replicates agree to their sampling error.

    The 2.5 % quantile of B replicates has a standard error √(0.025·0.975/B)/f(q): with B = 9999 and a nearly normal
    statistic of standard deviation σ, f(q) = 0.058/σ, so 0.027 σ each; 5 standard errors of the difference are 0.19 σ.
    """
    times = some()
    seconds = np.where(np.isfinite(times), times, 50.0)
    shift = means.default_shift(times)

    def mean(sample: np.ndarray, axis: int = -1) -> np.ndarray:
        return np.exp(np.mean(np.log(sample + shift), axis=axis)) - shift

    made = bootstrap.mean_time(times, shift, 50.0, replicates=9999, expanded=False)
    for k, label in enumerate(times.columns):
        theirs = stats.bootstrap(
            (seconds[:, k],), mean, n_resamples=9999, method="percentile", rng=np.random.default_rng(1), vectorized=True
        )
        ours = made.loc[label]
        assert ours["estimate"] == pytest.approx(mean(seconds[:, k]), rel=1e-12)
        room = 0.19 * theirs.standard_error
        assert ours["low"] == pytest.approx(theirs.confidence_interval.low, abs=room)
        assert ours["high"] == pytest.approx(theirs.confidence_interval.high, abs=room)


def test_all_replicates_are_what_resampling_by_hand_gives() -> None:
    """The product with multiplicities against building each resampled table, from the same draws."""
    times = some(24)
    families = pd.Series([f"f{i % 7}" if i < 20 else "" for i in range(24)], index=times.index)
    codes, count = bootstrap.clusters(times.index, families)
    assert count == 7 + 4
    (_, weights), *rest = bootstrap.multiplicities(count, 50, seed=5)
    assert not rest
    assert (weights.sum(axis=1) == count).all()
    averages = []
    for weight in weights:
        at = np.repeat(np.arange(24), weight[codes].astype(int))
        averages.append(np.exp(np.log(times.iloc[at].replace(INF, 50.0)).mean()))
    made = bootstrap.mean_time(times, 0.0, 50.0, None, families, replicates=50, seed=5, level=0.8, expanded=False)
    expected = np.quantile(np.array(averages), [0.1, 0.9], axis=0)
    np.testing.assert_allclose(made[["low", "high"]].to_numpy().T, expected, rtol=1e-12)


def test_memory_blocks_change_no_number(monkeypatch: pytest.MonkeyPatch) -> None:
    one = bootstrap.mean_time(some(30), 1.0, 50.0, replicates=200)
    monkeypatch.setattr(bootstrap, "CELLS", 301)
    pd.testing.assert_frame_equal(bootstrap.mean_time(some(30), 1.0, 50.0, replicates=200), one)


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
        times = pd.DataFrame({"s": np.exp(logs)}, index=names.index)
        for how, given in (("families", names), ("problems", None)):
            found = bootstrap.mean_time(times, 0.0, 1.0, None, given, replicates=400, seed=trial).loc["s"]
            held[how] += bool(found["low"] <= 1.0 <= found["high"])
    assert held["families"] >= 0.88 * 150
    assert held["problems"] <= 0.65 * 150


def test_one_family_or_nothing_has_no_interval() -> None:
    times = some(20)
    found = bootstrap.mean_time(times, 1.0, 50.0, families=pd.Series("scene", index=times.index))
    assert found[["low", "high"]].isna().all(axis=None), "one family says nothing of others"
    assert found["estimate"].notna().all()
    assert bootstrap.mean_time(times.iloc[:0], 1.0, 50.0).isna().all(axis=None)


def test_seeds_and_families() -> None:
    one, same, other = (bootstrap.mean_time(some(), 1.0, 50.0, seed=seed) for seed in (0, 0, 1))
    pd.testing.assert_frame_equal(one, same)
    assert not one.equals(other)
    rows = rows_of.normalised(table(row("p", "s", "solved", 1.0, family="x"), row("q", "s", "solved", 1.0, family="")))
    assert bootstrap.families_of(rows).to_dict() == {"f-p": "x", "f-q": ""}
