"""Slopes of time over size: those of NumPy's `polyfit` over what was solved, planted ones, and refusals."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest
from synthetic_results import row, table

from cpbench.analysis import table as rows_of
from cpbench.analysis.scaling import scaling
from cpbench.analysis.table import sizes_of


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
    done = np.array(times) < 10.0
    (slope, intercept), covariance = np.polyfit(z[done], np.log(times)[done], 1, cov=True)
    assert (found["slope"], found["intercept"]) == pytest.approx((slope, intercept), rel=1e-9)
    assert found["error"] == pytest.approx(math.sqrt(covariance[0, 0]), rel=1e-9)
    reach = 3.182446 * found["error"]  # the t quantile of 3 degrees of freedom
    assert (found["low"], found["high"]) == pytest.approx((slope - reach, slope + reach), rel=1e-6)
    assert found["low"] < 2.0 < found["high"]
    assert (found["solved"], found["stopped"], found["excluded"], found["unsized"]) == (5, 4, 2, 1)
    assert (found["least"], found["largest"], found["reason"]) == (3, 48, "")


@pytest.mark.parametrize(
    ("sizes", "times", "reason"),
    [
        ([1, 2, 4, 8, 16], [1.0, 2.0, 4.0, 8.0, 99.0], "4 solved problems, at least 5 are needed"),
        ([100, 150, 200, 300, 399], [1.0, 2.0, 3.0, 4.0, 5.0], "n from 100 to 399, a factor of 4 is needed"),
        ([7, 7, 7, 7, 7, 700], [1.0, 2.0, 3.0, 4.0, 5.0, 99.0], "n from 7 to 7, a factor of 4 is needed"),
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
    assert found["error"] == pytest.approx(0.0, abs=1e-9)


def test_sizes_come_from_the_row() -> None:
    rows = rows_of.normalised(table(*_rows([3, 6], [1.0, 2.0])))
    assert sizes_of(rows, "nc").tolist() == [1.0, 2.0]
    assert np.isnan(sizes_of(rows, "nnz")).all()
    assert scaling(rows, "nnz")["unsized"].tolist() == [2]
