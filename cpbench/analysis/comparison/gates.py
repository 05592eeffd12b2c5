"""Gates that compare what is not random first: status, then verified error, then counters.

Each gate takes pairs (`pairs.Matched.pairs`) and rules on those it can tell something of; what it leaves undecided is
for the next one. A status that got worse is a regression of its kind and never a ratio.
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Mapping
from enum import StrEnum
from functools import lru_cache

import numpy as np
import pandas as pd

from cpbench.analysis.participation import REFUSED
from cpbench.verification import CHARGED_TO_ROUTE, MET_TOLERANCE, PROVEN, Status


class PairVerdict(StrEnum):
    """Verdict on a pair, a label or two tables. `inconclusive` is one of the outcomes: shown, with what would decide
    it."""

    REGRESSED = "regressed"
    INCONCLUSIVE = "inconclusive"
    SAME = "same"
    IMPROVED = "improved"


UNDECIDED = ""
SETTLED = (*MET_TOLERANCE, *PROVEN)
"""Statuses of a problem that is done with: an answer that was verified, or a proof that there is none."""
WORST = (str(Status.WRONG), str(Status.CRASH))
"""Statuses that are worse than other ways not to solve a problem."""
UNCHARGED = (*CHARGED_TO_ROUTE, str(Status.UNRESOLVABLE))
"""Statuses of failures that are not a solver's fault: a change among these is neither better nor worse."""
DECADE = 10.0
"""Factor between errors beyond the tolerance that counts."""
FIRST = "iterations"
"""The counter that is looked at first."""


def rulings(pairs: pd.DataFrame) -> pd.DataFrame:
    """Create an empty ruling for every pair: verdict, gate, kind, why."""
    return pd.DataFrame(dict.fromkeys(("verdict", "gate", "kind", "why"), UNDECIDED), index=pairs.index)


def rule(
    ruling: pd.DataFrame, gate: str, verdict: PairVerdict, where: pd.Series[bool], kind: object, why: object
) -> None:
    """Enter a verdict for the pairs `where` it holds, of all or of some, and nothing was ruled before; `kind` and
    `why` are texts, or series of them."""
    chosen = where.index[where]
    chosen = chosen[(ruling.loc[chosen, "verdict"] == UNDECIDED).to_numpy()]
    if chosen.empty:
        return
    for column, value in {"verdict": str(verdict), "gate": gate, "kind": kind, "why": why}.items():
        ruling.loc[chosen, column] = value[chosen] if isinstance(value, pd.Series) else value


def by_status(pairs: pd.DataFrame, ruling: pd.DataFrame, stray: float) -> None:
    """Rule by status, in place.

    `stray` : the factor by which one time strays by itself. A solve that ended that near to the limit on one side,
    and over it on the other, does not change the status.
    """
    pairs = pairs[pairs["status_base"] != pairs["status_new"]]
    if pairs.empty:  # texts of no rows have no type that pandas could join
        return
    base, new = pairs["status_base"], pairs["status_new"]
    change = base.str.replace("_", " ") + " → " + new.str.replace("_", " ")
    message = pairs["message_new"].where(new.isin(REFUSED), pairs["message_base"])
    reason = change + message.where(message == "", ": " + message)
    rule(ruling, "status", PairVerdict.INCONCLUSIVE, base.isin(REFUSED) ^ new.isin(REFUSED), "not compared", reason)
    for limit, status in (("seconds", Status.TIMEOUT), ("memory", Status.MEMOUT)):
        other = differ(pairs, limit) & ((base == status) ^ (new == status))
        rule(
            ruling,
            "status",
            PairVerdict.INCONCLUSIVE,
            other,
            "other limits",
            change + f", under another limit ({limit})",
        )
    done, was = new.isin(SETTLED), base.isin(SETTLED)
    contradiction = done & was & (base.isin(PROVEN) | new.isin(PROVEN))
    why = change + ": both were verified, so one of the two tolerances is too loose for this problem"
    rule(ruling, "status", PairVerdict.INCONCLUSIVE, contradiction, "contradiction", why)
    for timed_out, status, side in ((was & ~done, new, "base"), (done & ~was, base, "new")):
        near = timed_out & (status == Status.TIMEOUT) & (pairs[f"solve_{side}"] * stray >= pairs[f"seconds_{side}"])
        why = change + f", within a factor {stray:.3g} of the limit, as far as one time strays"
        rule(ruling, "status", PairVerdict.INCONCLUSIVE, near, "at the limit", why)
    rule(ruling, "status", PairVerdict.REGRESSED, was & ~done, new, change)
    rule(ruling, "status", PairVerdict.IMPROVED, done & ~was, base, change)
    less = done & was & (new == Status.STATIONARY)
    more = done & was & (base == Status.STATIONARY)
    rule(ruling, "status", PairVerdict.REGRESSED, less, new, change)
    rule(ruling, "status", PairVerdict.IMPROVED, more, base, change)
    neither = ~done & ~was
    rule(ruling, "status", PairVerdict.REGRESSED, neither & new.isin(WORST), new, change)
    rule(ruling, "status", PairVerdict.IMPROVED, neither & base.isin(WORST), base, change)
    charged = neither & base.isin(UNCHARGED) & new.isin(UNCHARGED)
    rule(ruling, "status", PairVerdict.INCONCLUSIVE, charged, "charged elsewhere", change)


