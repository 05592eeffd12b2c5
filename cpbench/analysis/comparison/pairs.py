"""Pairing of the rows of two tables: rows without a partner are listed, nothing is guessed.

A pair is one problem (its mathematics: the fingerprint), solver, options, route request, tolerance, measure, start and
number of threads. Where that is not unique on a side, the set, the step of a scene and the name of the problem tell
rows apart; what is still there twice is reported and not compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import pandas as pd

from cpbench.analysis import table as rows_of
from cpbench.errors import CpbenchError, UnknownName

KEY = ("fingerprint", "solver", "options", "request", "tolerance", "measure", "start", "threads")
FINER = ("set", "step", "problem")
"""Columns that tell rows of one key apart, in this order."""
COMMON = ("problem", "address", "node", "family", "solver", "request", "options", "tolerance", "measure", "start",
          "threads", "set", "step", "fingerprint")  # fmt: skip
SIDE = ("label", "status", "error", "counters", "samples", "flags", "message", "seconds", "memory", "host", "jobs",
        "version", "cpu", "solve", "time")  # fmt: skip
"""Columns that a pair has of both sides, with the endings `_base` and `_new`."""
BY_LABEL = ("solver", "options", "request")
"""Columns that do not belong to the key where two labels of one table are compared."""
_READ = {*COMMON, *SIDE, *rows_of.CHARGED} - {"time"}


@dataclass(frozen=True)
class Matched:
    """Rows by partner.

    Attributes
    ----------
    pairs : the columns of COMMON (of the new row), and of SIDE with `_base` and `_new`.
    only_base, only_new : rows without a partner. twice : rows whose key is there twice on their side.
    changed : names of problems whose mathematics is another on either side.
    """

    pairs: pd.DataFrame
    only_base: pd.DataFrame
    only_new: pd.DataFrame
    twice: pd.DataFrame
    changed: tuple[str, ...]


def prepared(table: pd.DataFrame) -> pd.DataFrame:
    """Return the columns of a table of results that a comparison uses, each present, with `time`."""
    clean = rows_of.normalised(table, _READ)
    options = clean["options"].where(clean["options"] != "", "{}")
    threads = clean["threads"].fillna(1.0)
    return rows_of.with_time(clean).assign(options=options, threads=threads)[[*COMMON, *SIDE]]


def match(base: pd.DataFrame, new: pd.DataFrame, loose: Sequence[str] = ()) -> Matched:
    """Match two tables (`prepared`); columns `loose` do not belong to the key.

    >>> rows = pd.DataFrame({"problem": ["p", "q"], "label": "s", "solver": "s", "status": "solved"})
    >>> found = match(prepared(rows), prepared(rows.assign(problem=["p", "r"])))
    >>> found.pairs["problem"].tolist(), found.only_base["problem"].tolist(), found.only_new["problem"].tolist()
    (['p'], ['q'], ['r'])
    """
    sides = [base.reset_index(drop=True), new.reset_index(drop=True)]
    code = _codes(sides, [column for column in KEY if column not in loose])
    twice = [column.duplicated(keep=False) for column in code]
    doubled = set(code[0][twice[0]]) | set(code[1][twice[1]])
    single = [~column.isin(doubled) for column in code]
    partner = [single[0] & code[0].isin(set(code[1])), single[1] & code[1].isin(set(code[0]))]
    left = sides[0].loc[partner[0], list(SIDE)].add_suffix("_base").assign(code=code[0][partner[0]])
    right = sides[1].loc[partner[1], [*COMMON, *SIDE]].rename(columns={c: f"{c}_new" for c in SIDE})
    pairs = right.assign(code=code[1][partner[1]]).merge(left, on="code").drop(columns="code")
    order = ["problem", "fingerprint", "label_new", "tolerance", "start"]
    alone = [side[is_single & ~has] for side, is_single, has in zip(sides, single, partner, strict=True)]
    return Matched(
        pairs.sort_values(order, kind="stable", ignore_index=True),
        alone[0].reset_index(drop=True),
        alone[1].reset_index(drop=True),
        pd.concat([side[~is_single] for side, is_single in zip(sides, single, strict=True)], ignore_index=True),
        _changed(sides[0], sides[1]),
    )


def labelled(table: pd.DataFrame, first: str, second: str) -> tuple[pd.DataFrame, pd.DataFrame, tuple[str, ...]]:
    """Return the rows of two solvers of one table, or of two labels, and the columns that are then no part of the
    key.

    Two names of solvers (`x@base`, `x@head`) have all their options and routes compared; where one of them is a label
    (`nsgs[omega=1.3]`), both are. Raises CpbenchError, UnknownName.
    """
    if first == second:
        raise CpbenchError(f"'{first}' is compared with itself: name two solvers or labels of the file")
    names, labels = set(table["solver"].unique()), set(table["label"].unique())
    by_solver = {first, second} <= names
    for name in (first, second):
        if name not in (names if by_solver else labels):
            raise UnknownName("solver or label of the results", name, names | labels)
    column, loose = ("solver", ("solver",)) if by_solver else ("label", BY_LABEL)
    return table[table[column] == first], table[table[column] == second], loose


def _codes(sides: list[pd.DataFrame], key: list[str]) -> list[pd.Series[int]]:
    """Give the rows of the two sides numbers, the same for the same key."""
    both = pd.concat([side[[*key, *FINER]] for side in sides], keys=[0, 1], names=["side", None])
    code = both.groupby(key, sort=False, dropna=False).ngroup()
    for column in FINER:
        twice = pd.DataFrame({"code": code, "side": code.index.get_level_values(0)}).duplicated(keep=False)
        if not twice.any():
            break
        finer = both[column].astype(str).where(code.isin(set(code[twice])), "")
        code = pd.DataFrame({"code": code, "finer": finer}).groupby(["code", "finer"], sort=False).ngroup()
    return [cast("pd.Series[int]", code.loc[side]) for side in (0, 1)]


def _changed(base: pd.DataFrame, new: pd.DataFrame) -> tuple[str, ...]:
    """Return the names of problems whose fingerprints differ between the sides."""
    gone = base.loc[~base["fingerprint"].isin(new["fingerprint"].unique()), ["problem", "node"]].drop_duplicates()
    come = new.loc[~new["fingerprint"].isin(base["fingerprint"].unique()), ["problem", "node"]].drop_duplicates()
    return tuple(sorted(gone.merge(come, on=["problem", "node"])["problem"].unique()))
