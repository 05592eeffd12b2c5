"""Notes beside the verdicts of a comparison, in sentences."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from cpbench.analysis import participation
from cpbench.analysis.comparison import gates
from cpbench.analysis.comparison.noise import Noise
from cpbench.analysis.comparison.pairs import Matched
from cpbench.analysis.profiles import FLOOR
from cpbench.verification import Status


def on_publishing(tables: Sequence[pd.DataFrame], metas: Sequence[Mapping[str, Any]]) -> list[str]:
    """Note the solvers whose figures may not be published, which a summary of a CI job does."""
    terms: dict[str, str] = {}
    for table, meta in zip(tables, metas, strict=True):
        terms |= participation.restricted(table, meta.get("solvers") or {})
    return [f"publishing figures of {name} is restricted: {term}" for name, term in sorted(terms.items())]


def on_pairs(judged: pd.DataFrame, matched: Matched, idle: int) -> list[str]:
    """Note what was not compared, and why; `idle` pairs were started on neither side."""
    notes: list[str] = []
    if len(matched.only_base) or len(matched.only_new):
        notes.append(
            f"{len(matched.only_base)} rows are in the base only, {len(matched.only_new)} in the new results only"
        )
    if len(matched.twice):
        notes.append(f"{len(matched.twice)} rows could not be told apart, and were not compared")
    if matched.changed:
        notes.append(
            f"{len(matched.changed)} problems are others under their old names, and were not compared: "
            + ", ".join(matched.changed[:5])
            + (", …" if len(matched.changed) > 5 else "")
        )
    if idle:
        notes.append(f"{idle} pairs were started on neither side")
    if not (judged["solved_base"] & judged["solved_new"]).any():
        notes.append("no pair was solved on both sides: there is nothing to be said of times")
    for column, what in (("seconds", "time"), ("memory", "memory")):
        other = gates.differ(judged, column)
        if other.any():
            notes.append(
                f"{int(other.sum())} pairs were run under another {what} limit: running into it is no change of status"
            )
    return notes


def on_stationary(judged: pd.DataFrame, counted: bool) -> list[str]:
    """Note answers that are stationary only: how many on each side, or that they are `counted` as solved."""
    if counted:
        return ["stationary answers are counted as solved (--count-stationary)"]
    base, new = (int((judged[f"status_{side}"] == str(Status.STATIONARY)).sum()) for side in ("base", "new"))
    return (
        [f"stationary, and not among the solved: {base} in the base, {new} in the new results"] if base or new else []
    )


def on_times(judged: pd.DataFrame, noise: Noise, interleaved: bool, here: bool) -> list[str]:
    """Note how far times can be trusted; `interleaved`: both sides are one run, `here`: some pair is of one machine."""
    timed = judged["ratio"].notna()
    if not timed.any():
        return []
    notes: list[str] = []
    if not here:
        notes.append("times are of two machines: they are told, and decide nothing (--same-machine if it is one)")
        return notes
    beside = int(((judged["jobs_base"] > 1) | (judged["jobs_new"] > 1)).sum())
    if beside:
        notes.append(f"{beside} pairs were timed with other solves beside them (-j): their times decide nothing")
    below = int(judged["below"].sum())
    if below:
        notes.append(f"{below} pairs take less than {FLOOR:g} s on both sides: below the floor, times of calls")
    if not interleaved and math.isnan(noise.drift):
        notes.append("no equal reference solves: nobody knows how much the machine drifted between the two runs")
    elif not interleaved and noise.drift > 1 + noise.margin:
        notes.append(
            f"by its reference solves the machine may differ by a factor {noise.drift:.3g} between the two runs: times "
            "within that are the machine's"
        )
    if math.isfinite(noise.equal):
        notes.append(
            f"equal builds differ by {noise.equal - 1:.1%} in this job: one process beside another is taken to differ "
            f"by {math.expm1(noise.bias):.1%} by itself"
        )
    else:
        notes.append(
            f"no builds of equal code in this job (--noise): one process beside another is assumed to differ by "
            f"{math.expm1(noise.bias):.1%} by itself; where it differs by more, changes are seen that are none"
        )
    if noise.unsteady:
        listed = ", ".join(sorted(f"{name} of {solver}" for solver, name in noise.unsteady)[:4])
        notes.append(f"counters that differ between equal builds were left out: {listed}")
    return notes
