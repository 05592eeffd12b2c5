"""Remarks before any number of a run: rows in which the run deviated from its request."""

from __future__ import annotations

import pandas as pd

from cpbench.analysis import multi_start
from cpbench.analysis.starts import honoured

LISTED = 3
"""Files that are named, those with most rows."""


def remarks(table: pd.DataFrame) -> list[str]:
    """Return one line each: starts that were not as requested, files that held other data when some of the rows were
    made.
    """
    return [*honoured(multi_start.merged(table)), *changed_files(table)]


def changed_files(table: pd.DataFrame) -> list[str]:
    """Return files whose rows are of several problems: their rows are kept and counted.

    >>> rows = {"address": "p.h5", "fingerprint": ["a", "b", "b"]}
    >>> changed_files(pd.DataFrame(rows))[0][:62]
    'p.h5: its 3 rows are of 2 problems: the file changed, or was r'
    """
    found = table.groupby("address", sort=True)["fingerprint"].agg(["nunique", "size"])
    found = found[found["nunique"] > 1].sort_values("size", ascending=False, kind="stable")
    lines = [
        f"{address}: its {size} rows are of {problems} problems: the file changed, or was read in several formats; the "
        "rows of all of them are kept and counted, and another results file (-o) leaves the former ones out"
        for address, problems, size in found.head(LISTED).itertuples()
    ]
    return [*lines, *([f"{len(found) - LISTED} more files are of several problems"] if len(found) > LISTED else [])]
