"""Solvers that could not run here, and those whose figures may not be published."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from typing import Any

import pandas as pd

from cpbench.foundation.text import counted, some_of
from cpbench.verification import REFUSED, Status

LACK = {"missing": "not installed", "licence": "no licence"}
"""Words for solvers that a run left out, by the status of the entry."""
_ROUTE = re.compile(r"^no \w+ route from \w+ to \w+: ")
"""How a reason begins that says of one node what its line says of the solvers."""
NAMED, FEW = 6, 2
"""The most solvers that a line on them names, and where a reason follows."""


def absences(table: pd.DataFrame) -> dict[tuple[str, str], dict[str, int]]:
    """Return how many pairs each reason cost which solver, by state (missing, broken, licence) and message.

    >>> rows = pd.DataFrame({"solver": ["a", "a", "b"], "status": ["unavailable"] * 3,
    ...                      "message": ["missing: pip install g"] * 3})
    >>> absences(rows)
    {('missing', 'pip install g'): {'a': 2, 'b': 1}}
    """
    absent = table.loc[table["status"] == str(Status.UNAVAILABLE), ["message", "solver"]]
    counts: dict[tuple[str, str], dict[str, int]] = {}
    for (message, solver), count in absent.value_counts().sort_index().items():  # type: ignore[misc]
        state, _, detail = message.partition(": ")
        counts.setdefault((state, detail), {})[solver] = int(count)
    return counts


def participating(group: pd.DataFrame) -> pd.DataFrame:
    """Return a group's rows without the labels that were unavailable for all their pairs: they measure no problem.

    The number of problems does not depend on which solvers are installed: where a problem would be left without a
    row, all rows stay.
    """
    available = group["label"][group["status"] != str(Status.UNAVAILABLE)].unique()
    present = group["label"].isin(available)
    prints = group["fingerprint"]
    if present.all() or prints[present].nunique() < prints.nunique():
        return group
    return group[present]


def restricted(table: pd.DataFrame, metadata: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    """Return the restriction on publishing, by name, of the solvers that have one and were started on some pair.

    `metadata` : what the results say of each label, with `name` and `publishing`.
    """
    terms = {str(one.get("name", "")): str(one.get("publishing") or "") for one in metadata.values()}
    started = table.loc[~table["status"].isin(REFUSED), "solver"].unique()
    return {name: terms[name] for name in sorted(started) if terms.get(name)}


def without(table: pd.DataFrame, solvers: Collection[str]) -> pd.DataFrame:
    """Return the rows of all other solvers."""
    return table[~table["solver"].isin(list(solvers))].reset_index(drop=True)


def lacking_lines(entries: Iterable[Mapping[str, Any]]) -> list[str]:
    """Write a line for each way to install what a run left out, and for each licence.

    `entries` are `left_out` of the facts of its results.
    """
    return [
        f"{LACK[entry['status']]}: {some_of(sorted(entry['solvers']), NAMED)} ({entry['reason']})"
        for entry in entries
        if entry["status"] in LACK
    ]


def unreached_lines(entries: Iterable[Mapping[str, Any]]) -> list[str]:
    """Write a line for each formulation from which no route led to some solvers, with the most frequent reason."""
    by_node = _unreached(entries)
    notes: list[str] = []
    for node, reasons in by_node.items():
        solvers = {name: 0 for entry in reasons for name in entry["solvers"]}
        most = max(reasons, key=lambda entry: len(entry["keys"]))
        pairs = counted(_pairs(reasons), "pair")
        notes.append(
            f"no route from {node} to {some_of(sorted(solvers), FEW)}, {pairs}: {_ROUTE.sub('', most['reason'])}"
        )
    return notes


def unreached_summary(entries: Iterable[Mapping[str, Any]]) -> str:
    """Write in one line how many pairs had no route, by formulation."""
    by_node = {node: _pairs(reasons) for node, reasons in _unreached(entries).items()}
    parts = ", ".join(f"{node} {count}" for node, count in by_node.items())
    pairs = counted(sum(by_node.values()), "pair")
    return f"skipped, because no conversion leads to what the solver accepts: {pairs} ({parts})"


def _unreached(entries: Iterable[Mapping[str, Any]]) -> dict[str, list[Mapping[str, Any]]]:
    """Return the entries without a route by formulation, in their order."""
    by_node: dict[str, list[Mapping[str, Any]]] = {}
    for entry in entries:
        if entry["status"] == Status.UNSUPPORTED:
            by_node.setdefault(entry["node"], []).append(entry)
    return by_node


def _pairs(entries: Iterable[Mapping[str, Any]]) -> int:
    return sum(len(entry["keys"]) for entry in entries)
