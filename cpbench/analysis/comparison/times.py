"""Times of one pair: how much longer, within which range, and whether that is more than an accident.

The repeats of a solve give samples of its time (conversion, set-up and lift added). The ratio of a pair is that of the
geometric means of its samples, its range from the least of the new ones over the largest of the base to the largest
over the least. Repeats follow one another within milliseconds: they share whatever the machine did at that moment, and
say nothing of the next. So one pair decides by its time only where all repeats of one side are beyond all of the other
by more than the factor by which equal pairs stray (`noise.Noise`), and the processor's time, which other programs do
not lengthen, moved with it; otherwise it takes the pairs together (`suites`).
"""

from __future__ import annotations

import json
import math
from typing import TypeAlias

import numpy as np
import pandas as pd

from cpbench.analysis.comparison.gates import UNDECIDED, PairVerdict
from cpbench.analysis.comparison.noise import Noise
from cpbench.analysis.profiles import FLOOR

Floats: TypeAlias = np.ndarray[tuple[int], np.dtype[np.float64]]

COLUMNS = ("ratio", "low", "high", "below", "comparable", "significant", "time_verdict", "time_why")


def by_time(pairs: pd.DataFrame, one_machine: pd.Series[bool], noise: Noise) -> pd.DataFrame:
    """Judge the times of pairs, one row a pair.

    Columns: `ratio` new over base (NaN unless both sides were solved and timed) with its range [`low`, `high`] (NaN
    without repeats); `below`: both shorter than the floor; `comparable`: above it, taken on one machine, one at a time;
    `significant`: the sign of a difference that all repeats show, else 0; `time_verdict` ('' where not
    comparable), `time_why`.
    """
    base, new = (pairs[f"time_{side}"].to_numpy(dtype=float) for side in ("base", "new"))
    timed = np.isfinite(base) & np.isfinite(new)
    below = timed & (base < FLOOR) & (new < FLOOR)
    alone = np.ones(len(pairs), dtype=bool)
    for side in ("base", "new"):
        alone &= ~(pairs[f"jobs_{side}"] > 1).to_numpy()
    comparable = timed & ~below & alone & one_machine.to_numpy()
    ratio, low, high = _ranges(pairs, comparable)
    plain = np.divide(np.maximum(new, FLOOR), np.maximum(base, FLOOR), out=np.full(len(pairs), math.nan), where=timed)
    ratio = np.where(np.isnan(ratio), plain, ratio)
    significant = (low > 1 + noise.delta).astype(int) - (high < 1 / (1 + noise.delta)).astype(int)
    before, after = (pairs[f"cpu_{side}"].to_numpy(dtype=float) for side in ("base", "new"))
    measured = (before > 0) & (after > 0)  # of a short solve in another process the system counts no tick
    processor = np.log(np.divide(after, before, out=np.full(len(pairs), math.nan), where=measured))
    log = np.log(ratio)
    agrees = processor * np.sign(log) >= np.abs(log) / 2
    decisive = ((low > noise.strays) | (high < 1 / noise.strays)) & agrees
    within = comparable & (low >= 1 / (1 + noise.delta)) & (high <= 1 + noise.delta)
    verdict = np.full(len(pairs), UNDECIDED, dtype=object)
    verdict[comparable] = str(PairVerdict.INCONCLUSIVE)
    verdict[within & ~decisive] = str(PairVerdict.SAME)
    verdict[decisive] = np.where(log[decisive] > 0, str(PairVerdict.REGRESSED), str(PairVerdict.IMPROVED))
    judged = pd.DataFrame(
        {
            "ratio": ratio,
            "low": low,
            "high": high,
            "below": below,
            "comparable": comparable,
            "significant": significant,
            "time_verdict": verdict,
        },
        index=pairs.index,
    )
    return judged.assign(time_why=_reasons(judged, decisive, noise))


def samples_of(text: str, solve: float, time: float, flags: str) -> list[float]:
    """Return the times of one row [s]: its repeats, each with what comes before and after a solve.

    A program that remembers what it has solved has one time, its first.

    >>> samples_of("[0.25, 0.5]", 0.375, 1.375, "")
    [1.25, 1.5]
    """
    try:
        solves = json.loads(text) if text else []
    except ValueError:
        solves = []
    if "remembered" in flags.split(",") or len(solves) < 2:
        return [max(time, FLOOR)]
    return [max(float(s) + time - solve, FLOOR) for s in solves]


def _ranges(pairs: pd.DataFrame, chosen: np.ndarray) -> tuple[Floats, Floats, Floats]:
    """Return the ratio of every chosen pair that was repeated on both sides, with its range; NaN for the others."""
    ratio, low, high = (np.full(len(pairs), math.nan) for _ in range(3))
    names = [f"{column}_{side}" for side in ("base", "new") for column in ("samples", "solve", "time", "flags")]
    columns = [pairs.loc[chosen, name].tolist() for name in names]
    for at, *row in zip(np.flatnonzero(chosen).tolist(), *columns, strict=True):
        base, new = samples_of(*row[:4]), samples_of(*row[4:])
        if min(len(base), len(new)) > 1:
            ratio[at] = math.exp(np.log(new).mean() - np.log(base).mean())
            low[at], high[at] = min(new) / max(base), max(new) / min(base)
    return ratio, low, high


def _reasons(judged: pd.DataFrame, decisive: np.ndarray, noise: Noise) -> pd.Series[str]:
    """Describe the times of each comparable pair in words."""
    why = np.full(len(judged), UNDECIDED, dtype=object)
    comparable = judged["comparable"].to_numpy()
    moment = f", of one moment: one pair decides beyond {noise.strays:.3g}, with the processor's time"
    columns = [judged[name].to_numpy()[comparable].tolist() for name in ("ratio", "low", "high", "significant")]
    texts: list[str] = []
    for ratio, low, high, significant, decides in zip(*columns, decisive[comparable].tolist(), strict=True):
        interval = ", not repeated" if math.isnan(low) else f" [{low:.3g}, {high:.3g}]"
        texts.append(f"{ratio:.3g} times the time{interval}{moment if significant and not decides else ''}")
    why[comparable] = texts
    return pd.Series(why, index=judged.index, dtype=object)
