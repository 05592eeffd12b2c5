"""Expected time of a run of some of the problems, from the times of a run of all of them.

    expected(S) = START · solvers + factor · sum over p in S of cost(p)

cost(p) is the wall time of all pairs of p: every solver, repeats, conversion, judging. `factor` is what passed from the
first row of the results to the last over the sum of all costs: what the runner does between pairs, and the load of the
machine. Pauses, as of a run that was interrupted and resumed, do not count.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pandas as pd

from cpbench.analysis import table as rows_of
from cpbench.errors import StoreError
from cpbench.verification import Status

START = 0.5
"""Seconds for starting and warming up a solver's worker; 59 of them took 0.3 s each where this was written."""
ASSUMED = 1.2
"""The factor where the results do not tell it: rows too few or too short."""
PAUSE = 60.0
"""Seconds between two rows, beyond what the second took, from which on nobody was at work."""
LEAST = 1e-3
"""Seconds that a problem costs at least."""
REFUSED = (str(Status.UNSUPPORTED), str(Status.UNAVAILABLE), str(Status.NOT_RUN))
SETTING = ("label", "tolerance", "start", "threads", "measure")
FOLLOWED = "previous"


@dataclass(frozen=True)
class MeasuredCosts:
    """Measurements of the problems, each by its fingerprint; a sequence that is followed is one problem.

    Attributes
    ----------
    rows : those that were run here, with the columns unit and spent [s]. outcomes : times [s], units × labels (with
    what else tells pairs apart), NaN where a label does not take part. cost [s], family : of every unit.
    factor : see above; `assumed` where the results do not tell it. solvers : workers that are started.
    """

    rows: pd.DataFrame
    outcomes: pd.DataFrame
    cost: pd.Series[float]
    family: pd.Series[str]
    factor: float
    assumed: bool
    solvers: int

    def expected(self, cost: float) -> float:
        """Return the seconds that a run of problems of this cost takes."""
        return START * self.solvers + self.factor * cost

    def affordable(self, budget: float) -> float:
        """Return the cost that fits into a budget [s], negative where not even the workers do."""
        return (budget - START * self.solvers) / self.factor


def measured_costs(table: pd.DataFrame) -> MeasuredCosts:
    """Read the costs and outcomes of a table of results; of pairs that are there twice, the later row.

    Raises StoreError when no row was run.
    """
    rows = rows_of.with_time(rows_of.normalised(table))
    rows = rows.sort_values(["finished", "key"], kind="stable").drop_duplicates("key", keep="last")
    rows = rows[(rows["origin"] == "") & (rows["status"] != str(Status.NOT_RUN))].sort_index()
    if rows.empty:
        raise StoreError("no pair was run, so that nothing is known of what problems cost; run them first: cpbench run")
    rows = rows.assign(spent=_spent(rows), unit=_units(rows), who=_settings(rows))
    part = rows[~rows["status"].isin(REFUSED)]
    outcomes = part.groupby(["unit", "who"])["time"].sum().unstack()
    cost = rows.groupby("unit")["spent"].sum().clip(lower=LEAST)
    outcomes = outcomes.reindex(index=cost.index, columns=sorted(outcomes.columns)).astype(float)
    solvers = part["solver"].nunique()
    factor, assumed = _factor(rows, solvers)
    family = rows.sort_values(["unit", "family"]).groupby("unit")["family"].first()
    return MeasuredCosts(rows, outcomes, cost, family, factor, assumed, solvers)


def _spent(rows: pd.DataFrame) -> pd.Series[float]:
    """Return the seconds of every row; from the times of its parts where an older file has no wall time."""
    repeats = rows["repeats"].fillna(1.0).clip(lower=1.0)
    once = rows[["load", "verify", "lift"]].fillna(0.0).sum(axis=1)
    often = rows[["setup", "solve"]].fillna(0.0).sum(axis=1) * repeats
    return rows["wall"].fillna(once + often) + rows["convert"].fillna(0.0)


def _units(rows: pd.DataFrame) -> pd.Series[str]:
    """Return the unit of choice of each row: a problem, or all steps of a sequence that starts each from the
    previous answer.
    """
    place = rows["address"].str.replace(r"(::|/)[^/]*$", "", regex=True)
    followed = (rows["start"] == FOLLOWED) & (rows["sequence"] != "")
    scene = "sequence " + rows["sequence"] + " of " + place
    step = rows["fingerprint"].map(dict(zip(rows.loc[followed, "fingerprint"], scene[followed], strict=True)))
    return step.where(step.notna(), rows["fingerprint"]).astype(object)


def _settings(rows: pd.DataFrame) -> pd.Series[str]:
    """Return the label of each row, with whatever setting is not the same everywhere."""
    labels = rows["label"].astype(object)
    for name in SETTING[1:]:
        if rows[name].nunique(dropna=False) > 1:
            labels = labels + f" {name}=" + rows[name].astype(str)
    return labels


def _factor(rows: pd.DataFrame, solvers: int) -> tuple[float, bool]:
    """Return elapsed over used seconds, at least 1; and whether it had to be assumed."""
    passed = spent = 0.0
    for _, own in rows[rows["finished"] != ""].groupby("host"):
        own = own.sort_values("finished", kind="stable")
        at = pd.to_datetime(own["finished"], errors="coerce", format="ISO8601").to_numpy()
        gap = np.diff(at) / np.timedelta64(1, "s")
        took, lanes = own["spent"].to_numpy()[1:], own["jobs"].fillna(1.0).to_numpy()[1:]
        there = np.isfinite(gap) & (gap <= PAUSE + took)
        passed += float(np.sum(gap[there] * lanes[there]))
        spent += float(np.sum(took[there]))
    passed -= START * solvers
    if spent < 10.0 or not math.isfinite(passed):  # the clock of rows ticks in seconds
        return ASSUMED, True
    return max(1.0, passed / spent), False
