"""Sentences that the terminal and Markdown share, in which what is quoted is still to be escaped, and the lines of the
terminal."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from cpbench.analysis.comparison import Comparison, PairVerdict
from cpbench.analysis.comparison.suites import Suite
from cpbench.report.text import counted, cut, one_line, solve_command

ORDER = (PairVerdict.REGRESSED, PairVerdict.IMPROVED, PairVerdict.SAME, PairVerdict.INCONCLUSIVE)


def headline(comparison: Comparison) -> str:
    """Return the verdict and its evidence in one sentence."""
    sure = comparison.pairs[comparison.pairs["gate"] != "time"]
    counts = {
        v: int((sure["verdict"] == v).sum())
        for v in (PairVerdict.REGRESSED, PairVerdict.IMPROVED, PairVerdict.INCONCLUSIVE)
    }
    parts = [f"{counted(count, 'pair')} {verdict}" for verdict, count in counts.items() if count]
    by_time = [suite for suite in comparison.suites if suite.time is not None]
    if by_time:
        times = {v: sum(suite.time == v for suite in by_time) for v in ORDER}
        of = f"times of {counted(len(by_time), 'label')}: "
        parts.append(of + ", ".join(f"{count} {v}" for v, count in times.items() if count))
        moved = [suite for suite in by_time if suite.time in ORDER[:2]]
        if moved:
            most = max(moved, key=lambda suite: abs(math.log(suite.ratio)))
            parts[-1] += f" (most of all {most.label}: {most.ratio:.2f} times the time)"
    alone = comparison.pairs[(comparison.pairs["gate"] == "time") & comparison.pairs["verdict"].isin([*ORDER[:2]])]
    if len(alone):
        parts.append(f"{counted(len(alone), 'pair')} far slower or faster by itself")
    rest = "; ".join(parts) or "status, error and counters of all pairs are the same"
    return f"{counted(len(comparison.pairs), 'pair')} compared: {rest}"


def times_of(suite: Suite) -> str:
    """Format the geometric mean with its interval."""
    if not suite.timed:
        return "—"
    if math.isnan(suite.low):
        return f"{suite.ratio:.3f}"
    return f"{suite.ratio:.3f} [{suite.low:.3f}, {suite.high:.3f}]"


def on_time(suite: Suite) -> str:
    """Describe the verdict on a label's times, and what would decide where it is open."""
    if suite.time is None:
        return "not compared"
    return f"{suite.time}: {suite.why}" if suite.why else str(suite.time)


def margin(comparison: Comparison) -> str:
    """Describe δ here, and why."""
    noise = comparison.noise
    parts = [f"margin {noise.margin:.1%}"]
    if math.isfinite(noise.drift) and noise.drift > 1:
        parts.append(f"the machine within {noise.drift - 1:.1%} from one run to the other")
    if math.isfinite(noise.equal):
        parts.append(f"equal builds {noise.equal - 1:.1%} apart")
    spread = [f"{value:.0%}" for value in noise.spread if math.isfinite(value)]
    if spread:
        parts.append(f"reference solves vary by {' and '.join(spread)}")
    return f"δ = {noise.delta:.1%} ({'; '.join(parts)})"


def versions(comparison: Comparison) -> list[str]:
    """Return solvers whose version differs between the sides, and the versions of cpbench where they differ."""
    changes: list[str] = []
    sides = (comparison.base, comparison.new)
    ours = [str(side.meta.get("cpbench", "")) for side in sides]
    if all(ours) and ours[0] != ours[1]:
        changes.append(f"cpbench {ours[0]} → {ours[1]}")
    versioned = comparison.pairs[(comparison.pairs["version_base"] != "") & (comparison.pairs["version_new"] != "")]
    moved = versioned[versioned["version_base"] != versioned["version_new"]]
    for solver, base, new in sorted(
        set(zip(moved["solver"], moved["version_base"], moved["version_new"], strict=True))
    ):
        changes.append(f"{solver} {base} → {new}")
    return changes


def again(comparison: Comparison, pair: Mapping[Any, Any] | pd.Series[Any]) -> str:
    """Return the command that runs the new side of a pair again."""
    of_pair = {name: pair[name] for name in ("address", "solver", "request", "tolerance", "start")}
    row = {**of_pair, **{name: pair[f"{name}_new"] for name in ("label", "seconds")}}
    here = str(Path.cwd()) + os.sep
    metadata = (comparison.new.meta.get("solvers") or {}).get(row["label"])
    return solve_command(row, metadata).replace(here, "")


def slowest(comparison: Comparison, label: str) -> pd.Series[Any]:
    """Return the pair of a label whose time grew most."""
    pairs = comparison.pairs[(comparison.pairs["label_new"] == label) & comparison.pairs["comparable"]]
    return pairs.loc[pairs["ratio"].idxmax()]


# ----------------------------------------------------------------------------------------------------------- a terminal

LISTED = 10
"""The most pairs of a kind that are shown; files have all."""


def lines(comparison: Comparison) -> Iterator[str]:
    """Yield the verdict, regressions with the commands that show them, labels, notes."""
    yield f"{comparison.verdict}: {headline(comparison)}"
    for version in versions(comparison):
        yield f"  {one_line(version)}"
    for verdict in (PairVerdict.REGRESSED, PairVerdict.IMPROVED):
        yield from _pairs(comparison, comparison.with_verdict(verdict), str(verdict))
    open_pairs = comparison.with_verdict(PairVerdict.INCONCLUSIVE)
    yield from _pairs(comparison, open_pairs[open_pairs["gate"] != "time"], "inconclusive")
    if any(suite.time is not None for suite in comparison.suites):
        yield f"time of each label, geometric mean of new over base; {margin(comparison)}"
        for suite in comparison.suites:
            if suite.time is not None:
                families = counted(suite.families, "family", "families")
                pairs = f"{counted(suite.timed, 'pair')}, {families}"
                yield f"  {one_line(suite.label)}: {times_of(suite)} ({pairs}): {on_time(suite)}"
                if suite.time == PairVerdict.REGRESSED:
                    yield f"    {again(comparison, slowest(comparison, suite.label))}"
    for note in comparison.notes:
        yield f"note: {cut(note, 300)}"


def _pairs(comparison: Comparison, listed: pd.DataFrame, what: str) -> Iterator[str]:
    if not len(listed):
        return
    yield f"{what} ({len(listed)}):"
    for _, pair in listed.head(LISTED).iterrows():
        yield f"  {one_line(pair['problem'])}, {one_line(pair['label_new'])}: {cut(pair['why'], 120)}"
        if what == PairVerdict.REGRESSED:
            yield f"    {again(comparison, pair)}"
    if len(listed) > LISTED:
        yield f"  and {len(listed) - LISTED} more"
