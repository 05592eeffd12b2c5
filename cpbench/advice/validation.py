"""Validation of advice: every origin is left out in turn, and advice on it has never seen it.

The knobs of the estimate are part of the advice. They are chosen among KNOBS for every part of the origins by what the
others show (nested cross-validation; Stone, J. R. Statist. Soc. B 36 (1974); Varma and Simon, BMC Bioinformatics 7
(2006)): origins are dealt into at most PARTS parts; for part P every other part Q is advised by what is in neither, and
the knobs with most advice within WITHIN times the virtual best advise P. They have seen no problem of P's origins.
"""

from __future__ import annotations

from itertools import combinations, product
from typing import Any, TypeAlias

import numpy as np
import pandas as pd

from cpbench.advice.recommendation import SHIPPED, WITHIN, Knobs, standing
from cpbench.advice.similarity import distances, places
from cpbench.analysis.table import Masks
from cpbench.analysis.training_cases import TrainingCases
from cpbench.solvers.base import solvers

PARTS = 8
CHOSEN_BY = 400
"""Cases that choose the knobs, evenly spaced where there are more."""
KNOBS = (SHIPPED, *(Knobs(*one) for one in product((4.0, 6.0, 8.0), (4, 8, 16), (0.5, 0.7, 1.0))))
COLUMNS = ("node", "origin", "problem", "label", "ratio", "plain", "plain_ratio")
COUNTS = ("solved", "within")

Places: TypeAlias = np.ndarray[Any, np.dtype[np.int64]]


def evaluate(known: TrainingCases, node: str = "", most: int | None = None) -> pd.DataFrame:
    """Leave one origin out: every case with the label that the cases of all other origins recommend.

    `node` : its cases only. `most` : at most so many, evenly spaced.

    The labels that take the problem are known beforehand, as they are to whoever asks: an edge or a solver refuses
    before anything is solved.

    Columns: node, origin, problem, label, ratio (its time over the virtual best, ∞ for a failure); plain, plain_ratio:
    the same of the label that is best on the other origins of the node, whatever the problem is like.
    """
    queries = _spread(
        np.array([i for i, case in enumerate(known.cases) if node in ("", case.node)], dtype=np.int64), most
    )
    at, may = places(known), ~np.isnan(known.ratios)
    part = dealt(known)
    knobs = chosen(known, part) if len(queries) else []
    records: dict[int, tuple[Any, ...]] = {}
    for origin in sorted({str(known.origins[i]) for i in queries}):
        own = queries[known.origins[queries] == origin]
        used = known.origins != origin
        found = standing(
            known, distances(at[own], at, used), known.nodes[own], may[own], used, knobs[int(part[own[0]])]
        )
        for i, label, plain in zip(own, found.best(may[own]), _plain(known, own, used), strict=True):
            ratios = known.ratios[i]
            case = known.cases[i]
            records[int(i)] = (
                case.node, origin, case.problem, known.labels[label], ratios[label], known.labels[plain], ratios[plain],
            )  # fmt: skip
    return pd.DataFrame([records[int(i)] for i in queries], columns=list(COLUMNS))


