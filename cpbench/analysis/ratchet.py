"""Changes between two baselines: better outcomes are taken over, worse ones are not.

The first of status, error and counters that differs decides about a pair. An error counts as another one when it is
more than `GUARD` decades away, a counter when it is more than `slack` of the smaller one (and more than 1) away: closer
ones come of rounding, and the line stays as it was, so that what is chance never shows in version control.
"""

from __future__ import annotations

import fnmatch
import math
from collections.abc import Sequence
from enum import StrEnum

import numpy as np
import pandas as pd

from cpbench.analysis import baseline
from cpbench.analysis.baseline_lines import COLUMNS, KEY, OUTCOME, PLACE, UNMEASURED
from cpbench.analysis.comparison.gates import SETTLED, WORST

GUARD = 1
"""Decades by which errors may differ."""
SLACK = 0.1
"""Part by which counters may differ."""
FLAKY = "flaky"
"""First word of a reason that excuses both outcomes: with any other, a known failure that passes is reported."""


class Change(StrEnum):
    """Change of a pair, in the order of reports."""

    REGRESSED = "regressed"
    FIXED = "fixed"
    """A failure that was known is none any more."""
    IMPROVED = "improved"
    CHANGED = "changed"
    """Another outcome, neither better nor worse."""
    NEW = "new"
    VANISHED = "vanished"
    UNMEASURED = "unmeasured"
    """Not run here: nothing is known."""
    KNOWN = "known"
    """Fails, as is known."""
    SAME = "same"


def changes(old: pd.DataFrame, new: pd.DataFrame, slack: float = SLACK) -> pd.DataFrame:
    """Compare two baselines, one row a pair of either: `COLUMNS` of the old with `_old`, of the new with `_new`,
    change, detail.

    >>> rows = pd.DataFrame({"problem": ["p", "q"], "fingerprint": ["p", "q"], "label": ["s", "s"],
    ...     "tolerance": [1e-6] * 2, "error": [0.0, 0.0], "status": ["solved", "timeout"]})
    >>> old, new = baseline.outcomes(rows), baseline.outcomes(rows.assign(status=["timeout", "timeout"]))
    >>> changes(old, new)[["problem", "change", "detail"]].values.tolist()
    [['p', 'regressed', 'solved -> timeout'], ['q', 'same', '']]
    """
    both = old.merge(new, on=list(KEY), how="outer", suffixes=("_old", "_new"), indicator="side")
    words = [f"{name}{end}" for name in (*PLACE, *OUTCOME, "known") for end in ("_old", "_new")]
    both[words] = both[words].astype(object).where(both[words].notna(), "")
    there = both["side"] == "both"
    rank_old, rank_new = (_ranks(both[f"status_{side}"]).where(there) for side in ("old", "new"))
    status = _sign(rank_new - rank_old)
    other = both["status_old"] != both["status_new"]
    error = _error(both).where(~other, 0)
    counts, counted = _counters(both, slack)
    counts = counts.where(~other & (error == 0), 0)
    sign = status.where(status != 0, error.where(error != 0, counts))

    change = pd.Series(str(Change.SAME), index=both.index, dtype=object)
    change = change.mask(other, Change.CHANGED).mask(sign < 0, Change.IMPROVED).mask(sign > 0, Change.REGRESSED)
    failed_before, fails = rank_old > 0, rank_new > 0
    known = (both["known_old"] != "") & there
    liar = both["status_new"].isin(WORST) & other
    flaky = known & both["known_old"].str.startswith(FLAKY)
    # the reason of one failure does not excuse a lie or a crash
    change = change.mask(known & failed_before & ~fails, Change.FIXED)
    change = change.mask(known & failed_before & fails & ~liar & ~(sign < 0), Change.KNOWN)
    change = change.mask(flaky & other & ~liar, Change.KNOWN)
    change = change.mask(both["status_new"].isin(UNMEASURED) & (both["side"] != "left_only"), Change.UNMEASURED)
    change = change.mask((both["side"] == "right_only") & ~both["status_new"].isin(UNMEASURED), Change.NEW)
    change = change.mask(both["side"] == "left_only", Change.VANISHED)

    detail = (both["status_old"] + " -> " + both["status_new"]).where(other & there, "")
    detail = detail.mask(
        (error != 0) & there, "error " + both["error_old"] + " -> " + both["error_new"] + ", " + both["status_new"]
    )
    detail = detail.mask(counts != 0, counted)
    detail = detail.mask(~there, both["status_old"].where(both["side"] == "left_only", both["status_new"]))
    place = {name: both[f"{name}_old"].where(both[f"{name}_old"] != "", both[f"{name}_new"]) for name in PLACE}
    found = both.assign(change=change.astype(str), detail=detail, **place, known=both["known_old"])
    return found.sort_values([*PLACE, *KEY], kind="stable", ignore_index=True)


