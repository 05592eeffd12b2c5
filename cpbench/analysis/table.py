"""The table of results: one row a planned pair, and what every other analysis asks of it.

A table is a pandas DataFrame with (at least) the columns below; rows may come in any order. A *group* is what can
be compared: the rows of one formulation in one set of a plan, by one measure at one tolerance, with one start and
number of threads. Within a group a pair is
known by its fingerprint (the problem's mathematics) and its label (solver, options, route request).
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import pandas as pd

from cpbench.errors import StoreError
from cpbench.formulations.base import Kind
from cpbench.verification import MET_TOLERANCE, VERIFIED, Status

Integers: TypeAlias = np.ndarray[tuple[int], np.dtype[np.int64]]
Floats: TypeAlias = np.ndarray[tuple[int], np.dtype[np.float64]]
Matrix: TypeAlias = np.ndarray[Any, np.dtype[np.float64]]

TEXT = (
    "key", "problem", "address", "fingerprint", "node", "family", "sizes", "solver", "label", "request", "options",
    "start", "set", "measure", "sequence", "status", "route", "kind", "claim", "flags", "message", "parts", "counters",
    "version", "samples", "started", "host", "finished", "certainty", "certificate",
)  # fmt: skip
NUMBERS = (
    "tolerance", "threads", "seconds", "memory", "repeats_asked", "step", "error", "target_error", "target_tolerance",
    "load", "convert", "setup", "solve", "lift", "verify", "wall", "cpu", "peak", "repeats", "solve_min", "solve_iqr",
    "signal", "code", "jobs", "attempts", "loadavg", "reported", "distance",
    "batch", "trip", "solve_wall",
)  # fmt: skip
ROW = ("key", "problem", "fingerprint", "label")
"""Columns that tell a row from all others."""
STATUSES = tuple(str(s) for s in Status)
"""Every status, from the best outcome to the least informative: the order of all tables."""
CONTRADICTED = "contradicted"
"""Column of a normalised table: claims that there is no solution, beside a verified answer."""
CHARGED = ("convert", "setup", "solve", "lift")
"""Columns whose sum is a solver's time. Reading the file and judging are not the solver's work."""


@dataclass(frozen=True, order=True)
class ResultGroup:
    """Settings that the rows of a group have in common."""

    node: str
    tolerance: float
    start: str
    threads: int
    set: str = ""
    measure: str = ""


def normalised(table: pd.DataFrame, columns: Collection[str] = ()) -> pd.DataFrame:
    """Copy a table with every column present, text never missing, numbers numeric, error and rows in a fixed order,
    and with the column CONTRADICTED.

    `columns` : what is asked for, where that is not everything; what tells rows apart comes with it.

    >>> rows = pd.DataFrame({"problem": ["b", "a"], "status": ["solved", None], "label": "s"})
    >>> normalised(rows)["status"].tolist(), list(normalised(rows, ["status"]))
    (['not_run', 'solved'], ['key', 'problem', 'fingerprint', 'label', 'status'])
    """
    wanted = {*columns, *ROW} if columns else {*TEXT, *NUMBERS, *table}
    series = {str(name): table[name].copy() for name in table if name in wanted and name not in (*TEXT, *NUMBERS)}
    absent = pd.Series(np.nan, index=table.index)
    series |= {name: _text(table.get(name, absent)) for name in TEXT if name in wanted}
    series |= {name: _numbers(table.get(name, absent)) for name in NUMBERS if name in wanted}
    if "status" in wanted:
        series["status"] = series["status"].replace("", str(Status.NOT_RUN))
    if "error" in wanted:
        series["error"] = series["error"].fillna(math.inf)
    nameless = series["fingerprint"] == ""
    if nameless.any():
        series["fingerprint"] = series["fingerprint"].where(~nameless, series["problem"])
    clean = pd.DataFrame(series, index=table.index, copy=False)
    if not columns:  # taken from all rows: groups of them, and reports without some, would miss what contradicts
        conflicts = contradicted(clean)
        clean = clean.drop(columns=CONTRADICTED, errors="ignore").assign(**{CONTRADICTED: conflicts})
    order = _order(clean)
    if (np.diff(order) != 1).any():
        clean = clean.take(order)
    clean.index = pd.RangeIndex(len(clean))
    return clean


def codes(values: pd.Series) -> tuple[Integers, pd.Index]:
    """Code each value by its number among the distinct ones in ascending order; text is compared once a name.

    >>> numbers, names = codes(pd.Series(["b", "a", "b"]))
    >>> numbers.tolist(), names.tolist()
    ([1, 0, 1], ['a', 'b'])
    """
    numbers, names = pd.factorize(values, sort=True)
    return np.asarray(numbers, dtype=np.int64), pd.Index(names)


def _order(clean: pd.DataFrame) -> Integers:
    """Return the positions of the rows by problem, fingerprint, label and key."""
    columns = [codes(clean[name])[0] for name in ("label", "fingerprint", "problem")]
    order = np.lexsort(columns)
    same = np.all([np.diff(column[order]) == 0 for column in columns], axis=0)
    return np.lexsort([codes(clean["key"])[0], *columns]) if same.any() else order  # no two keys are alike


def _text(values: pd.Series) -> pd.Series[str]:
    """Return text with '' for missing values."""
    if values.dtype == "str":  # of pandas 3; older ones hold text as objects
        array = np.asarray(values, dtype=object)
        missing = array != array  # NaN, which is missing text there, is not equal to itself
        return values.mask(missing, "") if missing.any() else values
    return values.astype(object).where(values.notna(), "").astype(str)


def _numbers(values: pd.Series) -> pd.Series[float]:
    return (values if pd.api.types.is_numeric_dtype(values) else pd.to_numeric(values)).astype(float)


def solved(table: pd.DataFrame) -> pd.Series[bool]:
    """Return whether each row counts as solved, whatever the solver claims. A stationary answer does not."""
    return table["status"].isin(VERIFIED)


def met(table: pd.DataFrame) -> pd.Series[bool]:
    """Return whether the answer of each row was measured to meet the tolerance: solved, or stationary."""
    return table["status"].isin(MET_TOLERANCE)


def contradicted(table: pd.DataFrame) -> pd.Series[bool]:
    """Return whether each row claims that its problem has no solution, while another row has a verified answer to it.

    Such a claim is false. It is compared where the route is equivalent (a target of another one may have no solution
    though its source has), with answers by the same measure at the row's tolerance or a tighter one. A stationary
    point is feasible: it contradicts `infeasible`, not `unbounded`. A row that has a proof, its own answer that
    met its target, or no answer in time has another status than `failed`, and is not such a claim.

    >>> rows = {"problem": "p", "label": ["s", "t"], "status": ["solved", "failed"], "claim": ["solved", "infeasible"],
    ...         "kind": "equivalent", "tolerance": 1e-6}
    >>> contradicted(normalised(pd.DataFrame(rows))).tolist()
    [False, True]
    """
    if CONTRADICTED in table:
        return table[CONTRADICTED].astype(bool)
    result = pd.Series(False, index=table.index)
    if not {"claim", "kind", "fingerprint", "measure", "tolerance"} <= set(table):
        return result
    open_rows = (table["status"] == str(Status.FAILED)) & (table["kind"] == str(Kind.EQUIVALENT))
    for claim, statuses in ((Status.INFEASIBLE, MET_TOLERANCE), (Status.UNBOUNDED, VERIFIED)):
        claims = table[open_rows & (table["claim"] == str(claim))]
        if len(claims):
            problem = ["fingerprint", "measure"]
            tightest = table[table["status"].isin(statuses)].groupby(problem)["tolerance"].min()
            smallest = tightest.reindex(pd.MultiIndex.from_frame(claims[problem])).to_numpy()
            result[claims.index] = smallest <= claims["tolerance"].to_numpy()
    return result


def counting_stationary(table: pd.DataFrame) -> pd.DataFrame:
    """Return the table with stationary answers counted as solved; their flag still marks them."""
    status = table["status"].replace(str(Status.STATIONARY), str(Status.SOLVED))
    if "flags" not in table:
        return table.assign(status=status)
    flags = (
        table["flags"].astype(object).str.replace(r"\bstationary(?=,|$)", "stationary counted as solved", regex=True)
    )
    return table.assign(status=status, flags=flags)


def with_time(table: pd.DataFrame) -> pd.DataFrame:
    """Return the table with a column `time` [s]: convert + setup + solve + lift, ∞ unless the row is solved.

    A claimed answer that is not one has no time, however fast it came; nor has a row whose solve was not timed.

    >>> rows = pd.DataFrame({"status": ["solved", "wrong"], "convert": [0.5, 0.0], "setup": [0.0, 0.0],
    ...                      "solve": [1.0, 1e-3], "lift": [float("nan"), 0.0]})
    >>> with_time(rows)["time"].tolist()
    [1.5, inf]
    """
    return table.assign(time=np.where(solved(table), charged(table), math.inf))


def charged(table: pd.DataFrame) -> Floats:
    """Return the time charged to each row [s], solved or not: convert + setup + solve + lift; ∞ where no solve was
    timed.
    """
    spent = {name: pd.to_numeric(table[name]).to_numpy(dtype=float) for name in CHARGED}
    total = np.sum([np.where(np.isnan(part), 0.0, part) for part in spent.values()], axis=0)
    return np.where(np.isnan(spent["solve"]), math.inf, total)


def groups(table: pd.DataFrame) -> list[tuple[ResultGroup, pd.DataFrame]]:
    """Split a table into its comparable parts, in order of formulation, tolerance, start, threads, set, measure.

    A table that is one group is its own part, and not a copy.
    """
    names = ["node", "tolerance", "start", "threads", "set", "measure"]
    if len(table) and all(_constant(table[name]) for name in names):
        return [(_group(*table[names].iloc[0]), table)]
    return [(_group(*settings), rows) for settings, rows in table.groupby(names, dropna=False, sort=True)]  # type: ignore[misc]


def _group(node: Any, tolerance: Any, start: Any, threads: Any, part: Any, measure: Any) -> ResultGroup:
    return ResultGroup(str(node), float(tolerance), str(start), int(threads), str(part), str(measure))


def _constant(values: pd.Series) -> bool:
    """Return whether all values equal the first one; False where that is missing."""
    array = values.to_numpy(dtype=object if values.dtype == "str" else None)
    return bool((array == array[0]).all())


def limit(table: pd.DataFrame) -> float:
    """Return the longest a solve of these rows could take [s]; ∞ where none is known."""
    limits = table["seconds"].dropna()
    return float(limits.max()) if len(limits) else math.inf


def problem_names(table: pd.DataFrame) -> pd.Series[str]:
    """Return the name of each row's problem; with its address where two different problems share a name.

    >>> rows = pd.DataFrame({"problem": ["a", "a", "b"], "fingerprint": ["1", "2", "3"], "address": ["x", "y", "z"]})
    >>> problem_names(rows).tolist()
    ['a (x)', 'a (y)', 'b']
    """
    problem, names = pd.factorize(table["problem"])
    fingerprint, prints = pd.factorize(table["fingerprint"])
    pairs = np.unique(problem * (len(prints) + 1) + fingerprint, return_index=True)[1]
    shared = (np.bincount(problem[pairs], minlength=len(names)) > 1)[problem]
    if not shared.any():
        return table["problem"]
    return table["problem"].where(~shared, table["problem"] + " (" + table["address"] + ")")


def sizes_read(group: pd.DataFrame) -> tuple[Integers, list[Mapping[str, float]]]:
    """Give each row's sizes a number, and return these, of every dimension by its symbol.

    >>> place, sizes = sizes_read(pd.DataFrame({"sizes": ['{"n": 3}', "", '{"n": 3}']}))
    >>> place.tolist(), sizes
    ([0, 1, 0], [{'n': 3.0}, {}])
    """
    positions, texts = pd.factorize(group["sizes"])
    return positions, [{symbol: float(size) for symbol, size in (json.loads(t) if t else {}).items()} for t in texts]


def pivot(table: pd.DataFrame, column: str, missing: Any) -> pd.DataFrame:
    """Spread a column of a group as problems (fingerprints, in order of name) × labels; `missing` where no row is.

    Raises StoreError when a pair has two rows.
    """
    values = table[column]
    if isinstance(missing, str):
        return spread(table, values.where(values.notna(), missing).to_numpy(dtype=object), missing)
    return spread(table, values.fillna(missing).to_numpy(), missing)


def spread(table: pd.DataFrame, values: np.ndarray[tuple[int], np.dtype[Any]], missing: Any) -> pd.DataFrame:
    """Spread one value a row of a group as problems (fingerprints, in order of name) × labels; `missing` where no
    row is.

    Raises StoreError when a pair has two rows.

    >>> rows = pd.DataFrame({"problem": ["b", "a"], "fingerprint": ["1", "2"], "address": "", "label": ["s", "t"]})
    >>> spread(rows, np.array([5.0, 7.0]), math.inf).to_dict("list")
    {'s': [inf, 5.0], 't': [7.0, inf]}
    """
    fingerprint, prints = pd.factorize(table["fingerprint"])
    label, labels = codes(table["label"])
    cells = fingerprint * len(labels) + label
    filled = np.bincount(cells, minlength=len(prints) * len(labels))
    if filled.max(initial=0) > 1:
        row = table[(filled > 1)[cells]].iloc[0]
        raise StoreError(f"{row['problem']}, {row['label']}: two rows in one group; analyse each setting apart")
    wide = np.full(len(prints) * len(labels), missing, dtype=values.dtype)
    wide[cells] = values
    names = list(zip(_names(table, fingerprint, len(prints)).tolist(), prints.tolist(), strict=True))
    order = sorted(range(len(names)), key=names.__getitem__)
    rows = wide.reshape(len(prints), len(labels))[order]
    index = prints[order].rename("fingerprint")
    return pd.DataFrame(rows, index=index, columns=labels.rename("label"), copy=False)


def _names(table: pd.DataFrame, fingerprint: Integers, count: int) -> pd.Series[str]:
    """Return the name of each distinct fingerprint's problem, that of its first row where they differ.

    Names are made for these rows only, not for all: a problem has as many as there are solvers.
    """
    first = np.empty(count, dtype=np.int64)
    first[fingerprint[::-1]] = np.arange(len(fingerprint))[::-1]  # of equal places the last one written stays
    problem = np.asarray(table["problem"], dtype=object)
    others = np.flatnonzero(problem != problem[first][fingerprint])
    named = table[["problem", "fingerprint", "address"]].iloc[np.concatenate((first, others))]
    return problem_names(named).iloc[:count]


def times(table: pd.DataFrame) -> pd.DataFrame:
    """Return times [s] of a group, problems × labels; ∞ where a pair is not solved or was not planned."""
    return spread(table, np.where(solved(table), charged(table), math.inf), math.inf)


def lost(table: pd.DataFrame) -> pd.DataFrame:
    """Return of which pairs of a group a conversion lost the answer, problems × labels: no number of the solver has
    them, since the conversion is charged.
    """
    return spread(table, (table["status"] == str(Status.LOST)).to_numpy(dtype=bool), False)


def label_kinds(table: pd.DataFrame) -> dict[str, str]:
    """Return the weakest promise among the routes a label took; '' when none was taken.

    >>> label_kinds(pd.DataFrame({"label": ["l", "l", "m"], "kind": ["equivalent", "approximate", ""]}))
    {'l': 'approximate', 'm': ''}
    """
    ranks = {str(kind): kind.rank for kind in Kind}
    result: dict[str, str] = {}
    taken = table[["label", "kind"]].drop_duplicates()
    for label, kind in sorted(zip(taken["label"], taken["kind"], strict=True)):
        if ranks.get(kind, -1) >= ranks.get(result.get(label, ""), -1):
            result[label] = kind if kind in ranks else ""
    return result


def exact(table: pd.DataFrame) -> pd.Series[bool]:
    """Return whether a row's route promises that every answer of the converted problem is an answer."""
    return ~table["kind"].isin([str(kind) for kind in Kind if not kind.exact])
