"""Noise: how far times of equal code differ in these runs. Below that, a change of times is the machine's.

What is known of it: the solve that is always the same, which a run repeats (its drift from one file to the other), and,
where a run has one build under two labels, how these two differ. One worker process beside another has a bias of its
own (where its memory lies), which all its problems share and no repetition within it can show: BIAS.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from scipy.special import stdtrit

BIAS = 0.02
"""Standard deviation of the log of a process's own factor on all its times, an assumption that is reported. Where it is
4 % and no builds of equal code show it, 10 of 25 comparisons of equal code raise alarms; with two such builds 1."""
ASSUMED = 2.0
"""Observations of two equal builds that the assumed bias is worth. With none, one difference of two would decide, and
Student's law with one degree of freedom finds nothing; with many, no difference that is seen would count."""
STRAY = 2.0
"""Factor between two equal solves that is always possible: one moment of another program's. That some pairs of equal
builds did not stray so far says nothing of the next ones."""
SURE = 2.0
"""Standard errors by which the reference solves of two files may differ more than was seen."""


@dataclass(frozen=True)
class Noise:
    """Noise of a comparison.

    Attributes
    ----------
    margin : the change of times that is asked for, relative.
    drift : factor ≥ 1 by which the machine may have been another in the two files; 1 within one run, NaN where it is
        not known.
    spread : coefficient of variation of the reference solves, of each file (NaN below two of them).
    equal : factor ≥ 1 between two labels of equal code (geometric mean), NaN where there are none.
    stray : factor ≥ 1 within which one pair differs by itself. unsteady : counters that equal code changes
        (`gates.unsteady`).
    """

    margin: float
    drift: float = math.nan
    spread: tuple[float, ...] = ()
    equal: float = math.nan
    stray: float = STRAY
    unsteady: frozenset[tuple[str, str]] = frozenset()

    @property
    def delta(self) -> float:
        """The relative change below which two times are the same: the margin, or the noise where that is larger.

        >>> Noise(0.05, drift=1.08).delta, Noise(0.05, equal=1.02).delta
        (0.08, 0.05)
        """
        return round(max(self.margin, *(f - 1.0 for f in (self.drift, self.equal) if math.isfinite(f)), 0.0), 12)

    @property
    def bias(self) -> float:
        """Standard deviation of the log of the ratio of two labels, shared by all their problems: of the processes, and
        of the machine from one file to the other.

        Where a build ran as two labels, their difference is one observation, beside an assumption that counts as
        `ASSUMED`.
        """
        variance = 2.0 * BIAS**2
        if math.isfinite(self.equal):
            variance = (ASSUMED * variance + math.log(self.equal) ** 2) / (ASSUMED + 1.0)
        machine = math.log(self.drift) / SURE if math.isfinite(self.drift) else 0.0
        return math.sqrt(variance + machine**2)

    def reach(self, spread: float, alpha: float) -> float:
        """Return how far from 0 the mean log ratio of a label must be to be no accident at a level; `spread` is that of
        the means of its families.

        A bias that was seen has one degree of freedom more than `ASSUMED`, one that is assumed is known; the sum has
        what Satterthwaite (Biometrics Bulletin 2 (1946)) gives it.

        >>> round(Noise(0.05).reach(0.0, 0.05), 3), round(Noise(0.05, equal=1.02).reach(0.0, 0.05), 3)
        (0.055, 0.082)
        """
        error = math.hypot(self.bias, spread)
        freedom = (ASSUMED + 1.0) * (error / self.bias) ** 4 if math.isfinite(self.equal) else math.inf
        return -float(stdtrit(freedom, alpha / 2)) * error

    @property
    def strays(self) -> float:
        """The factor beyond which the times of one pair differ by more than chance."""
        return max(1.0 + self.delta, self.stray)


def drift(references: Sequence[Sequence[Mapping[str, Any]]]) -> tuple[float, tuple[float, ...]]:
    """Return `drift` and `spread` of `Noise` from the reference solves of each file; one list where both sides are
    one run.

    The drift is what the two medians differ by, and SURE standard errors more: a few solves that jump about tell that
    the machine may have been slower between two measurements.

    >>> drift([[{"seconds": 1.0}, {"seconds": 1.0}], [{"seconds": 1.25}]])
    (1.25, (0.0, nan))
    """
    took = [
        np.array([row["seconds"] for row in solves if row["seconds"] is not None and row["seconds"] > 0], dtype=float)
        for solves in references
    ]
    spread = tuple(float(s.std(ddof=1) / s.mean()) if len(s) > 1 else math.nan for s in took)
    if len(took) == 1:
        return 1.0, spread
    if not all(len(s) for s in took):
        return math.nan, spread
    freedom = sum(len(s) - 1 for s in took)
    scatter = math.sqrt(sum(float(((np.log(s) - np.log(s).mean()) ** 2).sum()) for s in took) / max(freedom, 1))
    first, second = (float(np.median(s)) for s in took)
    error = scatter * math.sqrt(sum(1 / len(s) for s in took))
    return math.exp(abs(math.log(second / first)) + SURE * error), spread


def one_machine(pairs: pd.DataFrame, machines: Sequence[Mapping[str, Mapping[str, Any]]]) -> pd.Series[bool]:
    """Return whether both times of a pair were taken on one machine: a host of one name, and of one description.

    `machines` : what each file says of its hosts; hosts of which it says nothing are another machine.
    """
    base, new = machines
    same = {host for host, machine in base.items() if host and host in new and _lasting(machine) == _lasting(new[host])}
    return (pairs["host_base"] == pairs["host_new"]) & pairs["host_new"].isin(same)


def _lasting(machine: Mapping[str, Any]) -> dict[str, Any]:
    """Return the lasting facts of a machine, without its load or temperature at the time."""
    return {name: machine.get(name) for name in ("cpu", "cores", "threads", "ram_gib")}
