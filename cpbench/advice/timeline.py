"""Several runs in order of time: what every label solved in each, and how fast against its first run on that machine.

For a label s let F be its first run on a machine and R a later one on the same, and C the pairs that s solves in both:

    ratio(R, s) = exp( mean over p in C of log( max(t_R[p], floor) / max(t_F[p], floor) ) ),    counted by |C|

Runs on another machine begin anew, with themselves as base: a ratio across machines would be about the machines. How
much one machine drifted is told by the solve that every run repeats (`reference`), and is not taken out of the ratio.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from cpbench.analysis import table as rows_of
from cpbench.analysis.profiles import FLOOR
from cpbench.verification import Status

COLUMNS = (
    "file", "label", "date", "version", "cpbench", "machine", "pairs", "solved", "wrong", "crash", "base", "common",
    "ratio", "reference",
)  # fmt: skip
UNKNOWN = "unknown"
"""A machine of which nothing was told: it is no other's, and not even its own at another time."""


@dataclass(frozen=True)
class TimelineRun:
    """A results file: its rows, the version of cpbench, what its machines are by host, and what its reference solves
    took [s], which are of a kind (`solved`). `machine` and `date` stand for rows that do not tell their own."""

    name: str
    table: pd.DataFrame
    cpbench: str = ""
    machines: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    machine: Mapping[str, Any] = field(default_factory=dict)
    date: str = ""
    references: Sequence[float | None] = ()
    solved: str = ""

    @property
    def reference(self) -> float:
        """Median time of the reference solve [s], NaN without one."""
        taken = [s for s in self.references if s is not None and s > 0]
        return float(np.median(taken)) if taken else math.nan


def timeline(runs: Sequence[TimelineRun], floor: float = FLOOR) -> pd.DataFrame:
    """Return one row a label and run that measured it, by label, then date.

    Columns: file, label, date (its last row's), version (of the solver), cpbench, machine; pairs that were run, solved,
    wrong, crash; base (the file it is compared with, itself where it is the first on its machine), common (pairs solved
    in both), ratio (NaN without any), reference (the machine's own ratio, NaN where it was not measured).

    >>> rows = pd.DataFrame({"key": ["k"], "label": ["s"], "status": ["solved"], "solve": [1.0],
    ...                      "finished": ["2026-01-01"]})
    >>> first = TimelineRun("a", rows, machine={"cpu": "x"})
    >>> runs = [first, TimelineRun("b", rows.assign(solve=2.0), machine={"cpu": "x"})]
    >>> timeline(runs)[["file", "base", "common", "ratio"]].values.tolist()
    [['a', 'a', 1, 1.0], ['b', 'a', 1, 2.0]]
    """
    runs = sorted(runs, key=lambda run: run.name)
    rows = _rows(runs)
    every = rows.groupby(["label", "run"], sort=True)
    points = pd.DataFrame(
        {
            "date": every["finished"].max(),
            "version": every["version"].agg(_several),
            "machine": every["machine"].agg(_several),
            "pairs": every.size(),
            "solved": every["done"].sum(),
            "wrong": every["wrong"].sum(),
            "crash": every["crash"].sum(),
        }
    ).reset_index()
    points = points.sort_values(["label", "date", "run"], kind="stable", ignore_index=True)
    known = points["machine"] != UNKNOWN
    first = points.groupby(["label", "machine"])["run"].transform("first")
    points["base_run"] = first.where(known, points["run"]).astype(int)
    points = points.merge(_ratios(rows, points, floor), on=["label", "run"], how="left")
    points["common"] = points["common"].fillna(0).astype(int)
    names = dict(enumerate(run.name for run in runs))
    references = dict(enumerate(run.reference for run in runs))
    kind = dict(enumerate(run.solved for run in runs))
    reference = points["run"].map(references) / points["base_run"].map(references)
    reference = reference.where(points["run"].map(kind) == points["base_run"].map(kind))
    whole = points.assign(
        file=points["run"].map(names),
        base=points["base_run"].map(names),
        cpbench=points["run"].map(dict(enumerate(run.cpbench for run in runs))),
        reference=reference.where(known),
    )
    return whole[list(COLUMNS)]


