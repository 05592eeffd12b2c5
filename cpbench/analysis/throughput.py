"""Problems per second of solvers in sets that ask for throughput: verified answers over the time of all calls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from cpbench.analysis import table as rows_of
from cpbench.analysis.table import Floats, ResultGroup
from cpbench.verification import REFUSED


@dataclass(frozen=True)
class Throughput:
    """Problems per second of a solver.

    Attributes
    ----------
    formulation : its name, with what tells the group from others. problems : those it was started on. verified : those
    of them whose answer meets the tolerance. calls : by how many calls they were solved. seconds : of all calls, those
    that solved nothing included [s].
    """

    group: ResultGroup
    label: str
    problems: int
    verified: int
    calls: int
    seconds: float

    @property
    def per_second(self) -> float:
        """Verified answers per second."""
        return self.verified / self.seconds if self.seconds > 0 else 0.0


def throughputs(table: pd.DataFrame) -> Sequence[Throughput]:
    """Return the solvers of every group whose set asks for throughput, the fastest of each group first.

    >>> rows = pd.DataFrame({"batch": [4.0, 4, 4, 4, np.nan], "status": ["solved"] * 3 + ["wrong", "solved"],
    ...                      "solve": 0.5, "setup": 0.0, "label": "s", "node": "lcp", "threads": 1})
    >>> [(one.problems, one.verified, one.calls, one.per_second) for one in throughputs(rows_of.normalised(rows))]
    [(4, 3, 1, 1.5)]
    """
    shared = table[table["batch"].notna() & ~table["status"].isin(REFUSED)]
    found = [
        _throughput(group, str(label), own)
        for group, rows in rows_of.groups(shared)
        for label, own in rows.groupby("label", sort=True)
    ]
    return sorted(found, key=lambda one: (one.group, -one.per_second, one.label))


def _throughput(group: ResultGroup, label: str, rows: pd.DataFrame) -> Throughput:
    calls = round(float((1.0 / rows["batch"]).sum()))
    return Throughput(group, label, len(rows), int(rows_of.solved(rows).sum()), calls, float(np.sum(_taken(rows))))


def _taken(rows: pd.DataFrame) -> Floats:
    """Return the time of each row [s]: convert + setup + solve, and lift where there is a conversion (else that only
    looks at the shape of an answer); of a solve without a time, as one that crashed, all that the pair took."""
    parts = rows[["convert", "setup", "solve"]].fillna(0.0).sum(axis=1)
    lift = rows["lift"].fillna(0.0).where(rows["route"] != "direct", 0.0)
    return (parts + lift).where(rows["solve"].notna(), rows["wall"]).fillna(0.0).to_numpy(dtype=float)
