"""Bands around performance profiles: how far a curve would move with other families of problems.

The ratios r[p, s] belong to the problem and stay; what is drawn again, by families (`bootstrap`), is which problems
there are. ρ*_s(τ) = Σ_f m_f #{p in f : r[p, s] ≤ τ} / Σ_f m_f #f, read at each τ by itself: a band that holds the
curve at one τ, not the whole of it at once.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pandas as pd
from scipy import sparse

from cpbench.analysis import bootstrap
from cpbench.analysis.means import Array
from cpbench.analysis.profiles import FLOOR, ratios

GRID = 64
"""The most values of τ of a band, unless they are given."""


@dataclass(frozen=True)
class Bands:
    """Pointwise bands of performance profiles: `estimate`, `low`, `high` are τ × labels. See `bootstrap.Intervals`."""

    estimate: pd.DataFrame
    low: pd.DataFrame
    high: pd.DataFrame
    families: int
    level: float
    replicates: int

    @property
    def few(self) -> bool:
        """True if there are so few families that the bands are a rough guess, which callers must say."""
        return self.families < bootstrap.FEW


def profile_bands(
    matrix: pd.DataFrame,
    families: pd.Series[str] | None = None,
    taus: Sequence[float] | None = None,
    *,
    labels: Sequence[str] | None = None,
    level: float = 0.95,
    replicates: int = bootstrap.REPLICATES,
    seed: int = 0,
    floor: float = FLOOR,
    lost: pd.DataFrame | None = None,
) -> Bands:
    """Compute pointwise bands (expanded percentiles) of performance profiles ρ_s(τ); the ratios are not resampled.

    Parameters
    ----------
    taus : where; default at most GRID of the ratios at which some curve steps, evenly among them.
    labels : those that get a band (default: all); the ratios are to the best of all, and the bands are those they would
    have among all.
    lost : pairs that are not among the problems of their label (`table.lost`).

    >>> times = pd.DataFrame({"a": [1.0, 1.0, 1.0, 9.0], "b": [2.0, 2.0, 2.0, 3.0]})
    >>> found = profile_bands(times, taus=[1.0, 2.0, 3.0])
    >>> found.estimate["a"].tolist(), found.low["a"].tolist(), found.high["a"].tolist(), found.few
    ([0.75, 0.75, 1.0], [0.0, 0.0, 1.0], [1.0, 1.0, 1.0], True)
    """
    bootstrap.check(level, replicates)
    codes, count = bootstrap.clusters(matrix.index, families)
    quotient = ratios(matrix, floor)
    tau = _grid(quotient.to_numpy()) if taus is None else np.unique(np.asarray(taus, dtype=float))
    shown = [str(label) for label in quotient.columns if labels is None or label in labels]
    banded = pd.Index(sorted(shown), name="label")
    ratio = quotient[list(banded)].to_numpy()
    bins = np.searchsorted(tau, ratio, side="left")
    counts = np.ones(ratio.shape) if lost is None else ~lost.loc[matrix.index, list(banded)].to_numpy(dtype=bool)
    sizes = [np.bincount(codes, weights=counts[:, k], minlength=count) for k in range(len(banded))]
    shape = (len(tau), len(banded))
    low, high, estimate = np.full(shape, math.nan), np.full(shape, math.nan), np.full(shape, math.nan)
    for k in range(len(banded) if len(ratio) else 0):
        estimate[:, k] = np.cumsum(np.bincount(bins[:, k], minlength=len(tau) + 1)[:-1]) / max(sizes[k].sum(), 1.0)
    block = max(1, 2 * bootstrap.CELLS // max(1, len(tau) * replicates))
    for first in range(0, len(banded) if count > 1 else 0, block):
        steps = [_steps(bins[:, k], codes, len(tau), count) for k in range(first, min(first + block, len(banded)))]
        drawn = np.empty((len(steps), len(tau), replicates))
        for start, weights in bootstrap.multiplicities(count, replicates, seed):
            across = np.ascontiguousarray(weights.T)
            for k, step in enumerate(steps):
                problems = np.maximum(weights @ sizes[first + k], 1.0)  # of none drawn none is solved
                drawn[k, :, start : start + len(weights)] = np.cumsum(step @ across, axis=0) / problems
        beyond = bootstrap.tail(level, count)
        ends = np.quantile(drawn, [beyond, 1 - beyond], axis=2, overwrite_input=True)
        low[:, first : first + block], high[:, first : first + block] = ends[0].T, ends[1].T
    index = pd.Index(tau, name="tau")
    frames = [pd.DataFrame(part, index=index, columns=banded) for part in (estimate, low, high)]
    return Bands(frames[0], frames[1], frames[2], count, level, replicates)


def _steps(bins: npt.NDArray[np.intp], codes: npt.NDArray[np.intp], taus: int, count: int) -> sparse.csr_array:
    """Count how many problems of each family a label solves first at each τ, τ × families."""
    inside = bins < taus
    ones = np.ones(int(inside.sum()))
    return sparse.coo_array((ones, (bins[inside], codes[inside])), shape=(taus, count)).tocsr()


def _grid(ratio: Array) -> Array:
    """Return at most GRID of the distinct finite ratios, the least and the largest among them; 1 where there is
    none.
    """
    found = np.unique(ratio[np.isfinite(ratio)])
    if not len(found):
        return np.ones(1)
    return found[np.unique(np.linspace(0, len(found) - 1, min(GRID, len(found))).round().astype(int))]
