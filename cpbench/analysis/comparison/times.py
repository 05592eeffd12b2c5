"""Times of one pair: how much longer, within which interval, and whether that is more than an accident.

The repeats of a solve give samples of its time (conversion, set-up and lift added). Ratio, interval and p of a pair are
of one kind. With at least five samples on both sides: the median of all quotients new/base (Hodges and Lehmann, Ann.
Math. Statist. 34 (1963)), the interval of ranks that inverts Mann and Whitney's U (Hollander, Wolfe and Chicken 2014,
§4.3), and U's p. With two to four: the quotient of geometric means, with Welch's t on the logarithms (Biometrika 34
(1947)). With one: the quotient alone. In simulations of equal lognormal samples the intervals hold 95 to 97 % by ranks,
and 96 to 98 % by Welch. p-values of all pairs are adjusted after Benjamini and Hochberg, J. R. Statist. Soc. B 57
(1995).

Repeats follow one another within milliseconds: they share whatever the machine did at that moment, and say nothing of
the next. So one pair decides by its time only beyond the factor by which equal pairs stray (`noise.Noise`), and only
where the processor's time, which other programs do not lengthen, moved with it; otherwise it takes the pairs together
(`suites`).
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from functools import lru_cache
from typing import TypeAlias

import numpy as np
import pandas as pd
from scipy import stats

from cpbench.analysis.comparison.gates import UNDECIDED, PairVerdict
from cpbench.analysis.comparison.noise import Noise
from cpbench.analysis.profiles import FLOOR

Floats: TypeAlias = np.ndarray[tuple[int], np.dtype[np.float64]]

ENOUGH = 5
"""Samples a side from which on ranks are compared."""
MANY = 2500
"""Pairs of samples beyond which the law of U is taken as normal."""
LEVEL = 0.95
COLUMNS = ("ratio", "low", "high", "p", "below", "comparable", "significant", "time_verdict", "time_why")


def by_time(pairs: pd.DataFrame, one_machine: pd.Series[bool], noise: Noise, alpha: float) -> pd.DataFrame:
    """Judge the times of pairs, one row a pair.

    Columns: `ratio` new over base (NaN unless both sides were solved and timed) with its interval [`low`, `high`] (NaN
    without repeats) and `p` (adjusted), as the module says; `below`: both shorter than the floor; `comparable`: above
    it, taken on one machine, one at a time, by cpbench; `significant`: the sign of a difference that the samples show,
    else 0; `time_verdict` ('' where not comparable), `time_why`.
    """
    base, new = (pairs[f"time_{side}"].to_numpy(dtype=float) for side in ("base", "new"))
    timed = np.isfinite(base) & np.isfinite(new)
    ratio = np.divide(np.maximum(new, FLOOR), np.maximum(base, FLOOR), out=np.full(len(pairs), math.nan), where=timed)
    below = timed & (base < FLOOR) & (new < FLOOR)
    alone = np.ones(len(pairs), dtype=bool)
    for side in ("base", "new"):
        alone &= ~(pairs[f"jobs_{side}"] > 1).to_numpy() & (pairs[f"origin_{side}"] == "").to_numpy()
    comparable = timed & ~below & alone & one_machine.to_numpy()
    estimate, low, high, p = _tested(pairs, comparable)
    ratio = np.where(np.isnan(estimate), ratio, estimate)
    p[comparable] = adjusted(p[comparable])
    log = np.log(ratio)
    significant = np.where(comparable & (p < alpha) & (np.abs(log) > math.log1p(noise.delta)), np.sign(log), 0.0)
    before, after = (pairs[f"cpu_{side}"].to_numpy(dtype=float) for side in ("base", "new"))
    measured = (before > 0) & (after > 0)  # of a short solve in another process the system counts no tick
    processor = np.log(np.divide(after, before, out=np.full(len(pairs), math.nan), where=measured))
    agrees = processor * np.sign(log) >= np.abs(log) / 2
    decisive = (significant != 0) & (np.abs(log) > math.log(noise.strays)) & agrees
    within = comparable & (low >= 1 / (1 + noise.delta)) & (high <= 1 + noise.delta)
    verdict = np.full(len(pairs), UNDECIDED, dtype=object)
    verdict[comparable] = str(PairVerdict.INCONCLUSIVE)
    verdict[within & ~decisive] = str(PairVerdict.SAME)
    verdict[decisive] = np.where(log[decisive] > 0, str(PairVerdict.REGRESSED), str(PairVerdict.IMPROVED))
    found = pd.DataFrame(
        {
            "ratio": ratio,
            "low": low,
            "high": high,
            "p": p,
            "below": below,
            "comparable": comparable,
            "significant": significant.astype(int),
            "time_verdict": verdict,
        },
        index=pairs.index,
    )
    return found.assign(time_why=_reasons(found, decisive, noise))


def adjusted(p: Floats) -> Floats:
    """Adjust p-values for the rate of false discoveries; NaN where there was no test.

    >>> adjusted(np.array([0.01, 0.04, math.nan])).tolist()
    [0.02, 0.04, nan]
    """
    result = p.copy()
    known = np.isfinite(p)
    if known.any():
        result[known] = stats.false_discovery_control(p[known], method="bh")
    return result


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


def _tested(pairs: pd.DataFrame, chosen: np.ndarray) -> tuple[Floats, Floats, Floats, Floats]:
    """Test every chosen pair: ratio, its interval and p; pairs of equally many samples are tested in one go."""
    ratio, low, high, p = (np.full(len(pairs), math.nan) for _ in range(4))
    places: dict[tuple[int, int], list[int]] = {}
    taken: dict[int, tuple[list[float], list[float]]] = {}
    names = [f"{column}_{side}" for side in ("base", "new") for column in ("samples", "solve", "time", "flags")]
    columns = [pairs.loc[chosen, name].tolist() for name in names]
    for at, *row in zip(np.flatnonzero(chosen).tolist(), *columns, strict=True):
        taken[at] = samples_of(*row[:4]), samples_of(*row[4:])
        places.setdefault((len(taken[at][0]), len(taken[at][1])), []).append(at)
    for counts, where in places.items():
        if min(counts) < 2:
            continue
        x, y = (np.log(np.array([taken[at][side] for at in where])) for side in (0, 1))
        if min(counts) >= ENOUGH:
            ratio[where], low[where], high[where] = ranked(x, y)
            p[where] = stats.mannwhitneyu(x, y, axis=1, alternative="two-sided").pvalue
        else:
            low[where], high[where], p[where] = _welch(x, y)
            ratio[where] = np.sqrt(low[where] * high[where])
    return ratio, low, high, p


def ranked(x: np.ndarray, y: np.ndarray) -> tuple[Floats, Floats, Floats]:
    """Return the ratio and interval by the ranks of all differences y − x, of rows of logarithms."""
    n, m = x.shape[1], y.shape[1]
    gaps = np.sort((y[:, :, None] - x[:, None, :]).reshape(len(x), n * m), axis=1)
    beyond = _beyond(min(n, m), max(n, m))
    return np.exp(np.median(gaps, axis=1)), np.exp(gaps[:, beyond - 1]), np.exp(gaps[:, n * m - beyond])


@lru_cache(maxsize=256)
def _beyond(n: int, m: int) -> int:
    """Return the rank at which an interval begins: the largest k with P(U ≤ k − 1) ≤ (1 − LEVEL)/2, of U between
    samples of n ≤ m; of many samples by the normal law.
    """
    tail = (1 - LEVEL) / 2
    if n * m > MANY:
        return int(n * m / 2 - stats.norm.ppf(1 - tail) * math.sqrt(n * m * (n + m + 1) / 12))
    ways = [1] + [0] * (n * m)  # coefficients of the Gaussian binomial, Π (1 − q^(m+i)) / (1 − q^i)
    for i in range(1, n + 1):
        for u in range(n * m, m + i - 1, -1):
            ways[u] -= ways[u - m - i]
        for u in range(i, n * m + 1):
            ways[u] += ways[u - i]
    least = tail * math.comb(n + m, n)
    return int(np.searchsorted(np.cumsum(np.array(ways, dtype=float)), least, side="right"))


def _welch(x: np.ndarray, y: np.ndarray) -> tuple[Floats, Floats, Floats]:
    """Return the interval of the ratio of geometric means and p by Welch's t, of rows of logarithms.

    Samples that do not vary at all are given the resolution of the clock.
    """
    n, m = x.shape[1], y.shape[1]
    least = 1e-12
    u, v = x.var(axis=1, ddof=1) / n + least, y.var(axis=1, ddof=1) / m + least
    freedom = (u + v) ** 2 / (u**2 / (n - 1) + v**2 / (m - 1))
    gap = y.mean(axis=1) - x.mean(axis=1)
    error = np.sqrt(u + v)
    half = stats.t.ppf((1 + LEVEL) / 2, freedom) * error
    return np.exp(gap - half), np.exp(gap + half), 2 * stats.t.sf(np.abs(gap) / error, freedom)


def _reasons(found: pd.DataFrame, decisive: np.ndarray, noise: Noise) -> pd.Series[str]:
    """Describe the times of each comparable pair in words."""
    why = np.full(len(found), UNDECIDED, dtype=object)
    comparable = found["comparable"].to_numpy()
    moment = f", of one moment: one pair decides beyond {noise.strays:.3g}, with the processor's time"
    columns = [found[name].to_numpy()[comparable].tolist() for name in ("ratio", "low", "high", "significant")]
    texts: list[str] = []
    for ratio, low, high, significant, decides in zip(*columns, decisive[comparable].tolist(), strict=True):
        interval = ", not repeated" if math.isnan(low) else f" [{low:.3g}, {high:.3g}]"
        texts.append(f"{ratio:.3g} times the time{interval}{moment if significant and not decides else ''}")
    why[comparable] = texts
    return pd.Series(why, index=found.index, dtype=object)


def holm(p: Sequence[float]) -> list[float]:
    """Adjust p-values after Holm, Scand. J. Statist. 6 (1979); NaN where there was no test.

    >>> holm([0.01, 0.04, 0.03, math.nan])
    [0.03, 0.06, 0.06, nan]
    """
    known = sorted((value, at) for at, value in enumerate(p) if not math.isnan(value))
    result, largest = [math.nan] * len(p), 0.0
    for rank, (value, at) in enumerate(known):
        largest = max(largest, min(1.0, (len(known) - rank) * value))
        result[at] = largest
    return result
