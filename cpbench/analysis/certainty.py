"""How certain answers are: levels of their certificates by solver, and what is known of each problem's solution."""

from __future__ import annotations

import pandas as pd

from cpbench.analysis import table as rows_of
from cpbench.verification import FALSE_CLAIMS

LEVELS = ("proved", "enclosed", "stationary", "distant", "measured", "refuted")
"""Levels of certificates, the most certain that there is a solution first."""
KNOWN = LEVELS[:4]
"""Levels of answers to problems of which a solution is known."""
READ = (
    "problem", "fingerprint", "node", "label", "measure", "status", "error", "certainty", "certificate", "distance",
)  # fmt: skip
"""Columns that are looked at."""
FAR = 1e-2
"""Distance from the proved solution from which an answer that passes is listed, and from the only one from which a
claim is disproved."""


def sought(table: pd.DataFrame) -> pd.DataFrame:
    """Return the rows for whose answers a certificate was sought."""
    return table.loc[table["certainty"].isin(LEVELS), list(READ)]


def by_label(table: pd.DataFrame) -> pd.DataFrame:
    """Count levels and distances of verified answers, and what became of the false claims, a row a label.

    Columns: `verified`, each of LEVELS among them, `median` and `largest` distance of those that are proved or enclosed
    (NaN without), `false` claims and how many of these are `disproved`: refuted, or far from the only solution.
    """
    rows = sought(table)
    met, lies = rows_of.met(rows), rows["status"].isin(FALSE_CLAIMS)
    facts = {"verified": met, **{level: met & (rows["certainty"] == level) for level in LEVELS}}
    distance = rows["distance"].where(met).groupby(rows["label"])
    facts |= {"false": lies, "disproved": lies & disproved(rows)}
    counts = pd.DataFrame(facts).astype(int).groupby(rows["label"]).sum()
    for offset, (name, values) in enumerate({"median": distance.median(), "largest": distance.max()}.items()):
        counts.insert(1 + len(LEVELS) + offset, name, values)
    return counts.reset_index()


def disproved(table: pd.DataFrame) -> pd.Series:
    """Return whether a proof says that no solution is where the answer is, because all are elsewhere or there is none,
    or the answer has numbers that are not finite."""
    none = (table["certainty"] == "refuted") | table["certificate"].str.contains("there is no solution|is not finite")
    return none | refuted(table)


def refuted(table: pd.DataFrame) -> pd.Series[bool]:
    """Return whether a certificate refutes each answer: there is no solution, or the only ones are farther than FAR.

    The first counts where a solution is known: the rounding of a file may leave its exact numbers none, and then
    refutes every answer. A table without certificates has no such row.
    """
    if not {"certainty", "certificate", "distance"} <= set(table):
        return pd.Series(False, index=table.index)
    only = table["certificate"].str.contains("unique|all listed")
    solvable = table["fingerprint"].isin(table.loc[table["certainty"].isin(KNOWN), "fingerprint"])
    return ((table["certainty"] == "refuted") & solvable) | (only & (table["distance"] >= FAR))


def by_problem(table: pd.DataFrame) -> pd.DataFrame:
    """Return the best level that is known of each problem's answers, a row a problem, with one reason where it is not
    proved: columns `problem`, `node`, `level`, `reason`."""
    rows = sought(table)
    order = rows.assign(rank=rows["certainty"].map(LEVELS.index)).sort_values("rank", kind="stable")
    best = order.groupby(["node", "problem"], sort=True).first().reset_index()
    return best.rename(columns={"certainty": "level", "certificate": "reason"})[["problem", "node", "level", "reason"]]


def far(table: pd.DataFrame) -> pd.DataFrame:
    """Return accepted answers that are at least FAR from the solution that is known, the farthest first."""
    rows = sought(table)
    return rows[rows_of.met(rows) & (rows["distance"] >= FAR)].sort_values("distance", ascending=False, kind="stable")
