"""The table of results: one row a planned pair, and what every other analysis asks of it.

A table is a pandas DataFrame with (at least) the columns below; rows may come in any order. A *group* is what can
be compared: the rows of one formulation in one set of a plan, by one measure at one tolerance, with one start and
number of threads. Within a group a pair is
known by its fingerprint (the problem's mathematics) and its label (solver, options, route request).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import pandas as pd

from cpbench.errors import StoreError
from cpbench.formulations.base import Kind
from cpbench.verification import VERIFIED, Status

TEXT = (
    "key", "problem", "address", "fingerprint", "node", "family", "sizes", "solver", "label", "request", "options",
    "start", "set", "measure", "sequence", "status", "route", "kind", "claim", "flags", "message", "parts", "counters",
    "version", "samples", "started", "host", "origin", "finished",
)  # fmt: skip
NUMBERS = (
    "tolerance", "threads", "seconds", "memory", "repeats_asked", "step", "error", "target_error", "load", "convert",
    "setup", "solve", "lift", "verify", "wall", "cpu", "peak", "repeats", "solve_min", "solve_iqr", "signal", "code",
    "jobs", "attempts", "loadavg", "reported",
)  # fmt: skip
NO_ANSWER = "no answer in the folder"
"""Message of an imported row whose problem nobody answered."""
STATUSES = tuple(str(s) for s in Status)
"""Every status, from the best outcome to the least informative: the order of all tables."""
CHARGED = ("convert", "setup", "solve", "lift")
"""What a solver's time is made of. Reading the file and judging the answer are nobody's merit or fault."""


@dataclass(frozen=True, order=True)
class Group:
    """What the rows of a group have in common."""

    node: str
    tolerance: float
    start: str
    threads: int
    set: str = ""
    measure: str = ""


def normalised(table: pd.DataFrame) -> pd.DataFrame:
    """A copy with every column present, text never missing, numbers numeric, error and rows in a fixed order.

    >>> normalised(pd.DataFrame({"problem": ["b", "a"], "status": ["solved", None]}))["status"].tolist()
    ['not_run', 'solved']
    """
    clean = table.reindex(columns=[*table.columns, *(c for c in (*TEXT, *NUMBERS) if c not in table.columns)])
    for column in TEXT:
        clean[column] = clean[column].astype(object).where(clean[column].notna(), "").astype(str)
    for column in NUMBERS:
        clean[column] = pd.to_numeric(clean[column]).astype(float)
    clean["status"] = clean["status"].replace("", str(Status.NOT_RUN))
    clean["error"] = clean["error"].fillna(math.inf)
    clean["fingerprint"] = clean["fingerprint"].where(clean["fingerprint"] != "", clean["problem"])
    return clean.sort_values(["problem", "fingerprint", "label", "key"], kind="stable", ignore_index=True)


def solved(table: pd.DataFrame) -> pd.Series[bool]:
    """Whether the answer of each row was measured to meet the tolerance, whatever the solver said."""
    return table["status"].isin(VERIFIED)


def with_time(table: pd.DataFrame) -> pd.DataFrame:
    """The table with a column `time` [s]: convert + setup + solve + lift, ∞ unless the row is solved.

    A claimed answer that is not one has no time, however fast it came; nor has a row whose solve was not timed.

    >>> rows = pd.DataFrame({"status": ["solved", "wrong"], "convert": [0.5, 0.0], "setup": [0.0, 0.0],
    ...                      "solve": [1.0, 1e-3], "lift": [float("nan"), 0.0]})
    >>> with_time(rows)["time"].tolist()
    [1.5, inf]
    """
    spent = table[list(CHARGED)].apply(pd.to_numeric)
    total = spent.fillna(0.0).sum(axis=1).where(spent["solve"].notna(), math.inf)
    return table.assign(time=total.where(solved(table), math.inf).astype(float))


def ranked(table: pd.DataFrame) -> pd.Series[bool]:
    """Whether the times of each row may be compared: those of answers made elsewhere only where the column `ranked`
    says so.

    >>> ranked(pd.DataFrame({"origin": ["", "another machine"]})).tolist()
    [True, False]
    """
    return table["ranked"].astype(bool) if "ranked" in table else table["origin"] == ""


def groups(table: pd.DataFrame) -> list[tuple[Group, pd.DataFrame]]:
    """The comparable parts of a table, in order of formulation, tolerance, start, threads, set, measure."""
    parts = table.groupby(["node", "tolerance", "start", "threads", "set", "measure"], dropna=False, sort=True)
    return [
        (Group(str(n), float(t), str(s), int(k), str(part), str(m)), rows)
        for (n, t, s, k, part, m), rows in parts  # type: ignore[misc]
    ]


def limit(table: pd.DataFrame) -> float:
    """The longest a solve of these rows could take [s]; ∞ where none is known."""
    known = table["seconds"].dropna()
    return float(known.max()) if len(known) else math.inf


def problem_names(table: pd.DataFrame) -> pd.Series[str]:
    """Name of each row's problem; with its address where two different problems share a name.

    >>> rows = pd.DataFrame({"problem": ["a", "a", "b"], "fingerprint": ["1", "2", "3"], "address": ["x", "y", "z"]})
    >>> problem_names(rows).tolist()
    ['a (x)', 'a (y)', 'b']
    """
    shared = table.groupby("problem")["fingerprint"].transform("nunique") > 1
    return table["problem"].where(~shared, table["problem"] + " (" + table["address"] + ")")


def pivot(table: pd.DataFrame, column: str, missing: Any) -> pd.DataFrame:
    """One column of a group as problems (fingerprints, in order of name) × labels; `missing` where no row is.

    Raises StoreError when a pair has two rows.
    """
    twice = table.duplicated(["fingerprint", "label"])
    if twice.any():
        row = table[twice].iloc[0]
        raise StoreError(f"{row['problem']}, {row['label']}: two rows in one group; analyse each setting apart")
    names = pd.Series(problem_names(table).to_numpy(), index=table["fingerprint"])
    order = sorted(set(table["fingerprint"]), key=lambda f: (str(names[[f]].iloc[0]), f))
    wide = table.pivot(index="fingerprint", columns="label", values=column)
    wide = wide.reindex(index=order, columns=sorted(wide.columns))
    return wide.astype(object).where(wide.notna(), missing) if isinstance(missing, str) else wide.fillna(missing)


def times(table: pd.DataFrame) -> pd.DataFrame:
    """Times [s] of a group, problems × labels; ∞ where a pair is not solved or was not planned."""
    return pivot(with_time(table), "time", math.inf).astype(float)


def label_kinds(table: pd.DataFrame) -> dict[str, str]:
    """The weakest promise among the routes a label took; '' when none was taken.

    >>> label_kinds(pd.DataFrame({"label": ["l", "l", "m"], "kind": ["equivalent", "approximate", ""]}))
    {'l': 'approximate', 'm': ''}
    """
    ranks = {str(kind): kind.rank for kind in Kind}
    found: dict[str, str] = {}
    for label, kind in sorted(zip(table["label"], table["kind"], strict=True)):
        if ranks.get(kind, -1) >= ranks.get(found.get(label, ""), -1):
            found[label] = kind if kind in ranks else ""
    return found


def exact(table: pd.DataFrame) -> pd.Series[bool]:
    """Whether a row's route promises that every answer of the converted problem is an answer."""
    return ~table["kind"].isin([str(kind) for kind in Kind if not kind.exact])
