"""The virtual best: a solver that takes, for each problem, whichever label was fastest; and which labels it needs.

    t*_p = min_s t[p, s],        gap of s on p: t[p, s] / t*_p ≥ 1,        without s: t*_p(−s) = min_{k ≠ s} t[p, k]

No choice does better than t* by choosing among these labels, and a label that is slow on the whole may still be the
one that the choice needs: its *marginal contribution* is what the virtual best loses without it (Xu, Hutter, Hoos and
Leyton-Brown, SAT 2012). A matrix holds times [s], problems × labels, ∞ or NaN where the pair is not verified.
"""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

from cpbench.analysis.means import Array, values
from cpbench.analysis.profiles import FLOOR, ratios

WITHIN = 2.0
"""Not more than this many times the virtual best is near to it."""


def gaps(times: pd.DataFrame, floor: float = FLOOR, lost: pd.DataFrame | None = None) -> pd.DataFrame:
    """Compare each label with the virtual best of all, one row a label (sorted).

    Columns, N being the rows of the matrix without those of which a conversion `lost` the answer (`table.lost`):
    planned (N), solved, fastest (where it shares the lead), within (fraction of the N within WITHIN times the best);
    median and mean (geometric) of its ratio to the best over the problems that it solved, NaN without any;
    alone (problems that only it solves) and marginal (factor by which the virtual best is slower without it, geometric
    mean over the problems that others solve too; 1 says that it is never missed).

    >>> times = pd.DataFrame({"a": [1.0, 1.0, math.inf], "b": [4.0, 1.0, 2.0]})
    >>> gaps(times)[["solved", "fastest", "within", "mean", "alone", "marginal"]].round(2).to_numpy().tolist()
    [[2.0, 2.0, 0.67, 1.0, 0.0, 1.59], [3.0, 2.0, 0.67, 1.59, 1.0, 1.0]]
    """
    ordered = times[sorted(times.columns)]
    labels = pd.Index([str(label) for label in ordered.columns], name="label")
    ratio = ratios(ordered, floor).to_numpy()
    done = np.isfinite(ratio)
    without = 0 if lost is None else lost.reindex(columns=ordered.columns, fill_value=False).sum().to_numpy(dtype=int)
    planned = np.broadcast_to(len(times) - without, (len(labels),))
    alone, marginal = _marginal(np.maximum(values(ordered), floor))
    return pd.DataFrame(
        {
            "planned": planned,
            "solved": done.sum(axis=0),
            "fastest": (ratio <= 1.0).sum(axis=0),
            "within": (ratio <= WITHIN).sum(axis=0) / np.where(planned > 0, planned, math.nan),
            "median": pd.DataFrame(np.where(done, ratio, math.nan)).median().to_numpy(),
            "mean": _log_mean(ratio, done),
            "alone": alone,
            "marginal": marginal,
        },
        index=labels,
    )


def _marginal(seconds: Array) -> tuple[Array, Array]:
    """Count by label the problems that no other label solves, and how much slower the others' best is on those it
    leads.
    """
    problems, labels = seconds.shape
    if labels < 2 or not problems:
        return np.isfinite(seconds).sum(axis=0), np.full(labels, math.nan)
    two = np.partition(seconds, 1, axis=1)[:, :2]
    first, second = two[:, [0]], two[:, [1]]
    leading = seconds == first
    alone = leading & np.isfinite(first) & np.isinf(second)
    slower = np.divide(second, first, out=np.ones_like(first), where=np.isfinite(second))
    return alone.sum(axis=0), _log_mean(np.where(leading, slower, 1.0), np.isfinite(first) & ~alone)


def _log_mean(ratio: Array, where: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]) -> Array:
    """Return the geometric mean of the chosen entries of each column, NaN of none."""
    count = where.sum(axis=0)
    total = np.log(np.where(where, ratio, 1.0)).sum(axis=0)
    return np.exp(np.divide(total, count, out=np.full(len(count), math.nan), where=count > 0))
