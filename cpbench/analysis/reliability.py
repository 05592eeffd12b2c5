"""Claims against verdicts: how far a solver's word can be taken.

What a solver says of its answer is the claim, what was measured of it the verdict. A solver speaks of the problem that
it was given: what it solved there is solved here, whatever became of the answer on the way back. A claim that there is
no solution is false beside a verified answer (`table.contradicted`).
"""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

from cpbench.analysis import table as rows_of
from cpbench.verification import CHARGED_TO_ROUTE, FALSE_CLAIMS, MET_TOLERANCE, PROVEN, REFUSED, Status

CLAIMED = "solved"
"""The claim that is compared with the verdict."""
JUDGED = tuple(str(s) for s in Status if s not in (*REFUSED, Status.TIMEOUT, Status.MEMOUT, Status.CRASH, Status.ERROR))
"""Statuses of a solver that came back within its limits, so that its claim and the verdict can be compared."""

NEAR = 2.0
"""A claim of a solution is near where the error is within this factor of the tolerance."""

MET = (*MET_TOLERANCE, *CHARGED_TO_ROUTE)
"""Statuses of an answer that solves what the solver was given."""


def false_claims(table: pd.DataFrame) -> pd.DataFrame:
    """Return rows whose solver claims to have solved the problem it was given, against the error that was judged
    there, or that there is no solution, beside a verified answer.

    Older files call a row of a route that promises less than an answer wrong also where the solver met its target.
    """
    missed = rows_of.exact(table) | (table["target_error"] > target_tolerance(table))
    lies = (table["claim"] == CLAIMED) & table["status"].isin(FALSE_CLAIMS) & missed
    return table[lies | rows_of.contradicted(table)]


def near(table: pd.DataFrame) -> pd.Series[bool]:
    """Return whether the error of each row is within NEAR times the tolerance, and not within it, where its claim was
    judged: on the solver's own problem, or on the asked one where the solver was given that.

    >>> near(pd.DataFrame({"error": [1.2e-6, 3e-6, 1.2e-6], "tolerance": 1e-6, "target_tolerance": [math.nan, math.nan,
    ...                    1e-7], "target_error": [math.nan, math.nan, 1e-6]})).tolist()
    [True, False, False]
    """
    measured = table["target_error"].notna()
    factor = (table["target_error"] / target_tolerance(table)).where(measured, table["error"] / table["tolerance"])
    return (factor > 1.0) & (factor <= NEAR)


def claim_counts(group: pd.DataFrame) -> pd.DataFrame:
    """Count the claims of each label by what the verdicts say of them, one row a label (sorted).

    Columns: made (claims of a solution, or that there is none), confirmed (by the verdict on the solver's own problem,
    or by a proof), near (claims of a solution whose error is within NEAR times the tolerance), false (beyond that),
    nonexistence (claims that there is no solution, beside a verified answer), open (nothing decides: rounding does,
    nothing proves that there is no solution, or the solver's own problem is not known). made is the sum of the others.

    >>> rows = pd.DataFrame({"label": "a", "status": ["solved", "inaccurate", "wrong", "failed"], "kind": "equivalent",
    ...                      "claim": ["solved", "solved", "solved", "infeasible"], "error": [0.5, 1.5, 9.0, 9.0],
    ...                      "tolerance": 1.0, "target_error": math.nan, "target_tolerance": math.nan})
    >>> claim_counts(rows).loc["a"].tolist()
    [4, 1, 1, 1, 0, 1]
    """
    labels = sorted(str(label) for label in group["label"].unique())

    def count(of: pd.Series[bool]) -> pd.Series[int]:
        return group.loc[of, "label"].value_counts().reindex(labels, fill_value=0).astype(int)

    made = (group["claim"] == CLAIMED) | group["claim"].isin(PROVEN)
    denied = rows_of.contradicted(group)
    failing = pd.Series(group.index.isin(false_claims(group).index), index=group.index)
    unmeasured = (group["status"] == str(Status.APPROXIMATE)) & group["target_error"].isna()
    claimed = (group["claim"] == CLAIMED) & group["status"].isin(MET) & ~unmeasured
    parts = {
        "confirmed": count((claimed | (group["claim"] == group["status"])) & made & ~denied),
        "near": count(failing & ~denied & near(group)),
        "false": count(failing & ~denied & ~near(group)),
        "nonexistence": count(denied),
    }
    counts = pd.DataFrame({"made": count(made), **parts}, index=pd.Index(labels, name="label"))
    return counts.assign(open=counts["made"] - counts[list(parts)].sum(axis=1))


def unproved(table: pd.DataFrame) -> pd.DataFrame:
    """Return rows with a claim that there is no solution, neither proved nor contradicted by a verified answer."""
    failed = table["status"] == str(Status.FAILED)
    return table[table["claim"].isin(PROVEN) & failed & ~rows_of.contradicted(table)]


def target_tolerance(table: pd.DataFrame) -> pd.Series[float]:
    """Return the tolerance that each row's error on the solver's own problem is compared with; the row's own where
    none is known."""
    return table["target_tolerance"].fillna(table["tolerance"])


def losses(table: pd.DataFrame) -> pd.DataFrame:
    """Return the exact routes that lost answers which met their solver's target, one row a route, most first.

    Columns: route, lost (answers), factor (largest error on the asked problem over the error on the solver's own).

    >>> rows = pd.DataFrame({"route": "mlcp-lcp-schur", "status": ["lost", "lost", "solved"],
    ...                      "error": [1e-2, 1e-3, 1e-9], "target_error": [1e-6, 1e-8, 1e-9]})
    >>> losses(rows).round(2).values.tolist()
    [['mlcp-lcp-schur', 2, 100000.0]]
    """
    lost = table.loc[table["status"] == str(Status.LOST), ["route", "error", "target_error"]]
    factor = (lost["error"] / lost["target_error"]).where(lost["target_error"] > 0, math.inf)
    routes = lost.assign(factor=factor).groupby("route", sort=True)["factor"].agg(["size", "max"]).reset_index()
    routes = routes.set_axis(["route", "lost", "factor"], axis=1)
    return routes.sort_values(["lost", "route"], ascending=[False, True], ignore_index=True)


def inexact_routes(table: pd.DataFrame) -> pd.DataFrame:
    """Return the routes that promise less than an answer, one row a (label, kind).

    Columns: pairs, solved (on the problem that was asked), missed (within the tolerance on the solver's own problem,
    or claimed to be where that was not measured, and not on the asked one),
    median and largest finite error on the asked problem (NaN without any).
    """
    columns = ["label", "kind", "status", "claim", "error", "tolerance", "target_error", "target_tolerance"]
    inexact = table.loc[~rows_of.exact(table), columns]
    unmeasured, met = inexact["target_error"].isna(), inexact["target_error"] <= target_tolerance(inexact)
    done = met | (unmeasured & (inexact["claim"] == CLAIMED) & inexact["status"].isin(JUDGED))
    facts = {"pairs": True, "solved": rows_of.solved(inexact), "missed": done & ~rows_of.met(inexact)}
    keys = [inexact["label"], inexact["kind"]]
    counts = pd.DataFrame(facts, index=inexact.index).astype(int).groupby(keys, sort=True).sum()
    error = inexact["error"].where(np.isfinite(inexact["error"])).groupby(keys)
    return counts.assign(median=error.median(), largest=error.max()).reset_index()
