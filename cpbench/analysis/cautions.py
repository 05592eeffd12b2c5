"""What must be said beside a cost, because it is not the same cost for every solver.

A program that is launched for every solve is charged with its launch. Iterations are pivots in one method and
factorizations in another. `sheets` is what the results say of each label (`meta["solvers"]`); those of older files know
neither, and nothing is said of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from cpbench.analysis.metrics import Metric

Sheets = Mapping[str, Mapping[str, Any]]
CLOCKS = ("time", "solve", "cpu")
"""Metrics that have the launch of a program in them."""


def launching(labels: Iterable[str], sheets: Sheets) -> list[str]:
    """The labels whose every solve launches a program.

    >>> launching(["lemke", "gams-path"], {"lemke": {}, "gams-path": {"launches": True}})
    ['gams-path']
    """
    return [label for label in labels if sheets.get(label, {}).get("launches")]


def methods(labels: Iterable[str], sheets: Sheets) -> dict[str, list[str]]:
    """The labels of each kind of method."""
    found: dict[str, list[str]] = {}
    for label in labels:
        method = sheets.get(label, {}).get("method")
        if method:
            found.setdefault(str(method), []).append(label)
    return found


def caution(metric: Metric, labels: Iterable[str], sheets: Sheets) -> str:
    """The sentence beside a figure or table of this metric; '' where its numbers compare as they stand.

    >>> from cpbench.analysis.metrics import METRICS
    >>> sheets = {"lemke": {"method": "pivoting"}, "path": {"method": "Newton with pivoting", "launches": True}}
    >>> caution(METRICS["time"], sheets, sheets)
    'Every solve of path launches a program, and its launch is in the time.'
    >>> caution(METRICS["reported"], sheets, sheets)
    'What path reports may have the launch of a program in it.'
    >>> print(caution(METRICS["iterations"], sheets, sheets))
    An iteration is another thing in each method: pivoting (lemke); Newton with pivoting (path). Counts do not compare.
    """
    labels = list(labels)
    if metric.name in CLOCKS and (started := launching(labels, sheets)):
        return f"Every solve of {', '.join(started)} launches a program, and its launch is in the time."
    if metric.name == "reported" and (started := launching(labels, sheets)):
        return f"What {', '.join(started)} reports may have the launch of a program in it."
    if metric.counter == "iterations" and len(found := methods(labels, sheets)) > 1:
        told = "; ".join(f"{method} ({', '.join(names)})" for method, names in found.items())
        return f"An iteration is another thing in each method: {told}. Counts do not compare."
    return ""
