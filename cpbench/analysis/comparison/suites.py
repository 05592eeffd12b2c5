"""All pairs of a label together: the geometric mean of new over base times, and what it allows to say.

    L_p = log(t_new / t_base),     log of the mean  L̄ = mean over the pairs solved on both sides.

Its interval resamples *families* (`analysis.bootstrap`), since the problems of one resemble each other, and holds the
bias of a worker process (`noise`) beside it: a process's own factor is shared by all its problems, so that no number of
them averages it away. The level is shared by the labels (Bonferroni).

Regressed: the interval excludes 1 and the mean is beyond 1 + δ. Same: the interval of the families alone lies within
[1/(1+δ), 1+δ]. Anything else is inconclusive, with what would decide it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from statistics import NormalDist

import numpy as np
import pandas as pd
from scipy.special import stdtrit

from cpbench.analysis import bootstrap
from cpbench.analysis.comparison.gates import PairVerdict
from cpbench.analysis.comparison.noise import Noise

LEVEL = 0.95
FEWEST = 6
"""Pairs below which times decide nothing."""
MANY = 10
"""Times as many problems as there are: the most that is asked for."""
_Z = NormalDist().inv_cdf((1 + LEVEL) / 2)


@dataclass(frozen=True)
class Suite:
    """A label over all its pairs.

    Attributes
    ----------
    label : of the new side. pairs : compared. solved_base, solved_new, both : verified as solved.
    below : solved on both sides in less than the floor, reported and left out of what follows.
    timed : pairs in the mean, of `families` families. ratio, low, high : geometric mean of new over base, interval over
    the families. apart : whether 1 is outside of the interval that has the bias of a process, too.
    time : verdict on the times, None where none could be compared. why : its reason, and what would decide it.
    counts : verdicts on pairs.
    """

    label: str
    pairs: int
    solved_base: int
    solved_new: int
    both: int
    below: int
    timed: int
    families: int
    ratio: float
    low: float
    high: float
    apart: bool
    time: PairVerdict | None
    why: str
    counts: dict[PairVerdict, int]


def by_label(pairs: pd.DataFrame, noise: Noise, alpha: float, seed: int) -> tuple[Suite, ...]:
    """Return the suites of judged pairs (`comparison.compare`), in order of label; `alpha` is for all of them."""
    parts = list(pairs.groupby("label_new", sort=True))
    return tuple(_measured(str(label), of_label, noise, alpha / len(parts), seed) for label, of_label in parts)


def mean_ratio(
    ratios: pd.Series[float], families: pd.Series[str], problems: pd.Series[str], seed: int = 0
) -> tuple[float, float, float, int]:
    """Return the geometric mean, interval and number of families; NaN where one problem leaves no interval.

    Problems of one family only are resampled one by one. A problem without a family is one by itself.

    >>> mean, low, high, count = mean_ratio(pd.Series([2.0, 2.0]), pd.Series(["x", "y"]), pd.Series(["p", "q"]))
    >>> (round(mean, 12), round(low, 12), round(high, 12)), count
    ((2.0, 2.0, 2.0), 2)
    """
    cluster = families.where(families != "", problems)
    count = cluster.nunique()
    if count < 2:
        cluster = problems
    logs, k = np.log(ratios.to_numpy(dtype=float))[:, None], cluster.nunique()
    codes = pd.factorize(cluster, sort=True)[0]
    mean = bootstrap.intervals(logs, np.ones_like(logs), (codes, k), level=LEVEL, seed=seed, expanded=False)
    estimate, low, high = (float(mean.at[0, name]) for name in ("estimate", "low", "high"))
    wider = float(stdtrit(k - 1, (1 + LEVEL) / 2)) / _Z * math.sqrt(k / (k - 1)) if k > 1 else math.nan
    ends = (math.exp(estimate + wider * (end - estimate)) for end in (low, high))
    return math.exp(estimate), *ends, count  # type: ignore[return-value]


def _measured(label: str, of_label: pd.DataFrame, noise: Noise, alpha: float, seed: int) -> Suite:
    timed = of_label[of_label["comparable"]]
    ratio = low = high = math.nan
    families, apart = 0, False
    if len(timed):
        ratio, low, high, families = mean_ratio(timed["ratio"], timed["family"], timed["fingerprint"], seed)
        reach = noise.reach((math.log(high) - math.log(low)) / (2 * _Z), alpha)
        apart = len(timed) >= FEWEST and abs(math.log(ratio)) > reach and not low <= 1 <= high
    counts = of_label["verdict"].value_counts()
    suite = Suite(
        label=label,
        pairs=len(of_label),
        solved_base=int(of_label["solved_base"].sum()),
        solved_new=int(of_label["solved_new"].sum()),
        both=int((of_label["solved_base"] & of_label["solved_new"]).sum()),
        below=int(of_label["below"].sum()),
        timed=len(timed),
        families=families,
        ratio=ratio,
        low=low,
        high=high,
        apart=apart,
        time=None,
        why="",
        counts={verdict: int(counts.get(str(verdict), 0)) for verdict in PairVerdict},
    )
    return _with_verdict(suite, noise) if suite.timed else suite


def _with_verdict(suite: Suite, noise: Noise) -> Suite:
    edge = 1 + noise.delta
    if suite.apart and (suite.ratio > edge or suite.ratio < 1 / edge):
        verdict = PairVerdict.REGRESSED if suite.ratio > 1 else PairVerdict.IMPROVED
        return replace(suite, time=verdict)
    near = 1 + noise.margin  # a noisy machine does not make two times the same
    if 1 / near <= suite.low and suite.high <= near:
        return replace(suite, time=PairVerdict.SAME)
    return replace(suite, time=PairVerdict.INCONCLUSIVE, why=_wanting(suite, noise))


def _wanting(suite: Suite, noise: Noise) -> str:
    """Return what would decide an open verdict."""
    if suite.timed < FEWEST:
        return f"at least {FEWEST} problems that both sides solve would decide, or more repeats"
    if not math.isfinite(suite.low):
        return "more problems would decide: one leaves no interval"
    if suite.ratio > 1 + noise.delta or suite.ratio < 1 / (1 + noise.delta):
        if suite.low > 1 or suite.high < 1:
            return (
                f"beyond {noise.delta:.1%}, but one process beside another differs by {noise.bias:.1%} by itself: "
                "another run, with other processes, would decide"
            )
        return "beyond the margin, but not on every family alike: more problems, of more families, would decide"
    if noise.delta > noise.margin:
        return f"equal code differs by {noise.delta:.1%} here: a quieter machine would decide"
    need = (math.log(suite.high / suite.low) / 2 / math.log1p(noise.delta)) ** 2
    if need > MANY:
        return "times vary too much for these problems: a quieter machine, or more repeats, would decide"
    if need > 1:
        return (
            f"about {math.ceil(2 * need) / 2:g} times as many problems, more repeats or a quieter machine would decide"
        )
    return "near the margin: more problems, or another --margin, would decide"
