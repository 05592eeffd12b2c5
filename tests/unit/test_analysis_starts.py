"""Warm starts beside cold ones, on tables made up; intervals against SciPy's bootstrap of the sequences' means."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from synthetic_results import row, table

from cpbench.analysis import starts
from cpbench.analysis import table as rows_of
from cpbench.analysis.means import LIMIT, PAR10, Penalty
from cpbench.analysis.starts import paired


def _counted(count: int) -> str:
    return json.dumps({"iterations": count})


def test_pairs_are_compared_where_both_solved() -> None:
    """Ratios 1/2 and 1/8 have the geometric mean 1/4; a step that fell back and one that failed are only counted."""
    cold = [row(f"p-{i}", "s", "solved", 8.0, counters=_counted(16)) for i in range(4)]
    warm = [
        row("p-0", "s", "solved", 4.0, start="previous", started="previous", counters=_counted(0)),
        row("p-1", "s", "solved", 1.0, start="previous", started="previous", counters=_counted(4)),
        row("p-2", "s", "solved", 8.0, start="previous", started="cold: first step", counters=_counted(16)),
        row("p-3", "s", "timeout", 10.0, start="previous", started="previous"),
    ]
    (found,) = paired(rows_of.normalised(table(*cold, *warm))).to_dict("records")
    assert (found["pairs"], found["warm"], found["cold"], found["fell_back"]) == (4, 3, 4, 1)
    assert found["time"] == pytest.approx(0.25)
    assert found["iterations"] == pytest.approx(math.sqrt(1 / 16 * 4 / 16)), "0 iterations count as 1"


def test_settings_are_not_mixed() -> None:
    cold = row("p-0", "s", "solved", 1.0)
    warm = row("p-0", "s", "solved", 1.0, start="file", started="file", tolerance=1e-8)
    assert paired(rows_of.normalised(table(cold, warm))).empty


def gains(rows: pd.DataFrame, *given: Any, **named: Any) -> pd.DataFrame:
    return starts.gains(starts.pairs(rows), *given, **named)


def losses(rows: pd.DataFrame, **named: Any) -> pd.DataFrame:
    return starts.losses(starts.pairs(rows), **named)


def _steps(name: str, cold: list[float], warm: list[float], **given: Any) -> list[dict[str, Any]]:
    """A simulation: times of its steps from both starts, infinite ones being timeouts after 10 s."""
    return [
        row(
            f"{name}-{k}",
            "s",
            "solved" if math.isfinite(t) else "timeout",
            t if math.isfinite(t) else math.nan,
            start=start,
            started=start,
            sequence=name,
            step=k,
            **given,
        )
        for start, times in (("cold", cold), ("previous", warm))
        for k, t in enumerate(times)
    ]


def _rows(*parts: list[dict[str, Any]]) -> pd.DataFrame:
    return rows_of.normalised(pd.DataFrame([one for part in parts for one in part]))


INF = math.inf


def test_gains_over_common_pairs_and_over_all() -> None:
    """Ratios 1/4, 2, then 8/10 (cold failed, at the limit), 10/1 (warm failed), 1 (both did)."""
    rows = _rows(_steps("walk", [4.0, 1.0, INF, 1.0, INF], [1.0, 2.0, 8.0, INF, INF]))
    (found,) = gains(rows).to_dict("records")
    counts = [found[name] for name in ("pairs", "both", "only_warm", "only_cold", "neither", "slower", "common_over")]
    assert counts == [5, 2, 1, 1, 1, 1, 2]
    assert found["common"] == pytest.approx(math.sqrt(0.25 * 2))
    assert found["all"] == pytest.approx((0.25 * 2 * 0.8 * 10 * 1) ** 0.2)
    (par10,) = gains(rows, PAR10).to_dict("records")
    assert par10["all"] == pytest.approx((0.25 * 2 * 0.08 * 100 * 1) ** 0.2)
    assert (par10["common"], found["clusters"]) == (found["common"], 1)
    assert math.isnan(found["all_low"]), "one simulation is one witness"


def test_a_penalty_is_never_less_than_the_other_took() -> None:
    """A warm start that fails where the cold one took 9 s is not the better one at a penalty of 1 s."""
    (found,) = gains(_rows(_steps("walk", [9.0], [INF])), Penalty(seconds=1.0)).to_dict("records")
    assert found["all"] == 1.0
    (unknown,) = gains(_rows(_steps("walk", [9.0], [INF], seconds=math.nan)), LIMIT).to_dict("records")
    assert math.isnan(unknown["all"])


def test_a_start_that_fell_back_counts_among_all_only() -> None:
    rows = _steps("walk", [8.0, 8.0], [8.0, 2.0])
    rows[2]["started"] = "cold: first step"
    (found,) = gains(_rows(rows)).to_dict("records")
    assert (found["fell_back"], found["common_over"]) == (1, 1)
    assert (found["common"], found["all"]) == pytest.approx((0.25, 0.5))


def test_losses_are_listed_the_worst_first() -> None:
    rows = _rows(_steps("walk", [4.0, 1.0, INF, 1.0, INF, 2.0], [1.0, 2.0, 8.0, INF, INF, 2.2]))
    found = losses(rows)
    assert found[["step", "status", "ratio"]].to_numpy().tolist() == [
        [3.0, "timeout", INF],
        [1.0, "solved", 2.0],
        [5.0, "solved", 1.1],
    ]
    assert losses(rows, beyond=1.5)["step"].tolist() == [3.0, 1.0]


def test_a_wrong_answer_from_a_warm_start_is_a_loss() -> None:
    rows = _steps("walk", [4.0], [1e-6])
    rows[1]["status"] = "wrong"
    (lost,) = losses(_rows(rows)).to_dict("records")
    assert (lost["status"], lost["ratio"]) == ("wrong", INF)
    assert gains(_rows(rows))["all"].item() == pytest.approx(2.5)


def test_times_below_the_floor_are_no_loss() -> None:
    assert losses(_rows(_steps("walk", [1e-6], [9e-5]))).empty


def test_intervals_resample_sequences() -> None:
    """Steps of a sequence share their gain: as wide as SciPy's bootstrap of the sequences' means, and much wider
    than one of the steps."""
    rng = np.random.default_rng(4)
    logs = [gain + 0.05 * rng.standard_normal(20) for gain in rng.normal(-0.7, 0.4, 30)]
    rows = _rows(*(_steps(f"w{k}", [1.0] * 20, np.exp(steps).tolist()) for k, steps in enumerate(logs)))
    (found,) = gains(rows, replicates=20_000).to_dict("records")
    means = np.array([steps.mean() for steps in logs])
    # percentiles read further out, as Student's t asks with 30 sequences (Hesterberg, American Statistician 69, 2015)
    level = 1 - 2 * stats.norm.cdf(-math.sqrt(30 / 29) * stats.t.ppf(0.975, 29))
    theirs = stats.bootstrap(
        (means,), np.mean, method="percentile", confidence_level=level, n_resamples=20_000, rng=rng
    ).confidence_interval
    assert found["clusters"] == 30
    assert found["common"] == pytest.approx(math.exp(means.mean()))
    ends = math.log(found["common_low"]), math.log(found["common_high"])
    assert ends == pytest.approx((theirs.low, theirs.high), abs=0.008)
    steps = np.concatenate(logs)
    assert ends[1] - ends[0] > 3 * 2 * 1.96 * steps.std() / math.sqrt(steps.size)


def test_without_warm_rows_there_is_nothing() -> None:
    rows = rows_of.normalised(table(row("p-0", "s", "solved", 1.0)))
    assert paired(rows).empty
    assert gains(rows).empty
    assert losses(rows).empty
