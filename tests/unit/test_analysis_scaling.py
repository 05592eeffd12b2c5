"""Slopes of time over size: SciPy's `linregress` without timeouts; with them a published fit (Schmee and Hahn's
insulation lives), a maximisation by Nelder and Mead of likelihoods from `scipy.stats`, and planted slopes."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy import optimize, stats
from synthetic_results import row, table

from cpbench.analysis import table as rows_of
from cpbench.analysis.censored import fit
from cpbench.analysis.scaling import scaling
from cpbench.analysis.sizes import sizes_of


def _none(z: Any) -> Any:
    return np.zeros(len(z), dtype=bool)


def _planted(rng: np.random.Generator, count: int, slope: float, share: float, sigma: float = 0.5) -> tuple[Any, ...]:
    """log sizes, log times that are stopped at a common limit, and which were; `share` of them on average."""
    z = rng.uniform(np.log(10), np.log(1000), count)
    y = -8.0 + slope * z + sigma * rng.standard_normal(count)
    # the limit: the quantile of the marginal distribution of y, from a large sample of it
    many = rng.uniform(np.log(10), np.log(1000), 20_000)
    limit = np.quantile(-8.0 + slope * many + sigma * rng.standard_normal(20_000), 1 - share)
    return z, np.minimum(y, limit), y > limit


@pytest.mark.parametrize("count", [5, 12, 400])
def test_without_timeouts_it_is_least_squares(count: int) -> None:
    rng = np.random.default_rng(count)
    z, y = rng.uniform(1, 6, count), rng.normal(size=count)
    ours, theirs = fit(z, y, _none(z)), stats.linregress(z, y)
    reach = stats.t.ppf(0.975, count - 2) * theirs.stderr
    assert (ours.slope, ours.intercept) == pytest.approx((theirs.slope, theirs.intercept), rel=1e-10)
    assert ours.error == pytest.approx(theirs.stderr, rel=1e-10)
    assert (ours.low, ours.high) == pytest.approx((theirs.slope - reach, theirs.slope + reach), rel=1e-10)


def test_lives_of_insulation() -> None:
    """Forty motorettes at four temperatures, 17 failed (Schmee and Hahn, Technometrics 21, 1979, table 1): the maximum
    of likelihood log10 t = -6.019 + 4.311 (1000 / T), scatter 0.2592, as they and Tanner (1996, §4.4) print it."""
    lives = {
        150: ([], 10, 8064),
        170: ([1764, 2772, 3444, 3542, 3780, 4860, 5196], 3, 5448),
        190: ([408, 408, 1344, 1344, 1440], 5, 1680),
        220: ([408, 408, 504, 504, 504], 5, 528),
    }
    z = np.concatenate([np.full(10, 1000 / (t + 273.2)) for t in lives])
    y = np.log10(np.concatenate([np.array([*failed, *[end] * left], float) for failed, left, end in lives.values()]))
    stopped = np.concatenate([np.arange(10) >= len(failed) for failed, _, _ in lives.values()])
    line = fit(z, y, stopped)
    assert (line.intercept, line.slope, line.scatter) == pytest.approx((-6.019, 4.311, 0.2592), abs=6e-4)


@pytest.mark.parametrize("seed", range(4))
def test_maximum_and_information_are_those_of_the_likelihood_as_written(seed: int) -> None:
    """Likelihood of SciPy's normal distribution, maximised without derivatives, its curvature by differences."""
    rng = np.random.default_rng(seed)
    z, y, stopped = _planted(rng, 60, 2.0, 0.3)

    def loss(p: Any) -> float:
        mean, sigma = p[0] + p[1] * z, math.exp(p[2])
        known = stats.norm.logpdf(y[~stopped], mean[~stopped], sigma).sum()
        return -float(known + stats.norm.logsf(y[stopped], mean[stopped], sigma).sum())

    found = optimize.minimize(
        loss, [-8, 2, -0.7], method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-12, "maxiter": 4000}
    )
    line = fit(z, y, stopped)
    assert (line.intercept, line.slope, line.scatter) == pytest.approx(
        (found.x[0], found.x[1], math.exp(found.x[2])), abs=1e-6
    )
    h, eye = 1e-3, np.eye(3)
    hessian = [
        [
            sum(s * t * loss(found.x + h * (s * eye[i] + t * eye[j])) for s in (1, -1) for t in (1, -1)) / (4 * h * h)
            for j in range(3)
        ]
        for i in range(3)
    ]
    known = int((~stopped).sum())
    assert line.error == pytest.approx(math.sqrt(np.linalg.inv(hessian)[1, 1] * known / (known - 2)), rel=1e-3)


def test_the_fit_does_not_depend_on_units() -> None:
    z, y, stopped = _planted(np.random.default_rng(1), 50, 1.5, 0.3)
    line, other = fit(z, y, stopped), fit(z + math.log(1e6), y - math.log(1e9), stopped)
    assert (other.slope, other.error, other.scatter) == pytest.approx((line.slope, line.error, line.scatter), rel=1e-6)


