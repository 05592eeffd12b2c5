"""Who took part: solvers that could not run here, and those whose figures may not be published."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

import pandas as pd

from cpbench.verification import REFUSED, Status


@dataclass(frozen=True)
class Absence:
    """A reason why solvers could not run: its state (missing, broken, licence), what it said, and how many pairs of
    which solver it cost."""

    state: str
    detail: str
    solvers: Mapping[str, int]


def absences(table: pd.DataFrame) -> list[Absence]:
    """Why solvers could not run, each reason once, in order of state and text.

    >>> rows = pd.DataFrame({"solver": ["a", "a", "b"], "status": ["unavailable"] * 3,
    ...                      "message": ["missing: pip install g"] * 3})
    >>> absences(rows)
    [Absence(state='missing', detail='pip install g', solvers={'a': 2, 'b': 1})]
    """
    absent = table.loc[table["status"] == str(Status.UNAVAILABLE), ["solver", "message"]]
    found: dict[tuple[str, str], dict[str, int]] = {}
    for (solver, message), count in absent.value_counts().items():  # type: ignore[misc]
        state, _, detail = message.partition(": ")
        found.setdefault((state, detail), {})[solver] = int(count)
    return [Absence(*reason, dict(sorted(cost.items()))) for reason, cost in sorted(found.items())]


def attended(group: pd.DataFrame) -> pd.DataFrame:
    """A group's rows without the labels that were unavailable for all their pairs: they say nothing of any problem.

    The number of problems does not depend on who is installed: where a problem would be left without a row, all rows
    stay.
    """
    there = group["label"][group["status"] != str(Status.UNAVAILABLE)].unique()
    present = group["label"].isin(there)
    prints = group["fingerprint"]
    if present.all() or prints[present].nunique() < prints.nunique():
        return group
    return group[present]


def restricted(table: pd.DataFrame, sheets: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    """Restriction on publishing, by name, of the solvers that have one and were started on some pair.

    `sheets` : what the results say of each label, with `name` and `publishing`.
    """
    terms = {str(sheet.get("name", "")): str(sheet.get("publishing") or "") for sheet in sheets.values()}
    started = table.loc[~table["status"].isin(REFUSED), "solver"].unique()
    return {name: terms[name] for name in sorted(started) if terms.get(name)}


def without(table: pd.DataFrame, solvers: Collection[str]) -> pd.DataFrame:
    """The rows of all other solvers."""
    return table[~table["solver"].isin(list(solvers))].reset_index(drop=True)
