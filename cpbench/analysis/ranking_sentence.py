"""Sentence of a ranking: which solver to use, and what that rests on.

It names the first solver of the order. Where another one solves more, though not significantly more, it says which, how
much slower that is, and what the first one missed. From few problems it is a hint, and says so first.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from cpbench.analysis import table as rows_of
from cpbench.analysis.profiles import FLOOR
from cpbench.foundation.text import counted
from cpbench.verification import INACCURATE_FACTOR, Status

if TYPE_CHECKING:
    from cpbench.analysis.ranking import RankedSolver, Ranking

FEW = 10
"""From fewer problems than this the sentence is a hint."""
FASTER = 2.0
"""Another solver is named when it is so many times faster, where both solve."""
TIE = 1.1
"""Two solvers that solve as many are called equally good where their times differ by no more than this factor."""
NAMED = 2
"""The most problems that are named of those that the first solver missed."""
FALSE = "claims that fail"
"""Warning about a solver with false claims, before their number."""


@dataclass(frozen=True)
class Advice:
    """The sentence in parts: what stands before the name of the solver to use, the name ('' where no solver solved
    anything), and what follows."""

    before: str
    winner: str
    after: str

    @property
    def text(self) -> str:
        """The whole sentence."""
        return self.before + self.winner + self.after


def ratio(value: float) -> str:
    """Write how many times something is as much: two digits, all of them from 10 on, and never an exponent.

    >>> ratio(1.26), ratio(9.97), ratio(101.7), ratio(12345.6)
    ('1.3', '10', '102', '12346')
    """
    return f"{value:.2g}" if value < 10 else f"{value:.0f}"


def advice(ranking: Ranking, rows: pd.DataFrame, times: pd.DataFrame, hopeless: int, refuted: int = 0) -> Advice:
    """Return the sentence of a ranking.

    rows : those of its problems that were started. times : [s], problems × labels, ∞ where not solved, of the labels
    whose times may be compared. hopeless : problems left out, since they were proved to have no solution. refuted :
    answers that pass, and do not count, since a certificate refutes them.
    """
    noun = "problem" if ranking.cases == ranking.problems else "start"
    proved = f" {hopeless} more {'was' if hopeless == 1 else 'were'} proved to have no solution." if hopeless else ""
    if refuted:
        count = "1 answer that passes is" if refuted == 1 else f"{refuted} answers that pass are"
        proved += f" {count} refuted by a certificate and not counted."
    if not ranking.cases:
        return Advice("no problem that has a solution.", "", proved)
    first = ranking.rows[0] if ranking.rows else None
    if first is None or not first.solved + first.stationary:
        of = f"the {noun}" if ranking.cases == 1 else f"any of {counted(ranking.cases, noun)}"
        return Advice(f"no solver solved {of}{_losses(rows)}.", "", proved)
    reach = "" if first.started == ranking.cases else f" ({counted(ranking.cases, noun)} in all)"
    if len(ranking.rows) == 1:
        solved = f"it solves {first.solved} of {counted(first.counted, noun)}{reach}{_stationary(first)}"
        return Advice("only ", first.solver, f" ran: {solved}{_losses(rows)}.{proved}")
    if ranking.problems < FEW:
        before, solves = f"a hint from {ranking.problems_and_starts}: ", f" solves {first.solved} of {first.counted}"
    else:
        before, solves = "use ", f": it solves {first.solved} of {counted(first.counted, noun)}"
    parts = [f"{solves}{reach}{_stationary(first)}", *_against_others(ranking.rows, times)]
    rest = [
        ", ".join(parts),
        *_missed(ranking.rows, rows),
        *_tied(ranking.rows, times),
        *_faster(first.solver, times),
        *(f"{warning}, so check its answers" for warning in first.warnings if warning.startswith(FALSE)),
    ]
    return Advice(before, first.solver, f"{'; '.join(rest)}{_losses(rows, first.solver)}.{proved}")


def _stationary(first: RankedSolver) -> str:
    return f" and finds a stationary point of {first.stationary}" if first.stationary else ""


def _safest(ranked: Sequence[RankedSolver]) -> list[RankedSolver]:
    """Return the solvers that solve most, in their order, where that is more than the first one solves."""
    most = max(one.solved for one in ranked)
    return [one for one in ranked if one.solved == most > ranked[0].solved]


def _against_others(ranked: Sequence[RankedSolver], times: pd.DataFrame) -> list[str]:
    """Return how the first solver compares: with the one that solves most, or else with the fastest of each problem."""
    first, safest = ranked[0], _safest(ranked)
    if safest:
        other = safest[0]
        which = "the only one" if len(safest) == 1 else f"one of {len(safest)}"
        gain, _ = _speed(times, other.solver, first.solver)
        if gain > TIE:
            return [f"{ratio(gain)} times faster than {other.solver}, {which} with {other.solved}"]
        return [f"{other.solver} solves {other.solved}"]
    parts = [f"alone on {first.alone}"] if first.alone else []
    ahead = first.fastest - first.alone
    if ahead:
        return [*parts, f"fastest on {ahead}"]
    timed = not math.isnan(first.factor) and not first.alone
    return [*parts, f"{ratio(first.factor)} times the fastest"] if timed else parts


def _missed(ranked: Sequence[RankedSolver], rows: pd.DataFrame) -> list[str]:
    """Return what the first solver missed of the problems that the one with most solves."""
    safest = _safest(ranked)
    if not safest:
        return []
    solved = rows_of.solved(rows)
    theirs = rows.loc[solved & (rows["label"] == safest[0].solver), "fingerprint"]
    solver_rows = rows[(rows["label"] == ranked[0].solver) & ~solved]
    missed = solver_rows[solver_rows["fingerprint"].isin(theirs)]
    if not 0 < len(missed) <= NAMED:
        return [f"it missed {len(missed)} of those"] if len(missed) else []
    names = [f"{row['problem']} ({_how(row)})" for _, row in missed.iterrows()]
    return [f"it missed {' and '.join(names)}"]


def _how(row: pd.Series) -> str:
    """Return how a problem was missed: by which factor, where that is not large, else its status."""
    factor = float(row["error"]) / float(row["tolerance"])
    if 1.0 < factor <= INACCURATE_FACTOR and row["status"] != str(Status.LOST):
        return f"error {ratio(factor)} times the tolerance"
    return str(row["status"]).replace("_", " ")


def _tied(ranked: Sequence[RankedSolver], times: pd.DataFrame) -> list[str]:
    """Return that the second solver is as good as the first: it solves as many, in nearly the same time."""
    first, second = ranked[:2]
    slower, _ = _speed(times, second.solver, first.solver)
    if second.solved != first.solved or not first.solved or not 1 / TIE <= slower <= TIE:
        return []
    return [f"{second.solver} is as good: {second.solved} solved in {slower:.2f} times the time"]


def _faster(first: str, times: pd.DataFrame) -> list[str]:
    """Return the solver most times faster than the first, of those that solve at least half of what it solves; nothing
    where that is not much."""
    if first not in times.columns:
        return []
    solved = int(np.isfinite(times[first]).sum())
    gains = [(*_speed(times, first, label), str(label)) for label in times.columns if label != first]
    enough = [(-gain, label, both) for gain, both, label in gains if both and 2 * both >= solved]
    gain, label, both = min(enough, default=(0.0, "", 0))
    return [f"{label} is {ratio(-gain)} times faster on the {both} that both solve"] if -gain >= FASTER else []


def _speed(times: pd.DataFrame, slow: str, fast: str) -> tuple[float, int]:
    """Return the time of one label over that of another, geometric mean where both solve, and on how many; NaN where
    that is none."""
    if not {slow, fast} <= set(times.columns):
        return math.nan, 0
    logs = np.log(np.maximum(times[[slow, fast]].to_numpy(dtype=float), FLOOR))
    both = np.isfinite(logs).all(axis=1)
    return (float(np.exp((logs[both, 0] - logs[both, 1]).mean())) if both.any() else math.nan), int(both.sum())


def _losses(rows: pd.DataFrame, solver: str = "") -> str:
    """Return which routes lost how many answers, of one solver or of all; '' where none did."""
    lost = rows[(rows["status"] == str(Status.LOST)) & ((rows["label"] == solver) if solver else True)]
    if not len(lost):
        return ""
    counts = lost[["route", "label"]].value_counts(sort=False)
    return "; " + ", ".join(
        f"{route or 'the conversion'} lost {counted(int(count), 'answer')} of {label}"
        for (route, label), count in sorted(counts.items())  # type: ignore[misc]
    )
