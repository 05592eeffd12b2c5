"""Answer to the question which solver to use: of every group a ranking, and one sentence.

The order is that of `ranking_order`: by problems solved where that differs significantly, else by time. A solver is
measured on what it was started on: pairs that no route reaches, that are not installed or were not run are not counted,
and neither are problems that were proved to have no solution. An answer that a conversion lost is charged to the
conversion: it is counted by itself, not among the problems of the solver. It is not an answer either, so that it does
not help its solver in the order.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from cpbench.analysis import cautions, certainty, means, starts
from cpbench.analysis import table as rows_of
from cpbench.analysis.participation import REFUSED
from cpbench.analysis.ranking_order import order
from cpbench.analysis.ranking_sentence import FALSE, Advice, advice
from cpbench.analysis.reliability import false_claims, near
from cpbench.analysis.table import ResultGroup
from cpbench.formulations import formulations
from cpbench.formulations.base import Kind
from cpbench.foundation.text import counted
from cpbench.verification import PROVEN, Status

LINES = 10
"""The most rows of a ranking that are shown."""
NEARLY = "claims that nearly hold"
LAUNCHES = "launches a program"
READ = (
    "problem", "fingerprint", "address", "node", "label", "tolerance", "start", "threads", "set", "measure", "seconds",
    "status", "route", "kind", "claim", "error", "target_error", "target_tolerance", *rows_of.CHARGED, "started",
    "trip", "certainty", "certificate", "distance", rows_of.CONTRADICTED,
)  # fmt: skip
"""The columns that a ranking looks at; all others of a million rows would be copied for each group."""
ENDINGS = {
    str(Status.TIMEOUT): "timeouts",
    str(Status.CRASH): "crashes",
    str(Status.MEMOUT): "out of memory",
    str(Status.ERROR): "errors",
    str(Status.STATIONARY): "stationary only",
}
"""Words for rows that ended so, before their number."""


@dataclass(frozen=True)
class RankedSolver:
    """A solver of a ranking, with its options and how it was reached (`solver` is the label of the rows).

    Attributes
    ----------
    route : by which most of its problems reached it, `others` more routes were taken. started, solved : problems;
    lost : those of which a conversion lost the answer; `counted` are the others. stationary : those on which it found a
    point that meets the conditions of a minimum and may be none. false : its claims that do not hold. error : median of
    what it reached where it solved. fastest : problems on which it shares the lead, `alone` of them are solved by no
    other. median : of its times where it solved [s]. factor : geometric mean of its time over that of the fastest there
    (NaN, as median, without a time that may be compared). warnings : what a reader must know.
    """

    solver: str
    route: str
    others: int
    started: int
    solved: int
    lost: int
    stationary: int
    false: int
    fastest: int
    alone: int
    median: float
    factor: float
    error: float
    warnings: tuple[str, ...] = ()

    @property
    def counted(self) -> int:
        """Problems that it is measured on: those it was started on whose answer no conversion lost."""
        return self.started - self.lost


@dataclass(frozen=True)
class Ranking:
    """The answer of one group: its solvers, the best first, and what to use.

    Attributes
    ----------
    formulation : its name, with what tells the group from others of the same node. problems : those that some
    solver was started on, without those that have no solution; `cases` counts them, each start of a file as one.
    rows : all solvers that were started. advice : the sentence, in parts.
    """

    group: ResultGroup
    formulation: str
    problems: int
    cases: int
    rows: tuple[RankedSolver, ...]
    advice: Advice

    @property
    def shown(self) -> tuple[RankedSolver, ...]:
        """The rows for a reader."""
        return self.rows[:LINES]

    @property
    def bracketed_title(self) -> str:
        """Title of its node in brackets, after a blank; '' where the node is not known any more."""
        return f" ({formulations.get(self.group.node).title})" if self.group.node in formulations else ""

    @property
    def verdict(self) -> str:
        """The sentence without the name of the formulation."""
        return self.advice.text

    @property
    def sentence(self) -> str:
        """Return what to use, after the name of the formulation."""
        return f"{self.formulation}: {self.verdict}"

    @property
    def winner(self) -> str:
        """The solver to use, '' where no solver solved anything."""
        return self.advice.winner

    @property
    def problems_and_starts(self) -> str:
        """Numbers of problems that it rests on, and of starts where there are more, as text."""
        count = counted(self.problems, "problem")
        return count if self.cases == self.problems else f"{count}, {counted(self.cases, 'start')}"


def rankings(table: pd.DataFrame, metadata: Mapping[str, Mapping[str, Any]] | None = None) -> list[Ranking]:
    """Rank every group in which a solver was started, in order of the groups.

    `metadata` : what the results say of each label (`meta["solvers"]`); one with a true `launches` is marked.

    >>> rows = pd.DataFrame({"problem": ["a", "b"] * 2, "label": ["s", "s", "t", "t"], "node": "lcp", "solve": 1.0,
    ...                      "status": ["solved", "solved", "solved", "timeout"], "tolerance": 1e-6, "threads": 1})
    >>> [found] = rankings(rows_of.normalised(rows))
    >>> found.sentence, [(row.solver, row.solved, row.started) for row in found.rows]
    ('lcp: a hint from 2 problems: s solves 2 of 2, alone on 1, fastest on 1.', [('s', 2, 2), ('t', 1, 2)])
    """
    parts = rows_of.groups(starts.merged(table[[name for name in READ if name in table]]))
    groups = [group for group, _ in parts]
    launching = cautions.launching(metadata or {}, metadata or {})
    result: list[Ranking] = []
    for group, rows in parts:
        started = rows[~rows["status"].isin(REFUSED)]
        if len(started):
            result.append(_ranking(group, formulation(group, groups), started, launching))
    return result


def formulation(group: ResultGroup, groups: Sequence[ResultGroup]) -> str:
    """Return the node of a group, and what tells it from the other groups of the node.

    >>> one, two = ResultGroup("fc", 1e-4, "cold", 1), ResultGroup("fc", 1e-8, "cold", 1)
    >>> formulation(one, [one]), formulation(one, [one, two])
    ('fc', 'fc, tolerance 0.0001')
    """
    others = [g for g in groups if g.node == group.node]
    sentence = (
        (f"set {group.set}" if group.set else "", {g.set for g in others}),
        (f"tolerance {group.tolerance:g}", {g.tolerance for g in others}),
        (f"{group.start} start", {g.start for g in others}),
        (counted(group.threads, "thread"), {g.threads for g in others}),
        (f"judged by {group.measure or 'all measures'}", {g.measure for g in others}),
    )
    return ", ".join([group.node, *(text for text, values in sentence if text and len(values) > 1)])


def _ranking(group: ResultGroup, name: str, started: pd.DataFrame, launching: Collection[str]) -> Ranking:
    refuted = rows_of.met(started) & certainty.refuted(started)  # a measure that a proof contradicts recommends nobody
    started = started.assign(status=started["status"].astype(object).mask(refuted, str(Status.WRONG)))
    # a problem with a verified answer counts, whatever a proof says: that is a contradiction
    proved = started["status"].isin(PROVEN) & ~started["fingerprint"].isin(
        started.loc[rows_of.met(started), "fingerprint"]
    )
    hopeless = started["fingerprint"].isin(started.loc[proved, "fingerprint"].unique())
    rows = started[~hopeless]
    cases = rows["fingerprint"].nunique()
    problems = rows["fingerprint"].map(starts.original).nunique()
    times = rows_of.times(rows)
    gap = means.gaps(times)
    factors = {str(label): float(factor) for label, factor in gap["mean"].items()}
    ranked = _ranked(started, rows, times, gap, launching)
    places = {label: k for k, label in enumerate(order(rows, times, factors))}
    ranked.sort(key=lambda r: places.get(r.solver, len(places)))
    left = int(started.loc[hopeless, "fingerprint"].nunique())
    ranking = Ranking(group, name, problems, cases, tuple(ranked), Advice("", "", ""))
    return replace(ranking, advice=advice(ranking, rows, times, left, int(refuted.sum())))


def _ranked(
    started: pd.DataFrame, rows: pd.DataFrame, times: pd.DataFrame, gap: pd.DataFrame, launching: Collection[str]
) -> list[RankedSolver]:
    """Return the solvers of a group, in order of name. `started` has the problems without a solution, too."""
    leads, alone, factors = gap["fastest"].to_dict(), gap["alone"].to_dict(), gap["mean"].to_dict()
    medians = times.where(np.isfinite(times)).median().to_dict()
    solved = rows_of.solved(rows)
    errors = rows[solved].groupby("label")["error"].median().to_dict()
    count, solved_by = _count(rows), _count(rows[solved])
    lost = _count(rows[rows["status"] == str(Status.LOST)])
    stationary = _count(rows[rows["status"] == str(Status.STATIONARY)])
    false = _count(false_claims(started))
    warnings, routes = _warnings(started, launching), _routes(rows)
    return [
        RankedSolver(
            solver=label,
            route=routes.get(label, ("", 0))[0],
            others=routes.get(label, ("", 0))[1],
            started=count[label],
            solved=solved_by.get(label, 0),
            lost=lost.get(label, 0),
            stationary=stationary.get(label, 0),
            false=false.get(label, 0),
            fastest=int(leads.get(label, 0)),
            alone=int(alone.get(label, 0)),
            median=float(medians.get(label, math.nan)),
            factor=float(factors.get(label, math.nan)),
            error=float(errors.get(label, math.nan)),
            warnings=tuple(warnings.get(label, ())),
        )
        for label in sorted(count)
    ]


def _count(rows: pd.DataFrame) -> dict[str, int]:
    """Count rows by label."""
    return {str(label): int(n) for label, n in rows["label"].value_counts().items()}


def _routes(rows: pd.DataFrame) -> dict[str, tuple[str, int]]:
    """Return the route that most rows of a label took, the first by name of equally many, and how many others there
    are.
    """
    taken = rows.loc[rows["route"] != "", ["label", "route"]].value_counts()
    by_label: dict[str, list[tuple[int, str]]] = {}
    for (label, route), count in taken.items():  # type: ignore[misc]
        by_label.setdefault(str(label), []).append((-int(count), str(route)))
    return {label: (min(routes)[1], len(routes) - 1) for label, routes in by_label.items()}


def _warnings(rows: pd.DataFrame, launching: Collection[str]) -> dict[str, list[str]]:
    """Return the warnings that a reader needs about each label."""
    warnings: dict[str, list[str]] = {}

    def warn(counts: Mapping[str, int], text: str) -> None:
        for label, count in counts.items():
            warnings.setdefault(label, []).append(f"{text} {count}")

    for label in sorted(set(launching) & set(rows["label"])):
        warnings.setdefault(label, []).append(LAUNCHES)
    for label, trip in cautions.served(rows).items():
        warnings.setdefault(label, []).append(f"served (round trip {cautions.microseconds(trip)})")
    inexact = {str(kind) for kind in Kind if not kind.exact}
    for label, kind in rows_of.label_kinds(rows).items():
        if kind in inexact:
            warnings.setdefault(label, []).append(f"{kind} route")
    failing = false_claims(rows)
    almost = near(failing) & ~rows_of.contradicted(failing)
    warn(_count(failing[~almost]), FALSE)
    warn(_count(failing[almost]), NEARLY)
    warn(cautions.fell_back(rows), "fell back to cold")
    for status, text in ENDINGS.items():
        warn(_count(rows[rows["status"] == status]), text)
    return warnings
