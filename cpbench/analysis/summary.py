"""Counts, claims, means and failures of a group of results.

Every mean comes with what it was taken over: failures are charged a penalty, never dropped, and the number solved
stands beside it.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from cpbench.analysis import table as rows_of
from cpbench.analysis.profiles import FLOOR, ratios
from cpbench.verification import Status

CLAIMED = "solved"
"""The claim that is compared with the verdict."""
JUDGED = tuple(
    str(s)
    for s in (
        Status.SOLVED,
        Status.STATIONARY,
        Status.INACCURATE,
        Status.WRONG,
        Status.INFEASIBLE,
        Status.FAILED,
        Status.MAX_ITER,
    )
)
"""Statuses of a solver that came back within its limits, so that its claim and the verdict can be compared."""
REFUSED = (str(Status.UNSUPPORTED), str(Status.UNAVAILABLE), str(Status.NOT_RUN))
"""Statuses of pairs in which the solver never started."""


def virtual_best(times: pd.DataFrame) -> pd.Series[float]:
    """The least time [s] on each problem, ∞ where nobody solved it.

    >>> virtual_best(pd.DataFrame({"a": [1.0, math.inf], "b": [2.0, math.inf]})).tolist()
    [1.0, inf]
    """
    return times.fillna(math.inf).min(axis=1)


def fastest(times: pd.DataFrame, floor: float = FLOOR) -> pd.DataFrame:
    """Whether a label shares the lead on a problem, problems × labels."""
    return ratios(times, floor) <= 1.0


def default_shift(times: pd.DataFrame) -> float:
    """Median [s] of all finite times, 0 when there is none: the shift that suits these data.

    >>> default_shift(pd.DataFrame({"a": [1.0, 3.0], "b": [2.0, math.inf]}))
    2.0
    """
    finite = times.to_numpy(dtype=float)
    finite = finite[np.isfinite(finite)]
    return float(np.median(finite)) if finite.size else 0.0


def shifted_geometric_mean(seconds: Sequence[float], shift: float, penalty: float) -> float:
    """exp(mean log(t + shift)) − shift of times [s], each failure (∞, NaN) charged `penalty` [s].

    A shift far above the times makes this the arithmetic mean, which one failure decides; hence the median of the
    data as the default of the callers. NaN of nothing.

    >>> shifted_geometric_mean([1.0, 4.0], shift=0.0, penalty=10.0)
    2.0
    >>> round(shifted_geometric_mean([1.0, math.inf], shift=1.0, penalty=7.0), 12)
    3.0
    """
    charged = np.array(seconds, dtype=float)
    if charged.size == 0:
        return math.nan
    charged[~np.isfinite(charged)] = penalty
    with np.errstate(divide="ignore"):
        return float(np.exp(np.mean(np.log(charged + shift))) - shift)


def means(times: pd.DataFrame, shift: float, penalty: float) -> pd.Series[float]:
    """Shifted geometric mean [s] of each label over all problems of the table."""
    return pd.Series(
        {str(label): shifted_geometric_mean(list(times[label]), shift, penalty) for label in sorted(times.columns)},
        dtype=float,
    )


def order_by_mean(times: pd.DataFrame, shift: float, penalty: float) -> dict[float, list[str]]:
    """Labels from the least mean to the largest at a tenth of the shift, the shift and ten times the shift [s].

    When the three orders differ, the shift decides and not the solvers.
    """
    found: dict[float, list[str]] = {}
    for s in (shift / 10, shift, shift * 10):
        mean = means(times, s, penalty)
        found[s] = sorted(mean.index, key=lambda label: (mean[label], label))
    return found


def solve_counts(group: pd.DataFrame, penalty: float, shift: float | None = None, floor: float = FLOOR) -> pd.DataFrame:
    """One row a label, best first: what it solved and how fast.

    Labels whose answers were made elsewhere (`table.ranked`) are not ranked: fastest is 0, slowdown and mean are NaN.

    Columns: kind (weakest route), ranked, planned, solved (stationary included), stationary, false (claimed and is not,
    on the solver's own problem), fastest (problems where it shares the lead), median [s] and slowdown (median ratio to
    the virtual best) over what it solved, mean [s] (shifted geometric over all problems of the group, failures and
    problems that were not planned charged `penalty`).
    """
    every = rows_of.times(group)
    times = rows_of.times(group[rows_of.ranked(group)])
    shift = default_shift(times) if shift is None else shift
    lead, ratio, mean = fastest(times, floor), ratios(times, floor), means(times, shift, penalty)
    kinds = rows_of.label_kinds(group)
    untrue = false_claims(group)
    records: list[dict[str, object]] = []
    for label in every.columns:
        rows = group[group["label"] == label]
        own = every[label][np.isfinite(every[label])]
        among = label in times.columns
        records.append(
            {
                "label": label,
                "kind": kinds[label],
                "ranked": among,
                "planned": len(rows),
                "solved": int(rows_of.solved(rows).sum()),
                "stationary": int((rows["status"] == str(Status.STATIONARY)).sum()),
                "false": int((untrue["label"] == label).sum()),
                "fastest": int(lead[label].sum()) if among else 0,
                "median": float(own.median()) if len(own) else math.nan,
                "slowdown": float(ratio.loc[own.index, label].median()) if among and len(own) else math.nan,
                "mean": float(mean[label]) if among else math.nan,
            }
        )
    columns = ["label", "kind", "ranked", "planned", "solved", "stationary", "false", "fastest", "median"]
    columns += ["slowdown", "mean"]
    found = pd.DataFrame(records, columns=columns)
    found["_less"] = -found["solved"]
    return found.sort_values(["_less", "mean", "label"], ignore_index=True).drop(columns="_less")


def verdicts(group: pd.DataFrame) -> pd.DataFrame:
    """Rows by label (sorted) and status (those that occur, in the order of Status).

    >>> rows = pd.DataFrame({"label": ["b", "a", "b"], "status": ["wrong", "solved", "solved"]})
    >>> verdicts(rows).to_dict("index")
    {'a': {'solved': 1, 'wrong': 0}, 'b': {'solved': 1, 'wrong': 1}}
    """
    counts = group.groupby(["label", "status"]).size()
    labels = sorted(set(group["label"]))
    present = [s for s in rows_of.STATUSES if (group["status"] == s).any()]
    return pd.DataFrame(
        {s: [int(counts.get((label, s), 0)) for label in labels] for s in present}, index=pd.Index(labels, name="label")
    )


def claims(group: pd.DataFrame) -> pd.DataFrame:
    """Claim against verdict, one row a label, of the pairs where the solver came back within its limits.

    Rows that were read off a history have no claim, and are left out.

    Columns: true (claimed solved, is), false (claimed, is not), modest (not claimed, is), honest (neither),
    correct (fraction of claims that hold, NaN without claims).

    >>> rows = pd.DataFrame({"label": ["a"] * 4, "status": ["solved", "wrong", "solved", "failed"],
    ...                      "claim": ["solved", "solved", "max_iter", "failed"]})
    >>> claims(rows).loc["a"].tolist()
    [1.0, 1.0, 1.0, 1.0, 0.5]
    """
    judged = group[group["status"].isin(JUDGED) & (group["claim"] != "")]
    said, done = judged["claim"] == CLAIMED, rows_of.solved(judged)
    labels = sorted(set(group["label"]))

    def count(which: pd.Series[bool]) -> list[int]:
        return [int((which & (judged["label"] == label)).sum()) for label in labels]

    found = pd.DataFrame(
        {
            "true": count(said & done),
            "false": count(said & ~done),
            "modest": count(~said & done),
            "honest": count(~said & ~done),
        },
        index=pd.Index(labels, name="label"),
    )
    made = found["true"] + found["false"]
    return found.assign(correct=(found["true"] / made.where(made > 0)).astype(float))


def false_claims(table: pd.DataFrame) -> pd.DataFrame:
    """Rows whose solver claims to have solved the problem it was given, and the judged error says otherwise.

    On a route that promises less than an answer the error on the solver's own problem says it; where that was not
    measured (a solver that drops a term by itself) nobody is accused.
    """
    wrong = np.where(rows_of.exact(table), ~rows_of.solved(table), table["target_error"] > table["tolerance"])
    return table[(table["claim"] == CLAIMED) & table["status"].isin(JUDGED) & wrong]


def inexact_routes(table: pd.DataFrame) -> pd.DataFrame:
    """The routes that promise less than an answer, one row a (label, kind).

    Columns: pairs, solved (on the problem that was asked), missed (within the tolerance on the solver's own problem,
    or claimed to be where that was not measured, and not on the asked one),
    median and largest finite error on the asked problem (NaN without any).
    """
    inexact = table[~rows_of.exact(table)]
    unmeasured, there = inexact["target_error"].isna(), inexact["target_error"] <= inexact["tolerance"]
    done = there | (unmeasured & (inexact["claim"] == CLAIMED) & inexact["status"].isin(JUDGED))
    missed = inexact[done & ~rows_of.solved(inexact)].index
    records: list[dict[str, object]] = []
    for (label, kind), rows in inexact.groupby(["label", "kind"], sort=True):  # type: ignore[misc]
        finite = rows.loc[np.isfinite(rows["error"]), "error"]
        records.append(
            {
                "label": str(label),
                "kind": str(kind),
                "pairs": len(rows),
                "solved": int(rows_of.solved(rows).sum()),
                "missed": int(rows.index.isin(missed).sum()),
                "median": float(finite.median()) if len(finite) else math.nan,
                "largest": float(finite.max()) if len(finite) else math.nan,
            }
        )
    return pd.DataFrame(records, columns=["label", "kind", "pairs", "solved", "missed", "median", "largest"])


def flagged(table: pd.DataFrame, flag: str) -> pd.DataFrame:
    """Rows that carry a flag (`direction`, `scale`, ...).

    >>> flagged(pd.DataFrame({"flags": ["scale,direction", "", "redirection"]}), "direction").index.tolist()
    [0]
    """
    return table[[flag in flags.split(",") for flags in table["flags"]]]


def nodes(table: pd.DataFrame) -> pd.DataFrame:
    """One row a group: problems, labels, pairs, solved by some label, by none, and the labels that solve most."""
    records: list[dict[str, object]] = []
    for group, rows in rows_of.groups(table):
        reached = rows[rows_of.solved(rows)]
        count = reached.groupby("label")["fingerprint"].nunique()
        most = int(count.max()) if len(count) else 0
        problems = rows["fingerprint"].nunique()
        some = reached["fingerprint"].nunique()
        records.append(
            {
                "group": group,
                "problems": problems,
                "labels": rows["label"].nunique(),
                "pairs": len(rows),
                "some": some,
                "none": problems - some,
                "most": most,
                "best": sorted(str(label) for label in count.index[count == most]) if most else [],
            }
        )
    columns = ["group", "problems", "labels", "pairs", "some", "none", "most", "best"]
    return pd.DataFrame(records, columns=columns)


def families(group: pd.DataFrame) -> pd.DataFrame:
    """One row a family: problems, solved by some label, pairs, solved pairs, most solved by one label, which.

    Problems of one family resemble each other: a suite's total says what its largest family says.
    """
    records: list[dict[str, object]] = []
    for family, rows in group.groupby("family", sort=True):
        reached = rows[rows_of.solved(rows)]
        count = reached.groupby("label")["fingerprint"].nunique()
        most = int(count.max()) if len(count) else 0
        records.append(
            {
                "family": str(family),
                "problems": rows["fingerprint"].nunique(),
                "some": reached["fingerprint"].nunique(),
                "pairs": len(rows),
                "solved": len(reached),
                "most": most,
                "best": sorted(str(label) for label in count.index[count == most]) if most else [],
            }
        )
    return pd.DataFrame(records, columns=["family", "problems", "some", "pairs", "solved", "most", "best"])


def size_ranges(group: pd.DataFrame) -> dict[str, tuple[int, int]]:
    """Least and largest value of each dimension of the problems of a group.

    >>> size_ranges(pd.DataFrame({"sizes": ['{"n": 3}', '{"n": 7, "m": 1}']}))
    {'m': (1, 1), 'n': (3, 7)}
    """
    found: dict[str, list[int]] = {}
    for text in set(group["sizes"]):
        for symbol, size in (json.loads(text) if text else {}).items():
            found.setdefault(symbol, []).append(int(size))
    return {symbol: (min(values), max(values)) for symbol, values in sorted(found.items())}


def unsolved(group: pd.DataFrame) -> pd.DataFrame:
    """Problems that no label solves: one row each, with the least error anyone reached and by whom."""
    names = rows_of.problem_names(group)
    done = set(group.loc[rows_of.solved(group), "fingerprint"])
    open_rows = group.assign(name=names)[~group["fingerprint"].isin(done)]
    closest = open_rows.sort_values(["name", "fingerprint", "error", "label"]).drop_duplicates("fingerprint")
    certified = open_rows.loc[open_rows["status"] == str(Status.INFEASIBLE), "fingerprint"]
    closest = closest.assign(infeasible=closest["fingerprint"].isin(set(certified)))
    return closest[["name", "address", "error", "label", "infeasible"]].reset_index(drop=True)


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
    """Unsolved rows by status and reason, in order of status, then the most frequent first.

    With `refused`, the pairs in which no solver started (unsupported, unavailable, not run) instead.
    """
    never = table["status"].isin(REFUSED)
    chosen = table[(never if refused else ~never) & ~rows_of.solved(table)]
    kinds = chosen["kind"].where(~rows_of.exact(chosen), "")
    collected: dict[tuple[str, str, str], list[int]] = {}
    for at, (status, kind, message) in enumerate(zip(chosen["status"], kinds, chosen["message"], strict=True)):
        collected.setdefault((status, kind, _pattern(message)), []).append(at)
    found: list[Reason] = []
    for (status, kind, _), places in collected.items():
        rows = chosen.iloc[places].sort_values(["problem", "label"], kind="stable")
        labels = {str(label): int(count) for label, count in sorted(rows["label"].value_counts().items())}
        found.append(Reason(status, kind, str(rows.iloc[0]["message"]), labels, rows.iloc[0]))
    order = rows_of.STATUSES.index
    return sorted(found, key=lambda r: (order(r.status), r.kind, -r.count, r.message, tuple(r.labels)))


def _pattern(message: str) -> str:
    """A message without its numbers and quoted names, so that the same cause is listed once."""
    return re.sub(r"[-+]?\d[\d.]*(?:e[-+]?\d+)?", "#", re.sub(r"'[^']*'", "'…'", message))
