"""A comparison in a few lines."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from cpbench.analysis.comparison import Comparison, PairVerdict
from cpbench.report.comparison import words
from cpbench.report.text import counted, cut, one_line

LISTED = 10
"""The most pairs of a kind that are shown; files have all."""


def lines(comparison: Comparison) -> Iterator[str]:
    """Yield the verdict, regressions with the commands that show them, labels, notes."""
    yield f"{comparison.verdict}: {words.headline(comparison)}"
    for version in words.versions(comparison):
        yield f"  {one_line(version)}"
    for verdict in (PairVerdict.REGRESSED, PairVerdict.IMPROVED):
        yield from _pairs(comparison, comparison.with_verdict(verdict), str(verdict))
    open_pairs = comparison.with_verdict(PairVerdict.INCONCLUSIVE)
    yield from _pairs(comparison, open_pairs[open_pairs["gate"] != "time"], "inconclusive")
    if any(suite.time is not None for suite in comparison.suites):
        yield f"time of each label, geometric mean of new over base; {words.margin(comparison)}"
        for suite in comparison.suites:
            if suite.time is not None:
                families = counted(suite.families, "family", "families")
                pairs = f"{counted(suite.timed, 'pair')}, {families}"
                yield f"  {one_line(suite.label)}: {words.times_of(suite)} ({pairs}): {words.on_time(suite)}"
                if suite.time == PairVerdict.REGRESSED:
                    yield f"    {words.again(comparison, words.slowest(comparison, suite.label))}"
    for note in comparison.notes:
        yield f"note: {cut(note, 300)}"


def _pairs(comparison: Comparison, listed: pd.DataFrame, what: str) -> Iterator[str]:
    if not len(listed):
        return
    yield f"{what} ({len(listed)}):"
    for _, pair in listed.head(LISTED).iterrows():
        yield f"  {one_line(pair['problem'])}, {one_line(pair['label_new'])}: {cut(pair['why'], 120)}"
        if what == PairVerdict.REGRESSED:
            yield f"    {words.again(comparison, pair)}"
    if len(listed) > LISTED:
        yield f"  and {len(listed) - LISTED} more"
