"""Confirmation of alarms by a second run: an alarm that does not come back is inconclusive, and reported.

An alarm is a pair that regressed, a pair that has a status now that it had not, or a label whose times regressed.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import pandas as pd

from cpbench.analysis.comparison.gates import PairVerdict
from cpbench.analysis.comparison.verdicts import NOT_AGAIN, Comparison, worst
from cpbench.foundation.plurals import counted

PAIR = ["fingerprint", "label_new", "request", "tolerance", "measure", "start", "threads", "step", "problem"]
"""Columns by which a pair of the second comparison is found."""


def alarms(found: Comparison, statuses: Collection[str] = ()) -> pd.DataFrame:
    """Return the pairs that alarmed; `statuses` : those that are an alarm where a pair has them on the new side
    only.
    """
    return found.pairs[_alarmed(found, statuses)]


def to_repeat(found: Comparison, statuses: Collection[str] = ()) -> pd.DataFrame:
    """Return the pairs to run again: those that alarmed, and all that were timed of the labels whose times did."""
    slower = [suite.label for suite in found.suites if suite.time == PairVerdict.REGRESSED]
    timed = found.pairs["comparable"] & found.pairs["label_new"].isin(slower)
    return found.pairs[_alarmed(found, statuses) | timed]


def confirmed(first: Comparison, again: Comparison, statuses: Collection[str] = ()) -> Comparison:
    """Return `first` with its alarms that are not in `again` inconclusive, and a note that counts them.

    A pair that `again` has not stays what it was: it could not be run.
    """
    alarmed = _alarmed(first, statuses)
    keys = pd.MultiIndex.from_frame(first.pairs[PAIR])
    ran = keys.isin(pd.MultiIndex.from_frame(again.pairs[PAIR]))
    back = keys.isin(pd.MultiIndex.from_frame(alarms(again, statuses)[PAIR]))
    calm = alarmed & ran & ~back
    pairs = first.pairs.copy()
    pairs.loc[calm, "why"] = pairs.loc[calm, "why"].where(pairs.loc[calm, "why"] != "", pairs["status_new"])
    pairs.loc[calm, "why"] += "; not when it was run again"
    pairs.loc[calm, ["verdict", "kind"]] = [str(PairVerdict.INCONCLUSIVE), NOT_AGAIN]
    second = {suite.label: suite.time for suite in again.suites}
    counts = pairs.groupby("label_new")["verdict"].value_counts()
    slower = [suite.label for suite in first.suites if suite.time == PairVerdict.REGRESSED]
    calmed = [label for label in slower if second.get(label) not in (None, PairVerdict.REGRESSED)]
    suites = tuple(
        replace(
            suite,
            counts={verdict: int(counts.get((suite.label, str(verdict)), 0)) for verdict in PairVerdict},
            **(
                {"time": PairVerdict.INCONCLUSIVE, "why": "not slower when it was run again"}
                if suite.label in calmed
                else {}
            ),
        )
        for suite in first.suites
    )
    counts_text = (
        [_counted("pair", int(alarmed.sum()), int((alarmed & back).sum()), int(calm.sum()))] if alarmed.any() else []
    )
    lasting = sum(second.get(label) == PairVerdict.REGRESSED for label in slower)
    counts_text += [_counted("label", len(slower), lasting, len(calmed))] if slower else []
    note = f"run again: {'; '.join(counts_text)}"
    return replace(first, verdict=worst(pairs, suites), pairs=pairs, suites=suites, notes=(note, *first.notes))


def _alarmed(found: Comparison, statuses: Collection[str]) -> pd.Series[bool]:
    pairs = found.pairs
    became = pairs["status_new"].isin(list(statuses)) & (pairs["status_base"] != pairs["status_new"])
    return (pairs["verdict"] == PairVerdict.REGRESSED) | became


def _counted(what: str, alarmed: int, again: int, calm: int) -> str:
    """Count the alarms, those confirmed, those not confirmed, and those that could not be run."""
    rest = alarmed - again - calm
    parts = [f"{again} of {counted(alarmed, what)} alarmed twice", f"{calm} did not"]
    return ", ".join([*parts, *([f"{rest} could not be run again"] if rest else [])])
