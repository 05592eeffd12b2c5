"""The rows of a run as they would be judged at another tolerance.

An answer was measured once, and its error can be held against any tolerance ε: it is *solved* when the error is at
most ε, whatever was asked for. What it cost stays the cost of the solve that was asked for the planned tolerance: a
solver that is told of a looser one may stop earlier, and at a tighter one it may go on. So this ranks what was
delivered; what would have been needed, histories tell (`histories.times_to`) or a run at that tolerance.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from cpbench.analysis import table as rows_of
from cpbench.verification import INACCURATE_FACTOR, Status


def judged_at(table: pd.DataFrame, tolerance: float) -> pd.DataFrame:
    """The table with the statuses, and the tolerance, that its errors have at `tolerance`.

    A checked proof that there is no solution stays what it is. Raises ValueError when the tolerance is not positive.

    >>> rows = pd.DataFrame({"status": ["solved", "solved", "wrong", "timeout"], "error": [1e-9, 1e-7, 1e-3, 1.0]})
    >>> judged_at(rows, 1e-8)["status"].tolist(), judged_at(rows, 1e-2)["status"].tolist()
    (['solved', 'inaccurate', 'wrong', 'timeout'], ['solved', 'solved', 'solved', 'timeout'])
    """
    if not tolerance > 0:
        raise ValueError(f"tolerance of {tolerance}: must be positive")
    error = table["error"].to_numpy(dtype=float)
    before = rows_of.solved(table).to_numpy(dtype=bool)
    good = (error <= tolerance) & (table["status"] != str(Status.INFEASIBLE)).to_numpy()
    near = error <= INACCURATE_FACTOR * tolerance
    status = table["status"].to_numpy(dtype=object)
    status = np.where(good & ~before, str(Status.SOLVED), status)
    status = np.where(before & ~good, np.where(near, str(Status.INACCURATE), str(Status.WRONG)), status)
    return table.assign(status=status, tolerance=tolerance)
