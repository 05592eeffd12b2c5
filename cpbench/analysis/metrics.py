"""Metrics of the cost of a solve: time, iterations, memory, counters of the solver.

    matrix(group, metric)[p, s] = what s spent on p, and ∞ unless its answer was verified as solved

A wrong answer costs ∞ by every measure, however few iterations it took. That a solver does not count something is
no failure: a label with a verified answer that lacks the value is left out of the matrix and reported by name, because
∞ would say that it failed and any number would be invented.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from cpbench.analysis import table as rows_of
from cpbench.analysis.profiles import FLOOR
from cpbench.analysis.table import CHARGED, Floats
from cpbench.errors import StoreError, UnknownName

MEMORY_FLOOR = 2.0**20
"""Bytes below which memory counts as this much: what fits into pages that a process has already is measured as 0."""
COUNTER = "counter:"
"""Prefix of the name of a metric that is a counter of the solver: `counter:factorizations`."""


@dataclass(frozen=True)
class Metric:
    """A measure of cost: less is better, failures are ∞.

    Attributes
    ----------
    floor : a smaller cost counts as this much when costs are divided (None: it cannot come near 0). A count of 0, as
        of a start that was good enough, counts as 1.
    columns : columns of the table that are added up, the last of which must be known. counter : or the key of the
        column `counters`.
    """

    name: str
    unit: str
    floor: float | None
    doc: str
    columns: tuple[str, ...] = ()
    counter: str = ""


def _counter(name: str, key: str, doc: str) -> Metric:
    return Metric(name, "", 1.0, doc, counter=key)


_TIMED = (*(part for part in CHARGED if part != "solve"), "solve")
METRICS: Mapping[str, Metric] = {
    metric.name: metric
    for metric in (
        Metric("time", "s", FLOOR, "conversion, set-up, solve and carrying the answer back", _TIMED),
        Metric("solve", "s", FLOOR, "the solve alone", ("solve",)),
        Metric("cpu", "s", FLOOR, "processor time of the solve, over all threads and processes", ("cpu",)),
        Metric("reported", "s", FLOOR, "the time by the solver's own account", ("reported",)),
        Metric("memory", "byte", MEMORY_FLOOR, "resident memory needed on top of what was there", ("peak",)),
        _counter("iterations", "iterations", "iterations as the solver counts them"),
    )
}
"""The metrics that every table has a column for; counters are `counter:` and their name."""


def metric(name: str, group: pd.DataFrame | None = None) -> Metric:
    """Return the metric of that name; with a group, counters are those that some row of it has.

    Raises UnknownName, with the nearest names.

    >>> metric("time").unit, metric("counter:pivots").floor
    ('s', 1.0)
    >>> metric("iteration")
    Traceback (most recent call last):
    cpbench.errors.UnknownName: unknown metric 'iteration': did you mean iterations?
    """
    if name in METRICS:
        return METRICS[name]
    counted = sorted(counters(group)) if group is not None else []
    key = name.removeprefix(COUNTER)
    if name.startswith(COUNTER) and key and (group is None or key in counted):
        return _counter(name, key, f"{key} as the solver counts them")
    raise UnknownName("metric", name, [*METRICS, *(COUNTER + key for key in counted or ["NAME"])])


def counters(group: pd.DataFrame) -> set[str]:
    """Return the names of all counters that some row of the group has.

    >>> sorted(counters(pd.DataFrame({"counters": ['{"pivots": 3}', "", '{"iterations": 1, "pivots": 0}']})))
    ['iterations', 'pivots']
    """
    return {key for counted in _parsed(group)[1] for key in counted}


@dataclass(frozen=True)
class MetricValues:
    """A metric over a group.

    Attributes
    ----------
    values : problems (fingerprints, in order of name) × labels; ∞ where not verified as solved or not planned.
    left_out : labels without a column, with the number of their verified answers that lack the value. lost : of the
    same shape as `values`, whether a conversion lost the answer (`table.lost`).
    """

    metric: Metric
    values: pd.DataFrame
    left_out: Mapping[str, int]
    lost: pd.DataFrame


def measured(group: pd.DataFrame, metric: Metric) -> MetricValues:
    """Return the metric of each pair of a group. Raises StoreError when a pair has two rows.

    >>> rows = pd.DataFrame({"problem": ["p"] * 3, "fingerprint": ["p"] * 3, "address": "", "label": ["a", "b", "c"],
    ...     "status": ["solved", "wrong", "solved"], "counters": ['{"iterations": 0}', '{"iterations": 1}', ""]})
    >>> found = measured(rows, METRICS["iterations"])
    >>> found.values.to_dict("list"), found.left_out
    ({'a': [0.0], 'b': [inf]}, {'c': 1})
    """
    solved = rows_of.solved(group).to_numpy(dtype=bool)
    cost = spent(group, metric)
    unknown = group["label"][solved & np.isnan(cost)].value_counts()
    left_out = {str(label): int(count) for label, count in sorted(unknown.items(), key=lambda item: str(item[0]))}
    wide = rows_of.spread(group, np.where(solved, cost, math.inf), math.inf)
    lost = rows_of.lost(group).drop(columns=list(left_out))
    return MetricValues(metric, wide.drop(columns=list(left_out)), left_out, lost)


def matrix(group: pd.DataFrame, metric: Metric) -> pd.DataFrame:
    """Return the values of `measured`, problems × labels; `measured` also gives the labels left out."""
    return measured(group, metric).values


def spent(group: pd.DataFrame, metric: Metric) -> Floats:
    """Return the cost of each row, whatever its status; NaN where it is unknown.

    >>> rows = pd.DataFrame({"convert": [math.nan, 1.0], "setup": 0.5, "solve": [1.0, math.nan], "lift": 0.0})
    >>> spent(rows, METRICS["time"]).tolist()
    [1.5, nan]
    """
    if metric.counter:
        codes, texts = _parsed(group)
        return np.array([_number(counted.get(metric.counter)) for counted in texts], dtype=float)[codes]
    *others, last = (pd.to_numeric(group[name]).to_numpy(dtype=float) for name in metric.columns)
    return np.sum([last, *(np.where(np.isnan(part), 0.0, part) for part in others)], axis=0)


def _parsed(group: pd.DataFrame) -> tuple[rows_of.Integers, list[dict[str, object]]]:
    """Parse the distinct texts of the column `counters`, and return which of them each row has."""
    codes, texts = pd.factorize(group["counters"].fillna(""))
    try:
        return np.asarray(codes), json.loads(f"[{','.join(text or '{}' for text in texts)}]")
    except ValueError as cause:
        raise StoreError(f"column counters: {cause}; it holds one JSON object a row, or nothing") from None


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) else math.nan