def by_error(pairs: pd.DataFrame, ruling: pd.DataFrame) -> None:
    """Rule by the error that was verified, of answers that solve the problem on neither side: within the tolerance
    all are equal, beyond it a factor of 10 counts.
    """
    floor = pairs["tolerance"].astype(float)
    base, new = (pairs[f"error_{side}"].astype(float).clip(lower=floor) for side in ("base", "new"))
    apart = np.isfinite(base) & np.isfinite(new) & ((new > DECADE * base) | (base > DECADE * new))
    base, new = base[apart], new[apart]
    why = "error " + base.map("{:.1e}".format).astype(str) + " → " + new.map("{:.1e}".format).astype(str)
    rule(ruling, "error", PairVerdict.REGRESSED, new > base, "error", why)
    rule(ruling, "error", PairVerdict.IMPROVED, base > new, "error", why)


def by_counters(
    pairs: pd.DataFrame, margin: float, left_out: Collection[tuple[str, str]] = frozenset()
) -> pd.DataFrame:
    """Judge the counters of pairs solved on both sides: verdict ('' where none is common), why.

    A counter moved when it changed by more than `margin` relative to the smaller side, and by more than 1. `iterations`
    is looked at first, then the others by name; counters that moved apart leave the pair inconclusive.
    `left_out` : (solver without its variant, counter) that are not the same from run to run.
    """
    result = pd.DataFrame({"verdict": UNDECIDED, "why": UNDECIDED}, index=pairs.index)
    solved = pairs["status_base"].isin(MET_TOLERANCE) & pairs["status_new"].isin(MET_TOLERANCE)
    texts = pairs.loc[solved, ["solver", "counters_base", "counters_new"]]
    code = texts.groupby(list(texts), sort=False).ngroup().to_numpy()
    cases = texts[~pd.Series(code).duplicated().to_numpy()].itertuples(index=False, name=None)
    ruled = np.array([_moved(*case, margin, left_out) for case in cases], dtype=object).reshape(-1, 2)
    result.loc[solved, ["verdict", "why"]] = ruled[code]
    return result


def unsteady(pairs: pd.DataFrame, margin: float) -> frozenset[tuple[str, str]]:
    """Find (solver without its variant, counter) that moved between two sides of the same code: they prove nothing."""
    moved: set[tuple[str, str]] = set()
    columns = ["solver", "counters_base", "counters_new"]
    for solver, base, new in pairs[columns].drop_duplicates().itertuples(index=False, name=None):
        moved |= {(_base(solver), name) for name in _changes(_read(base), _read(new), margin)}
    return frozenset(moved)


def _base(solver: str) -> str:
    """Return `x` of `x@head`."""
    return solver.partition("@")[0]


def _moved(solver: str, base: str, new: str, margin: float, left_out: Collection[tuple[str, str]]) -> tuple[str, str]:
    before, after = (
        {name: count for name, count in _read(text).items() if (_base(solver), name) not in left_out}
        for text in (base, new)
    )
    if not before.keys() & after.keys():
        return UNDECIDED, ""
    changes = _changes(before, after, margin)
    if not changes:
        return str(PairVerdict.SAME), ""
    names = sorted(changes, key=lambda name: (name != FIRST, name))
    why = ", ".join(f"{name} {before[name]:g} → {after[name]:g}" for name in names[:3])
    if len(set(changes.values())) > 1:
        return str(PairVerdict.INCONCLUSIVE), f"counters moved apart: {why}"
    return str(PairVerdict.REGRESSED if changes[names[0]] > 0 else PairVerdict.IMPROVED), why


def _changes(before: Mapping[str, float], after: Mapping[str, float], margin: float) -> dict[str, int]:
    """Return sign of the change of the common counters that moved."""
    changes: dict[str, int] = {}
    for name in before.keys() & after.keys():
        gap = after[name] - before[name]
        if abs(gap) > 1 and abs(gap) > margin * min(abs(before[name]), abs(after[name])):
            changes[name] = 1 if gap > 0 else -1
    return changes


@lru_cache(maxsize=2**14)
def _read(text: str) -> Mapping[str, float]:
    """Parse the counters of a row; drop what is not a number."""
    try:
        read = json.loads(text) if text else {}
    except ValueError:
        return {}
    items = read.items() if isinstance(read, dict) else ()
    return {str(k): float(v) for k, v in items if isinstance(v, int | float) and math.isfinite(v)}


def differ(pairs: pd.DataFrame, column: str) -> pd.Series[bool]:
    """Return whether a limit is known on both sides and differs."""
    base, new = pairs[f"{column}_base"], pairs[f"{column}_new"]
    return base.notna() & new.notna() & (base != new)
