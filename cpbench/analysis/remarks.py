"""Remarks before any number of a run: rows in which the run deviated from its request."""

from __future__ import annotations

import pandas as pd

from cpbench.analysis import starts
from cpbench.analysis.failures import flagged
from cpbench.foundation.plurals import counted, some_of

LISTED = 3
"""Files that are named, those with most rows."""


def remarks(table: pd.DataFrame) -> list[str]:
    """Return one line each: starts that were not as requested, files that held other data when some of the rows were
    made, clocks that were not believed."""
    return [*starts.honoured(starts.merged(table)), *changed_files(table), *clocks(table)]


def clocks(table: pd.DataFrame) -> list[str]:
    """Return for how many rows the runner's time counts, because the clock of the solver's process showed much less.

    >>> clocks(pd.DataFrame({"label": ["a", "b"], "flags": ["clock,threads", ""]}))[0][:43]
    "1 time is the runner's: the answer came muc"
    """
    rows = flagged(table.assign(flags=table["flags"].fillna("")), "clock")
    if not len(rows):
        return []
    times = counted(len(rows), "time is", "times are")
    labels = some_of([str(label) for label in rows["label"].value_counts().index], LISTED)
    return [f"{times} the runner's: the answer came much later than the solver's clock says (flag clock): {labels}"]


def changed_files(table: pd.DataFrame) -> list[str]:
    """Return files whose rows are of several problems: their rows are kept and counted.

    >>> rows = {"address": "p.h5", "fingerprint": ["a", "b", "b"]}
    >>> changed_files(pd.DataFrame(rows))[0][:62]
    'p.h5: its 3 rows are of 2 problems: the file changed, or was r'
    """
    by_address = table.groupby("address", sort=True)["fingerprint"].agg(["nunique", "size"])
    by_address = by_address[by_address["nunique"] > 1].sort_values("size", ascending=False, kind="stable")
    lines = [
        f"{address}: its {size} rows are of {problems} problems: the file changed, or was read in several formats; the "
        "rows of all of them are kept and counted, and another results file (-o) leaves the former ones out"
        for address, problems, size in by_address.head(LISTED).itertuples()
    ]
    return [
        *lines,
        *([f"{len(by_address) - LISTED} more files are of several problems"] if len(by_address) > LISTED else []),
    ]
