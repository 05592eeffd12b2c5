"""Caveats: costs that are not the same cost for every solver, and rows in which a run deviated from its request.

A program that is launched for every solve is charged with its launch. Iterations are pivots in one method and
factorizations in another. `sheets` is what the results say of each label (`meta["solvers"]`); labels of which
it says nothing are not mentioned.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import pandas as pd

from cpbench.analysis import starts
from cpbench.analysis.failures import flagged
from cpbench.analysis.metrics import Metric
from cpbench.analysis.starts import COLD
from cpbench.foundation.text import counted, some_of

SolverMetadata = Mapping[str, Mapping[str, Any]]
CLOCKS = ("time", "solve", "cpu")
"""Metrics that have the launch of a program in them."""
BUSY, DRIFT = 0.1, 1.5
"""Share of the rows with a load beyond the cores, and ratio of the longest to the shortest reference solve, from which
on times are not to be relied on."""
LISTED = 3
"""Files that are named, those with most rows."""
FIRST_STEP = "cold: first step"
"""Text of a row about its start where there was no step before to start from: no failure of the start policy."""


def fell_back(rows: pd.DataFrame) -> dict[str, int]:
    """Count by label the rows that were to begin at a point and had none."""
    cold = rows["started"].str.startswith(COLD) & (rows["started"] != FIRST_STEP) & (rows["start"] != COLD)
    return {str(label): int(count) for label, count in rows.loc[cold, "label"].value_counts().items()}


def launching(labels: Iterable[str], metadata: SolverMetadata) -> list[str]:
    """Return the labels whose every solve launches a program.

    >>> launching(["lemke", "gams-path"], {"lemke": {}, "gams-path": {"launches": True}})
    ['gams-path']
    """
    return [label for label in labels if metadata.get(label, {}).get("launches")]


def methods(labels: Iterable[str], metadata: SolverMetadata) -> dict[str, list[str]]:
    """Return the labels of each kind of method."""
    result: dict[str, list[str]] = {}
    for label in labels:
        method = metadata.get(label, {}).get("method")
        if method:
            result.setdefault(str(method), []).append(label)
    return result


def caution(metric: Metric, labels: Iterable[str], metadata: SolverMetadata) -> str:
    """Return the sentence beside a figure or table of this metric; '' where its numbers compare as they stand.

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
    if metric.name in CLOCKS and (started := launching(labels, metadata)):
        return _launch(started)
    if metric.name == "reported" and (started := launching(labels, metadata)):
        return f"What {', '.join(started)} reports may have the launch of a program in it."
    if metric.counter == "iterations" and len(by_method := methods(labels, metadata)) > 1:
        methods_text = "; ".join(f"{method} ({', '.join(names)})" for method, names in by_method.items())
        return f"An iteration is another thing in each method: {methods_text}. Counts do not compare."
    return ""


def served(rows: pd.DataFrame) -> dict[str, float]:
    """Return the median round trip [s] of an empty request, of each label whose solves another process served.

    >>> served(pd.DataFrame({"label": ["a", "b", "b"], "trip": [float("nan"), 4e-5, 6e-5]}))
    {'b': 5e-05}
    """
    trips = rows.loc[rows["trip"].notna(), ["label", "trip"]].groupby("label")["trip"].median()
    return {str(label): float(trip) for label, trip in trips.items()}


def microseconds(seconds: float) -> str:
    """Write a round trip.

    >>> microseconds(5.4e-5)
    '54 µs'
    """
    return f"{1e6 * seconds:.0f} µs"


def disturbance(rows: pd.DataFrame, meta: Mapping[str, Any]) -> str:
    """Return why the times of a run are not to be relied on, '' where nothing speaks against them.

    That is where the load was beyond the cores of the machine at a tenth of the rows, where a solve that is always the
    same took at one time more than DRIFT times as long as at another, or where kernels were not compiled.

    Parameters
    ----------
    rows : with `loadavg`. meta : of the results, with `machine` (its `threads`) and `references`.

    >>> rows = pd.DataFrame({"loadavg": [1.0, 9.8]})
    >>> meta = {"machine": {"threads": 2}, "references": [{"seconds": 0.01}, {"seconds": 0.032}]}
    >>> for reason in disturbance(rows, meta).split("; "):
    ...     print(reason)
    Do not rely on these times: the load was beyond the 2 cores at 1 of 2 pairs (up to 9.8)
    one and the same solve took up to 3.2 times as long as at its best.
    """
    reasons = _beyond(rows, meta)
    if (ratio := _drift(meta)) > DRIFT:
        reasons.append(f"one and the same solve took up to {ratio:.1f} times as long as at its best")
    return f"Do not rely on these times: {'; '.join(reasons)}." if reasons else ""


def noise(rows: pd.DataFrame, meta: Mapping[str, Any]) -> float:
    """Return the ratio up to which times of a problem may differ by the machine alone: ∞ where the load was beyond its
    cores, kernels were not compiled, or solvers of a problem may have run at different times, since the run was resumed
    or merged; else that of a solve that is always the same; see `disturbance`."""
    parts = sum(one.get("pairs") == 0 for one in meta.get("references") or [])
    return math.inf if parts > 1 or _beyond(rows, meta) else _drift(meta)


def _beyond(rows: pd.DataFrame, meta: Mapping[str, Any]) -> list[str]:
    machine = meta.get("machine") or {}
    compiled = str(machine.get("kernels", "")).partition(". ")[0]
    reasons = [f"kernels are {compiled}"] if compiled.startswith("NOT") else []
    cores, loads = machine.get("threads"), rows["loadavg"].dropna()
    busy = int((loads > cores).sum()) if cores else 0
    if busy and busy >= BUSY * len(loads):
        pairs = f"{busy} of {counted(len(loads), 'pair')}"
        reasons.append(f"the load was beyond the {cores} cores at {pairs} (up to {loads.max():.1f})")
    return reasons


def _drift(meta: Mapping[str, Any]) -> float:
    took = [float(one["seconds"]) for one in meta.get("references") or [] if one["seconds"] and one["seconds"] > 0]
    return max(took) / min(took) if took else 1.0


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


def _launch(labels: Iterable[str]) -> str:
    return f"Every solve of {', '.join(labels)} launches a program, and its launch is in the time."