def moved(points: pd.DataFrame) -> list[str]:
    """Sort labels by how much they changed, most first: pairs solved more or fewer, then the largest ratio either
    way.
    """
    share = points["solved"] / points["pairs"]
    ratio = pd.Series(np.abs(np.log(points["ratio"].to_numpy(dtype=float))), index=points.index).fillna(0.0)
    by = pd.DataFrame({"label": points["label"], "share": share, "ratio": ratio}).groupby("label")
    spread = pd.DataFrame({"share": by["share"].max() - by["share"].min(), "ratio": by["ratio"].max()}).reset_index()
    ordered = spread.sort_values(["share", "ratio", "label"], ascending=[False, False, True], kind="stable")
    return [str(label) for label in ordered["label"]]


def machine_text(facts: Mapping[str, Any]) -> str:
    """Describe a machine by its lasting facts; '' without any.

    >>> machine_text({"cpu": "a processor", "cores": 2, "ram_gib": 8.0, "load": 0.3})
    'a processor, 2 cores, 8 GiB'
    """
    cores, memory = facts.get("cores"), facts.get("ram_gib")
    parts = [str(facts.get("cpu") or ""), f"{cores} cores" if cores else "", f"{memory:g} GiB" if memory else ""]
    return ", ".join(part for part in parts if part)


def _rows(runs: Sequence[TimelineRun]) -> pd.DataFrame:
    """Return the rows of all runs that were run, each with the number of its run, machine, and time (∞ unless
    solved).
    """
    parts: list[pd.DataFrame] = []
    for number, run in enumerate(runs):
        rows = rows_of.with_time(rows_of.normalised(run.table))
        rows = rows[~rows["status"].isin([str(Status.NOT_RUN), str(Status.UNAVAILABLE)])]
        hosts = {host: machine_text(run.machines.get(host, run.machine)) or host for host in rows["host"].unique()}
        lanes = rows["jobs"].fillna(1.0)
        beside = lanes.map({n: f", {n:g} at a time" if n > 1 else "" for n in lanes.unique()})
        machine = rows["host"].map(hosts).replace("", UNKNOWN).astype(object) + beside.astype(object)
        part = pd.DataFrame(
            {
                "run": number,
                "key": rows["key"],
                "label": rows["label"],
                "finished": rows["finished"].where(rows["finished"] != "", run.date),
                "version": rows["version"],
                "machine": machine,
                "done": rows_of.solved(rows),
                "wrong": rows["status"] == str(Status.WRONG),
                "crash": rows["status"] == str(Status.CRASH),
                "time": rows["time"].where(rows_of.ranked(rows), math.inf),
            }
        )
        parts.append(part)
    return pd.concat(parts, ignore_index=True)


def _ratios(rows: pd.DataFrame, points: pd.DataFrame, floor: float) -> pd.DataFrame:
    """Return common and ratio of every (label, run) that has a pair solved in its base too."""
    timed = rows.loc[np.isfinite(rows["time"]), ["label", "run", "key", "time"]].drop_duplicates(
        ["label", "run", "key"]
    )
    timed = timed.merge(points[["label", "run", "base_run"]], on=["label", "run"])
    before = timed[["label", "run", "key", "time"]].rename(columns={"run": "base_run", "time": "before"})
    both = timed.merge(before, on=["label", "base_run", "key"])
    both["log"] = np.log(both["time"].clip(lower=floor)) - np.log(both["before"].clip(lower=floor))
    found = both.groupby(["label", "run"])["log"]
    return pd.DataFrame({"common": found.size(), "ratio": np.exp(found.mean())}).reset_index()


def _several(values: pd.Series[str]) -> str:
    """Join the different values, in order."""
    return " + ".join(sorted({value for value in values.unique() if value}))