def rates(known: TrainingCases, evaluation: pd.DataFrame) -> pd.DataFrame:
    """Evaluate the recommendation by node, one row a node, and the sum of all as the last, 'all', beside simpler
    choices.

    Columns: node, problems, origins, solved, within (of the virtual best, twice); and the last two of

    - plain: the label best on the node's other origins (on all problems, where it has no other),
    - auto: the automatic solver that `auto` names ('' where none was started), over all problems,
    - single: the label that is within on most cases of the node, chosen in hindsight.
    """
    records: list[dict[str, Any]] = []
    for node, rows in evaluation.groupby("node", sort=True):
        ratios = known.ratios[known.nodes == node]
        started, reached, close = (
            part.sum(axis=0) for part in (~np.isnan(ratios), np.isfinite(ratios), ratios <= WITHIN)
        )
        best = int(np.lexsort((-reached, -close))[0])
        record: dict[str, Any] = {"node": str(node), "problems": len(rows), "origins": rows["origin"].nunique()}
        for prefix, column in (("", "ratio"), ("plain_", "plain_ratio")):
            record[f"{prefix}solved"] = int(np.isfinite(rows[column]).sum())
            record[f"{prefix}within"] = int((rows[column] <= WITHIN).sum())
        automatic = [j for j, label in enumerate(known.labels) if started[j] and _automatic(label)]
        own = [j for j in automatic if solvers.get(_name(known.labels[j])).spec.node == node] or automatic
        auto = min(own, key=lambda j: (-started[j], -close[j], known.labels[j])) if own else None
        for name, j in (("auto", auto), ("single", best)):
            record[name] = "" if j is None else known.labels[j]
            record[f"{name}_solved"] = 0 if j is None else int(reached[j])
            record[f"{name}_within"] = 0 if j is None else int(close[j])
        records.append(record)
    counts = [f"{prefix}{name}" for prefix in ("", "plain_", "auto_", "single_") for name in COUNTS]
    columns = ["node", "problems", "origins", *counts[:4], "auto", *counts[4:6], "single", *counts[6:]]
    found = pd.DataFrame(records, columns=columns)
    total = {name: int(found[name].sum()) for name in ("problems", *counts)}
    total |= {"origins": evaluation["origin"].nunique()}
    return pd.concat([found, pd.DataFrame([{"node": "all", "auto": "", "single": "", **total}])], ignore_index=True)


def chosen(known: TrainingCases, part: Places) -> list[Knobs]:
    """Choose the knobs for each part by the other parts; of equals the first of KNOBS."""
    parts = int(part.max()) + 1
    hits = np.zeros((len(KNOBS), parts))
    at, may = places(known), ~np.isnan(known.ratios)
    queries = _spread(np.arange(len(known.cases)), CHOSEN_BY)
    for two in combinations(range(parts), 2):
        used = ~np.isin(part, two)
        own = queries[~used[queries]]
        distance = distances(at[own], at, used)
        for k, knobs in enumerate(KNOBS):
            label = standing(known, distance, known.nodes[own], may[own], used, knobs).best(may[own])
            good = known.ratios[own, label] <= WITHIN
            for one, other in (two, two[::-1]):
                hits[k, one] += good[part[own] == other].sum()
    return [KNOBS[k] for k in hits.argmax(axis=0)]


def dealt(known: TrainingCases) -> Places:
    """Deal every case to a part: origins, the largest first, each to the part that has least."""
    names, counts = np.unique(known.origins.astype(str), return_counts=True)
    filled = [0] * min(PARTS, len(names))
    place: dict[str, int] = {}
    for k in np.lexsort((names, -counts)):
        place[str(names[k])] = least = filled.index(min(filled))
        filled[least] += int(counts[k])
    return np.array([place[str(origin)] for origin in known.origins], dtype=np.int64)


def _plain(known: TrainingCases, own: Places, used: Masks) -> list[int]:
    """Return the label for each case that is within most often on the used cases of its node, else of any; then that
    solves most, of those that take the case.
    """
    found: list[int] = []
    for i in own:
        there = used & (known.nodes == known.nodes[i])
        ratios = known.ratios[there if there.any() else used]
        close, reached = (ratios <= WITHIN).sum(axis=0), np.isfinite(ratios).sum(axis=0)
        takes = ~np.isnan(known.ratios[i])
        found.append(int(np.lexsort((-reached, -close, ~takes))[0]))
    return found


def _spread(places: Places, most: int | None) -> Places:
    """Return at most so many places, evenly spaced."""
    if most is None or len(places) <= most:
        return places
    return places[np.arange(most) * len(places) // most]


def _name(label: str) -> str:
    return label.partition("[")[0].partition("@")[0]


def _automatic(label: str) -> bool:
    """Return whether a label is of a solver that chooses among others, registered here."""
    return _name(label) in solvers and solvers.get(_name(label)).spec.method == "automatic choice"