def accepted(found: pd.DataFrame, patterns: Sequence[str]) -> pd.Series[bool]:
    """Return which regressions any of the patterns accepts: globs of a problem, a solver's label or PROBLEM:LABEL.

    A label with its options in brackets means itself, although the brackets are a glob's.
    """
    addressed = pd.DataFrame({"problem": found["problem"], "label": baseline.labels(found)}, dtype=object)
    addressed["both"] = addressed["problem"] + ":" + addressed["label"]
    meant = pd.Series(False, index=found.index)
    for column in addressed:
        hit = {
            name: any(name == pattern or fnmatch.fnmatchcase(name, pattern) for pattern in patterns)
            for name in addressed[column].unique()
        }
        meant |= addressed[column].map(hit).astype(bool)
    return meant & (found["change"] == Change.REGRESSED)


def updated(found: pd.DataFrame, accept: pd.Series[bool], reason: str, *, prune: bool = False) -> pd.DataFrame:
    """Return the lines of the baseline after `changes`: better and other outcomes taken over, worse ones where
    accepted.

    An accepted line keeps `reason` beside it; a reason stays as long as its pair fails.
    """
    change = found["change"]
    take = change.isin([Change.FIXED, Change.IMPROVED, Change.CHANGED, Change.NEW]) | accept
    kept = found[~((change == Change.UNMEASURED) & (found["status_old"] == ""))]
    kept = kept[~((change[kept.index] == Change.VANISHED) & prune)]
    take = take[kept.index]
    lines = kept[list(KEY)].copy()
    for name in (*PLACE, *OUTCOME):
        lines[name] = kept[f"{name}_new"].where(take, kept[f"{name}_old"])
    known = kept["known_old"].mask(kept["change"] == Change.FIXED, "")
    lines["known"] = known.mask(accept[kept.index], reason)
    return lines[list(COLUMNS)]


# ------------------------------------------------------------------------------------------------ pieces


def _ranks(status: pd.Series[str]) -> pd.Series[float]:
    """Rank 0 done with, 1 not solved, 2 wrong or crashed; the same order as in a comparison of two runs."""
    return 1.0 - status.isin(SETTLED).astype(float) + status.isin(WORST).astype(float)


def _sign(difference: pd.Series[float]) -> pd.Series[int]:
    """Return -1 for better, 0, 1 for worse; 0 where one side is missing."""
    return pd.Series(np.sign(difference.fillna(0.0).to_numpy(dtype=float)), index=difference.index).astype(int)


def _error(both: pd.DataFrame) -> pd.Series[int]:
    """Return the sign of the change of the error by more than the guard; 0 where either side has none."""
    exponents = [_exponents(both[f"error_{side}"]) for side in ("old", "new")]
    difference = (exponents[1] - exponents[0]).fillna(0.0)  # of two infinities, none
    return _sign(difference.where(difference.abs() > GUARD, 0.0))


def _exponents(written: pd.Series[str]) -> pd.Series[float]:
    exponent = {
        text: math.nan if not text else math.log10(float(text.removeprefix("<="))) for text in set(written.unique())
    }
    return written.map(exponent).astype(float)


def _counters(both: pd.DataFrame, slack: float) -> tuple[pd.Series[int], pd.Series[str]]:
    """Return the sign of the change of counters by more than the slack (worse wins), and the counters it is about."""
    sign = pd.Series(0, index=both.index)
    detail = pd.Series("", index=both.index, dtype=object)
    differ = both[(both["counters_old"] != both["counters_new"]) & (both["side"] == "both")]
    for at, before, after in differ[["counters_old", "counters_new"]].itertuples(name=None):
        one, other = baseline.counters(before), baseline.counters(after)
        more = {
            name: other[name] > count
            for name, count in one.items()
            if name in other and abs(other[name] - count) > _room(count, other[name], slack)
        }
        if more:
            sign[at] = 1 if any(more.values()) else -1
            detail[at] = ", ".join(f"{name} {one[name]} -> {other[name]}" for name in more)
    return sign, detail


def _room(one: int, other: int, slack: float) -> float:
    """Return how far two counts may be apart, in either order."""
    return max(1.0, slack * min(abs(one), abs(other))) if slack else 0.0
