"""A recorded sequence step by step: what each solver took, and what a warm start changed of it."""

from __future__ import annotations

import math

import pandas as pd

from cpbench.analysis import metrics, starts
from cpbench.analysis import table as rows_of
from cpbench.errors import CpbenchError, UnknownName

COLUMNS = ("step", "label", "start", "status", "time", "iterations", "error", "ratio", "fell_back")


def steps(group: pd.DataFrame, sequence: str = "") -> tuple[str, pd.DataFrame]:
    """Return the sequence (by default the only one) and one row a step, label and start, in this order: COLUMNS.

    time [s] and iterations are ∞ where the step was not solved, iterations NaN where they are not counted; error is the
    judged one; ratio is the time over that of the same label's cold start (NaN where either failed, on cold rows, and
    where the start `fell_back` to a cold one).

    Raises UnknownName for a sequence that is not there, CpbenchError where there is none or more than one.

    >>> rows = pd.DataFrame({"problem": "p", "sequence": "walk", "step": 0, "label": "s", "start": ["cold", "previous"],
    ...                      "status": "solved", "solve": [4.0, 1.0], "started": ["cold", "previous"]})
    >>> steps(rows_of.normalised(rows))[1][["start", "time", "ratio"]].to_numpy().tolist()
    [['cold', 4.0, nan], ['previous', 1.0, 0.25]]
    """
    names = sorted(set(group["sequence"]) - {""})
    if not names:
        raise CpbenchError("no problem is a step of a sequence: run one, as cpbench generate writes them")
    if sequence and sequence not in names:
        raise UnknownName("sequence", sequence, names)
    if not sequence and len(names) > 1:
        raise CpbenchError(f"{len(names)} sequences: name one with --sequence: {', '.join(names)}")
    name = sequence or names[0]
    own = group[(group["sequence"] == name) & group["step"].notna()]
    solved = rows_of.solved(own)
    iterations = pd.Series(metrics.spent(own, metrics.METRICS["iterations"]), index=own.index)
    whole = rows_of.with_time(own).assign(iterations=iterations.where(solved, math.inf))
    paired = starts.pairs(own)
    of_warm = ["label", "start", "fingerprint"]
    warm = paired.set_index(of_warm)
    both = (warm["time"] < math.inf) & (warm["time_cold"] < math.inf) & ~warm["fell_back"].astype(bool)
    ratio = (warm["time"] / warm["time_cold"].where(both)).rename("ratio")
    found = whole.join(ratio, on=of_warm).join(warm["fell_back"], on=of_warm)
    found["fell_back"] = found["fell_back"].eq(True)
    return name, found.sort_values(["step", "label", "start"], ignore_index=True)[list(COLUMNS)]
