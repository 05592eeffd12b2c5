"""Failures and their reasons: the hardest problems, failures by reason, rows that carry a flag."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from cpbench.analysis import table as rows_of
from cpbench.analysis.participation import REFUSED
from cpbench.verification import PROVEN


@dataclass(frozen=True)
class Reason:
    """Failures of one status whose messages differ in numbers and names only.

    Attributes
    ----------
    kind : '' on exact routes, else what the route promises. message : that of the example.
    labels : how many each label contributes. example : one of the rows (the first by problem and label).
    """

    status: str
    kind: str
    message: str
    labels: Mapping[str, int]
    example: pd.Series

    @property
    def count(self) -> int:
        return sum(self.labels.values())


def failures(table: pd.DataFrame, *, refused: bool = False) -> list[Reason]:
    """Return unsolved rows by status and reason, in order of status, then the most frequent first.

    With `refused`, the pairs in which no solver started (unsupported, unavailable, not run) instead.
    """
    never = table["status"].isin(REFUSED)
    at = np.flatnonzero((never if refused else ~never) & ~rows_of.met(table))
    if not len(at):
        return []
    chosen = table[["problem", "label", "status", "kind", "message"]].iloc[at]
    patterns = {message: _pattern(message) for message in chosen["message"].unique()}
    chosen = chosen.assign(
        at=at, kind=chosen["kind"].where(~rows_of.exact(chosen), ""), cause=chosen["message"].map(patterns)
    ).sort_values(["problem", "label"], kind="stable")
    reasons: list[Reason] = []
    for (status, kind, _), rows in chosen.groupby(["status", "kind", "cause"], sort=False):  # type: ignore[misc]
        labels = {str(label): int(count) for label, count in rows["label"].value_counts().sort_index().items()}
        example = table.iloc[rows["at"].iloc[0]]
        reasons.append(Reason(str(status), str(kind), str(example["message"]), labels, example))
    order = rows_of.STATUSES.index
    return sorted(reasons, key=lambda r: (order(r.status), r.kind, -r.count, r.message, tuple(r.labels)))


def hardest(table: pd.DataFrame, share: float = 0.25) -> pd.DataFrame:
    """Return the problems of which at most this share of the started pairs was solved, the hardest first; those that
    are proved to have no solution are left out.

    Columns: name, node, family, sizes, address; solved, started (pairs), and the least error with its label.

    >>> rows = {"problem": ["p", "p", "q"], "label": ["a", "b", "a"], "status": ["failed", "wrong", "solved"],
    ...         "error": [9.0, 0.5, 0.0]}
    >>> hardest(rows_of.normalised(pd.DataFrame(rows)))[["name", "solved", "started", "label"]].values.tolist()
    [['p', 0, 2, 'b']]
    """
    columns = ["problem", "node", "fingerprint", "family", "sizes", "address", "status", "error", "label"]
    started = table.loc[~table["status"].isin(REFUSED), columns]
    key = [started["node"], started["fingerprint"]]
    solved = rows_of.solved(started).groupby(key, sort=False)
    proved = started["status"].isin(PROVEN).groupby(key, sort=False).any()
    count = pd.DataFrame({"solved": solved.sum(), "started": solved.size()})
    count = count[(count["solved"] <= share * count["started"]) & ~(proved & (count["solved"] == 0))]
    named = started.assign(name=rows_of.problem_names(started)).sort_values(["error", "label"], kind="stable")
    closest = named.drop_duplicates(["node", "fingerprint"])
    problems = closest.merge(count.reset_index(), on=["node", "fingerprint"])
    order = problems.assign(share=problems["solved"] / problems["started"], pairs=-problems["started"])
    return order.sort_values(["share", "pairs", "node", "name"], ignore_index=True)


def flagged(table: pd.DataFrame, flag: str) -> pd.DataFrame:
    """Return rows that carry a flag (`direction`, `scale`, ...).

    >>> flagged(pd.DataFrame({"flags": ["scale,direction", "", "redirection"]}), "direction").index.tolist()
    [0]
    """
    carrying = {flags for flags in table["flags"].unique() if flag in flags.split(",")}
    return table[table["flags"].isin(carrying)]


def _pattern(message: str) -> str:
    """Strip a message of its numbers and quoted names, so that the same cause is listed once."""
    return re.sub(r"[-+]?\d[\d.]*(?:e[-+]?\d+)?", "#", re.sub(r"'[^']*'", "'…'", message))
