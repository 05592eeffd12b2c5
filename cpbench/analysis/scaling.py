"""Growth of time with size: log t = a + b log x, by least squares over the problems that were solved.

The interval of the slope takes the problems as independent. It does not see a law that is not a power: mind `least` and
`largest`, the range of x. Problems that were stopped at the limit are counted (`stopped`) and not fitted: where large
ones are among them, the slope is too small. Other failures are counted too (`excluded`).
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np
import pandas as pd
from scipy.special import stdtrit

from cpbench.analysis import table as rows_of
from cpbench.analysis.summary import size_ranges
from cpbench.analysis.table import Floats
from cpbench.verification import Status

Bools: TypeAlias = np.ndarray[tuple[int], np.dtype[np.bool_]]

SPAN, POINTS = 4.0, 5
"""Least ratio of sizes and least number of solved problems for a slope."""
COLUMNS = (
    "label", "slope", "low", "high", "error", "intercept", "solved", "stopped", "excluded", "unsized", "least",
    "largest", "reason",
)  # fmt: skip


def scaling(group: pd.DataFrame, symbol: str, level: float = 0.95) -> pd.DataFrame:
    """Fit how the time of each label of a group grows with a size of the problems, one row a label, in order of
    label.

    Columns: slope b with its interval (low, high) and standard error; intercept (log seconds at x = 1), solved (the
    problems fitted), stopped (at the limit), excluded (other failures, and times or limits that are not known), unsized
    (without a positive x), least and largest x fitted. Where sizes differ by less than a factor `SPAN`, or fewer than
    `POINTS` were solved, the numbers are NaN and `reason` says why.

    Parameters
    ----------
    symbol : a dimension (n, nc, m, ...). level : of the interval.

    >>> rows = pd.DataFrame({"fingerprint": list("abcdef"), "label": "s", "family": "", "seconds": 9.0,
    ...                      "sizes": [f'{{"n": {2**k}}}' for k in range(6)], "convert": 0.0, "setup": 0.0,
    ...                      "lift": 0.0, "solve": [1.0, 2.1, 3.8, 8.3, math.nan, math.nan],
    ...                      "status": ["solved"] * 4 + ["timeout"] * 2})
    >>> scaling(rows, "n")["reason"].tolist()
    ['4 solved problems, at least 5 are needed']
    >>> longer = pd.concat([rows, rows.assign(fingerprint=list("uvwxyz"))])
    >>> round(scaling(longer, "n")["slope"].item(), 2)
    1.0
    """
    x, seconds, stopped, known, sized = _measured(group, symbol)
    label, labels = pd.factorize(group["label"], sort=True)
    records: list[dict[str, Any]] = []
    order = np.argsort(label, kind="stable")
    for name, places in zip(labels, np.split(order, np.cumsum(np.bincount(label))[:-1]), strict=True):
        there = places[(known & sized)[places]]
        at = there[~stopped[there]]
        record: dict[str, Any] = {
            "label": str(name),
            "solved": len(at),
            "stopped": len(there) - len(at),
            "excluded": int((~known[places]).sum()),
            "unsized": int((known & ~sized)[places].sum()),
            "least": float(x[at].min()) if len(at) else math.nan,
            "largest": float(x[at].max()) if len(at) else math.nan,
        }
        record["reason"] = _refusal(record, symbol)
        records.append(record if record["reason"] else record | _fitted(np.log(x[at]), np.log(seconds[at]), level))
    return pd.DataFrame(records, columns=list(COLUMNS))


def _fitted(x: Floats, y: Floats, level: float) -> dict[str, float]:
    """Return the line through logarithms by least squares: slope with its interval, standard error, intercept."""
    (slope, intercept), covariance = np.polyfit(x, y, 1, cov=True)
    error = float(np.sqrt(covariance[0, 0]))
    reach = float(stdtrit(len(x) - 2, 0.5 + level / 2)) * error
    ends = {"low": float(slope) - reach, "high": float(slope) + reach}
    return {"slope": float(slope), **ends, "error": error, "intercept": float(intercept)}


def line(record: pd.Series[Any]) -> tuple[Floats, Floats]:
    """Return both ends (size, seconds) of the line of a row of `scaling` that has one.

    >>> ends = line(pd.Series({"intercept": math.log(2.0), "slope": 1.0, "least": 1.0, "largest": 8.0}))
    >>> ends[0].tolist(), ends[1].round(9).tolist()
    ([1.0, 8.0], [2.0, 16.0])
    """
    sizes = np.array([record["least"], record["largest"]], dtype=float)
    return sizes, np.exp(float(record["intercept"]) + float(record["slope"]) * np.log(sizes))


def widest(group: pd.DataFrame) -> str:
    """Return the dimension whose largest value is the most times its least one; the first by name among equals; ''
    of none.

    >>> widest(pd.DataFrame({"sizes": ['{"m": 3, "n": 1}', '{"m": 6, "n": 9}']}))
    'n'
    """
    ratios = {s: b / a for s, (a, b) in size_ranges(group).items() if a > 0}
    return max(sorted(ratios), key=ratios.__getitem__, default="")


def dimensions(group: pd.DataFrame) -> list[str]:
    """Return the dimensions that some problem of the group has."""
    return list(size_ranges(group))


def points(group: pd.DataFrame, symbol: str) -> pd.DataFrame:
    """Return the times that `scaling` looks at, one row a pair: label, x, seconds, and whether that is a limit at which
    it was `stopped`.
    """
    x, seconds, stopped, known, sized = _measured(group, symbol)
    points = pd.DataFrame({"label": group["label"].to_numpy(), "x": x, "seconds": seconds, "stopped": stopped})
    return points[known & sized].reset_index(drop=True)


def _measured(group: pd.DataFrame, symbol: str) -> tuple[Floats, Floats, Bools, Bools, Bools]:
    """Return of each row: size, seconds to the answer or (`stopped`) the limit, whether these and the size are
    known.
    """
    x = rows_of.sizes_of(group, symbol)
    timed = rows_of.with_time(group)
    stopped = (group["status"] == str(Status.TIMEOUT)).to_numpy(dtype=bool)
    seconds = np.where(stopped, group["seconds"].to_numpy(dtype=float), timed["time"].to_numpy(dtype=float))
    return x, seconds, stopped, np.isfinite(seconds) & (seconds > 0), np.isfinite(x) & (x > 0)


def _refusal(record: dict[str, Any], symbol: str) -> str:
    """Return why there is no slope; '' when there is one."""
    if record["solved"] < POINTS:
        return f"{record['solved']} solved problems, at least {POINTS} are needed"
    if record["largest"] < SPAN * record["least"]:
        return f"{symbol} from {record['least']:g} to {record['largest']:g}, a factor of {SPAN:g} is needed"
    return ""