@pytest.mark.parametrize(
    ("count", "share"),
    [(40, 0.3), *(pytest.param(*case, marks=pytest.mark.nightly) for case in [(200, 0.3), (12, 0.3), (40, 0.6)])],
)
def test_planted_slopes_are_covered_and_naive_fits_are_biased(count: int, share: float) -> None:
    """400 samples: an interval of 95 % covers the slope 2 in 92.7 to 97.3 % of them (two deviations: 2.2 points).

    Taking the limit for the time, or leaving timeouts out, gives too small a slope.
    """
    rng = np.random.default_rng(11)
    covered, slopes, as_time, left_out = [], [], [], []
    for _ in range(400):
        z, y, stopped = _planted(rng, count, 2.0, share)
        line = fit(z, y, stopped)
        covered.append(line.low <= 2.0 <= line.high)
        slopes.append(line.slope)
        as_time.append(stats.linregress(z, y).slope)
        left_out.append(stats.linregress(z[~stopped], y[~stopped]).slope)
    assert 0.927 <= np.mean(covered) <= 0.975
    assert np.mean(slopes) == pytest.approx(2.0, abs=0.03)
    assert np.mean(as_time) < 1.75
    assert np.mean(left_out) < 1.97


def test_families_that_err_together_widen_the_interval() -> None:
    """12 families with a common deviation: the interval of independent problems covers far too seldom."""
    rng = np.random.default_rng(2)
    alone, together = [], []
    for _ in range(300):
        group = np.repeat(np.arange(12), 10)
        z = rng.uniform(2, 7, 12)[group] + 0.1 * rng.standard_normal(120)
        y = -8 + 2 * z + 0.6 * rng.standard_normal(12)[group] + 0.2 * rng.standard_normal(120)
        stopped = y > 5.0
        line = fit(z, np.minimum(y, 5.0), stopped, group)
        alone.append(line.low <= 2.0 <= line.high)
        together.append(line.group_low <= 2.0 <= line.group_high)
    assert np.mean(alone) < 0.6
    assert np.mean(together) > 0.85


def _rows(sizes: list[int], times: list[float], label: str = "s", limit: float = 10.0) -> list[dict[str, Any]]:
    return [
        row(
            f"f{k % 3}-{k}",
            label,
            "solved" if t < limit else "timeout",
            t if t < limit else math.nan,
            sizes=json.dumps({"n": n, "nc": n // 3}),
            seconds=limit,
        )
        for k, (n, t) in enumerate(zip(sizes, times, strict=True))
    ]


def test_a_table_gives_what_the_rows_say() -> None:
    """Times n² / 1000 with alternating factors; four timeouts, a crash, a wrong answer, a problem without n."""
    sizes = [3, 6, 12, 24, 48, 96, 192, 384, 768]
    times = [n * n / 1e3 * (1.3 if k % 2 else 0.7) for k, n in enumerate(sizes)]
    rows = _rows(sizes, times)
    rows += [row("x-1", "s", "crash", sizes='{"n": 50}'), row("x-2", "s", "wrong", 1e-6, sizes='{"n": 5000}')]
    rows += [row("x-3", "s", "solved", 1.0, sizes="{}")]
    (found,) = scaling(rows_of.normalised(table(*rows)), "n").to_dict("records")
    z = np.log(sizes)
    line = fit(z, np.log(np.minimum(times, 10.0)), np.array(times) > 10.0)
    assert (found["slope"], found["low"], found["high"]) == pytest.approx((line.slope, line.low, line.high), rel=1e-6)
    assert found["low"] < 2.0 < found["high"]
    assert (found["solved"], found["stopped"], found["excluded"], found["unsized"]) == (5, 4, 2, 1)
    assert (found["least"], found["largest"], found["families"], found["reason"]) == (3, 768, 3, "")
    assert math.isnan(found["family_low"])


@pytest.mark.parametrize(
    ("sizes", "times", "reason"),
    [
        ([1, 2, 4, 8, 16], [1.0, 2.0, 4.0, 8.0, 99.0], "4 solved problems, at least 5 are needed"),
        ([100, 150, 200, 300, 399], [1.0, 2.0, 3.0, 4.0, 5.0], "n from 100 to 399, a factor of 4 is needed"),
        ([7, 7, 7, 7, 7, 700], [1.0, 2.0, 3.0, 4.0, 5.0, 99.0], "all solved problems have n = 7"),
        ([1, 2, 4, 8, 16, 32], [0.1, 0.2, 0.4, 0.8, 1.6, 99.0], "the known values lie on a line exactly"),
    ],
)
def test_scaling_without_enough_data_is_refused_with_a_reason(
    sizes: list[int], times: list[float], reason: str
) -> None:
    (found,) = scaling(rows_of.normalised(table(*_rows(sizes, times))), "n").to_dict("records")
    assert math.isnan(found["slope"])
    assert found["reason"].startswith(reason)


def test_an_exact_law_has_no_error() -> None:
    sizes = [1, 2, 4, 8, 16, 32]
    (found,) = scaling(rows_of.normalised(table(*_rows(sizes, [0.01 * n for n in sizes]))), "n").to_dict("records")
    assert found["slope"] == pytest.approx(1.0)
    assert found["error"] == 0.0


def test_sizes_come_from_the_row_or_from_facts() -> None:
    rows = rows_of.normalised(table(*_rows([3, 6], [1.0, 2.0])))
    assert sizes_of(rows, "nc").tolist() == [1.0, 2.0]
    assert np.isnan(sizes_of(rows, "nnz")).all()
    facts = pd.DataFrame({"nnz": [9.0]}, index=["f-f0-0"])
    assert sizes_of(rows, "nnz", facts)[0] == 9.0
    assert math.isnan(sizes_of(rows, "nnz", facts)[1])
    assert scaling(rows, "nnz")["unsized"].tolist() == [2]
