"""A problem × solver table small enough to read at a glance and to compare line by line."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from cpbench.analysis import table as rows_of
from cpbench.analysis.best import fastest
from cpbench.report.text import fenced, one_line
from cpbench.verification import Status

SYMBOLS = {
    str(Status.SOLVED): "+",
    str(Status.STATIONARY): "s",
    str(Status.APPROXIMATE): "a",
    str(Status.LOST): "l",
    str(Status.INACCURATE): "i",
    str(Status.WRONG): "W",
    str(Status.UNRESOLVABLE): "r",
    str(Status.INFEASIBLE): "0",
    str(Status.UNBOUNDED): "u",
    str(Status.FAILED): "f",
    str(Status.MAX_ITER): "m",
    str(Status.TIMEOUT): "T",
    str(Status.MEMOUT): "M",
    str(Status.CRASH): "C",
    str(Status.ERROR): "E",
    str(Status.UNSUPPORTED): ".",
    str(Status.UNAVAILABLE): "-",
    str(Status.NOT_RUN): "?",
}
FASTEST = "*"
BLANK = " "


def matrix(group: pd.DataFrame, labels: Sequence[str], times: pd.DataFrame) -> str:
    """Format a line a problem, a column a label in the given order; the labels stand on a staircase above their
    columns. `times` : of the solvers that are ranked (`run.ComparedTimes`).
    """
    status = rows_of.pivot(group, "status", "")
    ranked = fastest(times)
    lead = ranked.reindex(index=status.index, columns=status.columns, fill_value=False)
    names = dict(zip(group["fingerprint"], rows_of.problem_names(group), strict=True))
    stairs = ["│ " * k + "┌ " + one_line(label) for k, label in enumerate(labels)]
    lines: list[str] = []
    for fingerprint in status.index:
        marks = [
            FASTEST
            if status.at[fingerprint, label] == str(Status.SOLVED) and lead.at[fingerprint, label]
            else SYMBOLS.get(str(status.at[fingerprint, label]), BLANK)
            for label in labels
        ]
        lines.append(" ".join(marks) + "  " + one_line(names[fingerprint]))
    return fenced([*stairs, *lines])


def legend(group: pd.DataFrame) -> str:
    """Explain the symbols that occur, on one line."""
    present = set(group["status"])
    parts = [f"`{FASTEST}` solved, fastest"] if str(Status.SOLVED) in present else []
    parts += [f"`{mark}` {status.replace('_', ' ')}" for status, mark in SYMBOLS.items() if status in present]
    return ", ".join(parts) + ", blank: no route was planned."
