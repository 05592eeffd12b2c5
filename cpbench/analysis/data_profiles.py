"""Data profiles of Moré and Wild, SIAM J. Optimization 20 (2009), exactly, of any cost.

    d_s(κ) = #{p : t[p, s] / u[p] ≤ κ} / N

The fraction of problems that s solves within a budget of κ: seconds, iterations, or units u[p] that belong to the
problem. With t the evaluations of a function of n variables and u = n + 1, κ counts simplex gradients (their
section 2); with t the single contacts that were worked on and u = nc, sweeps. No solver is measured against another,
so a curve stays what it is whatever else is shown; failures are ∞ and N is fixed by the plan, so that d_s(∞) is the
fraction solved.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pandas as pd

from cpbench.analysis import table as rows_of
from cpbench.analysis.profiles import Curve, at_least, curves
from cpbench.errors import UnknownName


@dataclass(frozen=True)
class DataProfile:
    """The curves of a group, in order of label; they step at budgets, drawn by `steps(widest, start=0.0)`."""

    curves: tuple[Curve, ...]
    problems: int

    @property
    def widest(self) -> float:
        """The largest budget that still solves a problem, 0 when there is none: every curve is flat beyond it."""
        return max((float(c.ratios[-1]) for c in self.curves if c.solved), default=0.0)

    @property
    def least(self) -> float:
        """The smallest budget above 0 that solves a problem, 0 when there is none: every curve is flat up to it."""
        return min((float(c.ratios[c.ratios > 0][0]) for c in self.curves if (c.ratios > 0).any()), default=0.0)

    def within(self, budget: float) -> pd.Series[float]:
        """Return the fraction of problems each label solves within a budget.

        >>> data_profile(pd.DataFrame({"a": [1.0, 3.0], "b": [2.0, math.inf]})).within(2.0).to_dict()
        {'a': 0.5, 'b': 0.5}
        """
        return pd.Series({c.label: c.at(budget) for c in self.curves}, dtype=float)


def data_profile(
    values: pd.DataFrame,
    problems: int | None = None,
    units: pd.Series[float] | None = None,
    lost: pd.DataFrame | None = None,
) -> DataProfile:
    """Return the data profile of costs, problems × labels, ∞ or NaN for a failure.

    Parameters
    ----------
    problems : N, when more problems were planned than the table has rows. Raises ValueError when fewer.
    units : u by fingerprint, positive (default 1: the budget is in the unit of the costs).
    lost : pairs that are not among the problems of their label (`table.lost`).

    Raises ValueError on a negative cost, and on a unit that is missing or not positive.

    >>> evaluations = pd.DataFrame({"s": [30.0, 6.0, math.inf]}, index=["p", "q", "r"])
    >>> (curve,) = data_profile(evaluations, units=pd.Series({"p": 10.0, "q": 3.0, "r": 5.0})).curves
    >>> curve.ratios.tolist(), curve.count, curve.at(2.5)
    ([2.0, 3.0], (1, 2), 0.3333333333333333)
    """
    planned = at_least(values, problems)
    budget = values.to_numpy(dtype=float, copy=True)
    budget[np.isnan(budget)] = math.inf
    if (budget < 0).any():
        raise ValueError(f"negative cost {budget.min():.3g}: no budget is less than nothing")
    if units is not None:
        unit = units.reindex(values.index).to_numpy(dtype=float)
        good = np.isfinite(unit) & (unit > 0)
        if not good.all():
            at = int(np.argmin(good))
            raise ValueError(f"problem {values.index[at]}: its unit is {unit[at]}, which is not a positive number")
        budget /= unit[:, np.newaxis]
    spent = pd.DataFrame(budget, index=values.index, columns=values.columns)
    return DataProfile(curves(spent, planned, lost), planned)


def size_units(group: pd.DataFrame, symbol: str, plus: float = 0.0) -> pd.Series[float]:
    """Return a dimension of each problem of a group, plus a constant, by fingerprint: n + 1 is `size_units(group,
    "n", 1)`.

    Raises UnknownName when a problem has no such dimension.

    >>> size_units(pd.DataFrame({"fingerprint": ["f", "g"], "sizes": ['{"n": 3}', '{"n": 7}']}), "n", 1).to_dict()
    {'f': 4.0, 'g': 8.0}
    """
    first = group[["fingerprint", "sizes"]].drop_duplicates("fingerprint")
    for sizes in rows_of.sizes_read(first)[1]:
        if symbol not in sizes:
            raise UnknownName("dimension", symbol, sizes)
    return pd.Series(rows_of.sizes_of(first, symbol) + plus, index=first["fingerprint"].tolist())
