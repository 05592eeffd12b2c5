"""All rows of a results file as one table, in little time and memory.

Most of a row says what many rows say: its problem, its solver, how it ended. These columns are read as one text a row
(a JSON array that SQLite writes), each distinct one is cut into its values once, and all rows that say the same share
them. So a million rows of 55 columns are some ten million values, not 55.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from itertools import count
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from cpbench.bench.results.schema import MEASURED, PLANNED
from cpbench.solvers.renamed import current_label

if TYPE_CHECKING:
    import pandas as pd

    from cpbench.bench.results.database import Database

Values: TypeAlias = np.ndarray[tuple[int], np.dtype[Any]]

KINDS = {**PLANNED, **MEASURED}
OF_PROBLEM = ("problem", "address", "fingerprint", "node", "family", "sizes", "set", "sequence", "step")
OF_SOLVER = (
    "solver", "label", "request", "options", "measure", "start", "memory", "threads", "repeats_asked", "version",
)  # fmt: skip
OF_ENDING = (
    "status", "route", "kind", "claim", "flags", "started", "host", "origin", "signal", "code", "attempts", "jobs",
    "repeats", "certainty", "batch", "sealed_by",
)  # fmt: skip
SHARED = (OF_PROBLEM, OF_SOLVER, OF_ENDING)
"""Text and whole numbers that repeat together; other numbers would lose digits in JSON."""
SINGLE = tuple(name for name in KINDS if not any(name in names for names in SHARED))
NUMBERS = tuple(name for name in SINGLE if KINDS[name] == "REAL")
CHUNK = 500
"""Rows that are held as Python objects at a time."""
REMEMBERED = 10_000
"""Values of a single column that later ones are compared with."""


def _quoted(names: Iterable[str]) -> str:
    return ", ".join(f'"{name}"' for name in names)


_READ = ", ".join([*(f"json_array({_quoted(names)})" for names in SHARED), _quoted(SINGLE)])


class Rows(NamedTuple):
    """Rows as they were read: the distinct texts of SHARED, and the columns: places among these, then SINGLE."""

    texts: list[list[str]]
    columns: list[Values]


def whole_table(database: Database, owner: Callable[[str | None], str]) -> pd.DataFrame:
    """Return all rows in the order problem, label, key, with `error` ∞ where none was measured, and `sealed_by` as
    `owner` says it."""
    import pandas as pd

    with pd.option_context("mode.string_storage", "python"):  # where pyarrow is, each cell would be a separate text
        frame, ranks = _joined(_read_rows(database), owner)
    frame["error"] = frame["error"].fillna(float("inf"))
    order = _order(ranks["problem"], ranks["label"], frame["key"])
    if order is not None:
        frame = frame.take(order)
        frame.index = pd.RangeIndex(len(frame))
    return frame


def _read_rows(database: Database) -> Rows:
    """Return all rows in the order in which they were added."""
    seen = [defaultdict[str, int](count().__next__) for _ in SHARED]
    readers = [*map(_places, seen), *map(_reader, SINGLE)]
    columns: list[list[Values]] = [[read(())] for read in readers]
    query = f"SELECT {_READ} FROM rows ORDER BY rowid"
    for rows in database.chunks(query, CHUNK):
        for parts, read, column in zip(columns, readers, zip(*rows, strict=True), strict=True):
            parts.append(read(column))
    return Rows([list(texts) for texts in seen], [np.concatenate(parts) for parts in columns])


def _joined(rows: Rows, owner: Callable[[str | None], str]) -> tuple[pd.DataFrame, dict[str, Values]]:
    """Return the table of what was read, and the ranks of problem and label; `rows` are emptied on the way."""
    import pandas as pd

    columns: dict[str, Any] = {}
    ranks: dict[str, Values] = {}
    for names, texts in zip(SHARED, rows.texts, strict=True):
        distinct, place = _distinct(names, texts), rows.columns.pop(0)
        if "sealed_by" in names:
            distinct["sealed_by"] = [owner(v if isinstance(v, str) else None) for v in distinct["sealed_by"]]
        columns |= {name: distinct[name].array.take(place) for name in names}
        ranks |= {n: pd.factorize(distinct[n], sort=True)[0][place] for n in ("problem", "label") if n in names}
    for name in SINGLE:
        values = rows.columns.pop(0)
        columns[name] = values if name in NUMBERS else pd.Series(values).infer_objects().array
    return pd.DataFrame({name: columns.pop(name) for name in KINDS}, copy=False), ranks


def _places(seen: defaultdict[str, int]) -> Callable[[Sequence[str]], Values]:
    """Texts as their places among the distinct ones, in order of appearance."""
    return lambda texts: np.fromiter(map(seen.__getitem__, texts), dtype=np.int32, count=len(texts))


def _reader(name: str) -> Callable[[Sequence[Any]], Values]:
    """Return a single column as an array: NaN where a number is missing, equal texts near each other one object."""
    if name in NUMBERS:
        return lambda values: np.fromiter(values, dtype=float, count=len(values))
    if name == "key":  # no two are equal
        return lambda values: np.fromiter(values, dtype=object, count=len(values))
    once: dict[Any, Any] = {}

    def read(values: Sequence[Any]) -> Values:
        # a column of texts that all differ would fill the memory, and find nothing
        if len(once) > REMEMBERED:
            once.clear()
        return np.fromiter(map(once.setdefault, values, values), dtype=object, count=len(values))

    return read


def _distinct(names: Sequence[str], texts: Iterable[str]) -> pd.DataFrame:
    """Return the values of shared columns, one line a distinct text."""
    import pandas as pd

    once: dict[Any, Any] = {}
    frame = pd.DataFrame([[once.setdefault(v, v) for v in json.loads(text)] for text in texts], columns=list(names))
    for name in {"solver", "label"} & set(names):
        frame[name] = [label and current_label(label) for label in frame[name]]
    return frame


def _order(problem: Values, label: Values, key: pd.Series) -> Values | None:
    """Positions of the rows by rank of problem and label, then key; None where they lie so already."""
    import pandas as pd

    step = np.diff(problem)
    same = (step == 0) & (np.diff(label) == 0)
    before, after = (np.asarray(key, dtype=object)[k][same] for k in (slice(None, -1), slice(1, None)))
    if not ((step < 0) | ((step == 0) & (np.diff(label) < 0))).any() and (before < after).all():
        return None
    order = np.lexsort((label, problem))
    alike = np.append(False, (np.diff(problem[order]) == 0) & (np.diff(label[order]) == 0))
    alike[:-1] |= alike[1:]
    if not alike.any():
        return order
    rank = np.zeros(len(key), dtype=np.int64)
    # keys decide only among equal problems and labels: to rank all of them would take longer than all the rest
    tied = order[alike]
    rank[tied] = pd.factorize(key.iloc[tied], sort=True)[0]
    return np.lexsort((rank, label, problem))
