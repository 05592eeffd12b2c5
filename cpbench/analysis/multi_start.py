"""Several starts of one problem: which solver finds which solution from where.

Starts of a problem's file (`file`, `file:2`, ...) are cases of one formulation, not several formulations:
`merged` makes them so. Two answers are the same solution where they differ by at most SAME of their size.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from cpbench.analysis import table as rows_of
from cpbench.analysis.participation import REFUSED
from cpbench.foundation.matrices import Vector, norm

EVERY = "file:all"
"""Name of the start of merged rows."""
BEGAN = "began"
"""Column of merged rows with the start that was asked for."""
SAME = 1e-3
"""Relative distance up to which two answers are one solution."""


@dataclass(frozen=True)
class ReachedSolutions:
    """Solutions that the solvers found for one problem.

    Attributes
    ----------
    starts, labels : in the order of the table. solutions : one answer of each, the one found most often first.
    place : by (start, label) the number of the solution, from 1; 0 where an answer is not kept. status : of every row.
    """

    problem: str
    fingerprint: str
    starts: tuple[str, ...]
    labels: tuple[str, ...]
    solutions: tuple[Vector, ...]
    place: Mapping[tuple[str, str], int]
    status: Mapping[tuple[str, str], str]

    def reached(self, start: str) -> dict[int, list[str]]:
        """Return the labels that reached each solution from a start."""
        labels_by_solution: dict[int, list[str]] = {}
        for label in self.labels:
            if self.place.get((start, label)):
                labels_by_solution.setdefault(self.place[start, label], []).append(label)
        return dict(sorted(labels_by_solution.items()))


def several(table: pd.DataFrame) -> pd.Series[bool]:
    """Return whether each row is of a formulation of which some problem was started from several points of its file."""
    guess = table["start"].str.fullmatch(r"file(:\d+)?")
    if not guess.any():
        return guess
    counts = table[guess].groupby(["node", "fingerprint"])["start"].nunique()
    nodes = counts[counts > 1].index.get_level_values("node").unique()
    return guess & table["node"].isin(nodes)


def merged(table: pd.DataFrame) -> pd.DataFrame:
    """Return the table with a problem for each start of a file, all of one start, `file:all`; itself where there is
    one start.

    >>> rows = pd.DataFrame({"problem": "p", "fingerprint": "f", "node": "ncp", "start": ["file", "file:2"]})
    >>> merged(rows)[["problem", "fingerprint", "start", "began"]].to_numpy().tolist()
    [['p from file', 'f/file', 'file:all', 'file'], ['p from file:2', 'f/file:2', 'file:all', 'file:2']]
    """
    chosen = several(table)
    if not chosen.any():
        return table
    start = table["start"].astype(object)
    return table.assign(
        problem=table["problem"].astype(object).where(~chosen, table["problem"] + " from " + start),
        fingerprint=table["fingerprint"].astype(object).where(~chosen, table["fingerprint"] + "/" + start),
        start=start.where(~chosen, EVERY),
        **{BEGAN: start},
    )


def original(fingerprint: str) -> str:
    """Return the fingerprint of the problem itself of a merged row.

    >>> original("5e/file:2"), original("5e")
    ('5e', '5e')
    """
    return re.sub(r"/file(:\d+)?$", "", fingerprint)


def wanted(table: pd.DataFrame) -> list[str]:
    """Return keys of the rows whose answers are compared."""
    return [str(key) for key in table.loc[several(table) & rows_of.met(table), "key"]]


def solutions(table: pd.DataFrame, answers: Mapping[str, Vector]) -> Iterator[ReachedSolutions]:
    """Yield each problem that was started from several points of its file; `answers` by key of the row."""
    rows = table[several(table) & ~table["status"].isin(REFUSED)]
    for (fingerprint, *_), own in rows.groupby(["fingerprint", "node", "tolerance", "threads"], sort=False):
        if own["start"].nunique() < 2:
            continue
        own = own.drop_duplicates(["start", "label"])
        done = own[rows_of.met(own) & own["key"].isin(list(answers))].sort_values(["error", "key"], kind="stable")
        numbers, centres = clustered([answers[key] for key in done["key"]])
        cells = list(zip(done["start"], done["label"], strict=True))
        status = {(str(r.start), str(r.label)): str(r.status) for r in own.itertuples(index=False)}
        yield ReachedSolutions(
            problem=str(own["problem"].iloc[0]),
            fingerprint=str(fingerprint),
            starts=tuple(sorted(set(own["start"]), key=_number)),
            labels=tuple(sorted(set(own["label"]))),
            solutions=tuple(centres),
            place=dict(zip(cells, numbers, strict=True)),
            status=status,
        )


def clustered(points: Sequence[Vector]) -> tuple[list[int], list[Vector]]:
    """Give each point's solution a number, from 1, by how many points it has, and return the first point of each.

    >>> import numpy as np
    >>> numbers, centres = clustered([np.array([0.0, 1.0]), np.array([2.0, 0.0]), np.array([2.0, 1e-6])])
    >>> numbers, centres[0].tolist()
    ([2, 1, 1], [2.0, 0.0])
    """
    centres: list[Vector] = []
    place: list[int] = []
    for point in points:
        near = [k for k, centre in enumerate(centres) if _same(point, centre)]
        if not near:
            centres.append(point)
        place.append(near[0] if near else len(centres) - 1)
    order = sorted(range(len(centres)), key=lambda k: (-place.count(k), k))
    number = {k: at for at, k in enumerate(order, start=1)}
    return [number[k] for k in place], [centres[k] for k in order]


def _same(one: Vector, other: Vector) -> bool:
    return one.shape == other.shape and norm(one - other) <= SAME * max(norm(one), norm(other))


def _number(start: Any) -> int:
    """Return K of `file:K`, 1 of `file`."""
    return int(str(start).partition(":")[2] or 1)
