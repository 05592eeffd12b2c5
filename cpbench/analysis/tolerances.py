"""The rows of a run as they would be judged at another tolerance.

An answer was measured once, and its error can be held against any tolerance ε: it is *solved* when the error is at
most ε, whatever was asked for. What was measured on the solver's own problem is held against ε in the proportion in
which the solver was asked for more or less there. What it cost stays the cost of the solve that was asked for the
planned tolerance: a solver that is asked for a looser one may stop earlier, and at a tighter one it may go on. So this
ranks what was delivered; what would have been needed, histories tell (`histories.times_to`) or a run at that tolerance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pandas as pd

from cpbench.analysis import table as rows_of
from cpbench.analysis.reliability import JUDGED
from cpbench.analysis.table import Integers
from cpbench.formulations.base import Kind
from cpbench.verification import INACCURATE_FACTOR, PROVEN, TARGET_UNRESOLVABLE, Status, Verdict, status

UNCLAIMED = "inaccurate"
"""Claim of an iterate that was read off a history: no solver claimed that it is right."""


@dataclass(frozen=True)
class Ladders:
    """Statuses of each row at any tolerance ε.

    Attributes
    ----------
    error : least ε at which the answer is solved. met : least ε at which the solver's own target is, ∞ where that is
    not known. code : place of the row's outcomes in `outcomes`: where it is solved, else where its target is met, else
    within INACCURATE_FACTOR of either, else.
    """

    error: rows_of.Floats
    met: rows_of.Floats
    code: Integers
    outcomes: tuple[tuple[str, str, str, str], ...]

    def rungs(self, tolerance: float) -> Integers:
        """Return the place of each row's status at a tolerance among its outcomes."""
        near = np.minimum(self.error, self.met) <= INACCURATE_FACTOR * tolerance
        return np.select([self.error <= tolerance, self.met <= tolerance, near], [0, 1, 2], default=3)

    def at(self, tolerance: float) -> np.ndarray[tuple[int], np.dtype[np.object_]]:
        """Return the statuses at a tolerance."""
        return np.array(self.outcomes, dtype=object).reshape(-1, 4)[self.code, self.rungs(tolerance)]


def judged_at(table: pd.DataFrame, tolerance: float) -> pd.DataFrame:
    """Return the table with the statuses, and the tolerance, that its errors have at `tolerance`.

    A checked proof that there is no solution stays what it is, and so do whatever came to no answer in time and what
    rounding decides, for the size of its noise is not recorded. Raises ValueError when the tolerance is not positive.

    >>> rows = pd.DataFrame({"status": ["solved", "solved", "wrong", "timeout", "solved"], "flags": "",
    ...     "claim": ["solved", "solved", "solved", "", "max_iter"], "error": [1e-9, 1e-7, 1e-3, 1.0, 1e-7]})
    >>> judged_at(rows, 1e-8)["status"].tolist()
    ['solved', 'inaccurate', 'wrong', 'timeout', 'max_iter']
    >>> judged_at(rows, 1e-2)["status"].tolist()
    ['solved', 'solved', 'solved', 'timeout', 'solved']
    """
    if not tolerance > 0:
        raise ValueError(f"tolerance of {tolerance}: must be positive")
    return table.assign(status=ladders(table).at(tolerance), tolerance=tolerance)


def ladders(table: pd.DataFrame) -> Ladders:
    """Return the status of each row at any tolerance."""
    there, tolerance = _numbers(table, "target_error", math.nan), _numbers(table, "tolerance", 1.0)
    met = there * tolerance / _numbers(table, "target_tolerance", tolerance)
    known = ~np.isnan(there)
    facts = pd.DataFrame({name: _words(table, name) for name in ("status", "claim", "kind", "flags")}).assign(
        known=known
    )
    case = facts.groupby(list(facts), sort=False).ngroup().to_numpy(dtype=np.int64)
    found = [_outcomes(*one) for one in facts.drop_duplicates().itertuples(index=False, name=None)]
    outcomes = tuple(dict.fromkeys(found))
    code = np.array([outcomes.index(one) for one in found], dtype=np.int64)[case]
    return Ladders(_numbers(table, "error", math.inf), np.where(known, met, math.inf), code, outcomes)


def _outcomes(was: str, claim: str, kind: str, flags: str, known: bool) -> tuple[str, str, str, str]:
    """Return the status of a row where it is solved, where only its target is met, where it is near, and beyond."""
    if was not in JUDGED or was in PROVEN:
        return was, was, was, was
    marks = {*flags.split(","), *(["stationary"] if was == Status.STATIONARY else [])}
    there = ("unresolvable",) if TARGET_UNRESOLVABLE in marks else ()
    met, near, far = 0.5, 0.5 * INACCURATE_FACTOR, math.inf

    def outcome(error: float, target: float) -> str:
        own = Verdict(1.0, target <= 1.0 and not there, target, flags=there) if known else None
        solved = error <= 1.0 and "unresolvable" not in marks
        verdict = Verdict(1.0, solved, error, flags=tuple(marks))
        return str(status(verdict, claim or UNCLAIMED, kind=Kind(kind or Kind.EQUIVALENT), target=own))

    return outcome(met, met), outcome(far, met), outcome(near, near), outcome(far, far)


def _numbers(table: pd.DataFrame, name: str, missing: float | rows_of.Floats) -> rows_of.Floats:
    values = table[name].to_numpy(dtype=float) if name in table else np.full(len(table), math.nan)
    return np.where(np.isnan(values), missing, values)


def _words(table: pd.DataFrame, name: str) -> list[str]:
    return list(table[name].fillna("").astype(str)) if name in table else [""] * len(table)
