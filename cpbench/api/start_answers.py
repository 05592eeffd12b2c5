"""The answers of a results file that a report compares: those of problems with several starts."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cpbench.analysis import multi_start
from cpbench.analysis import table as rows_of
from cpbench.bench.results.answers import unpack
from cpbench.foundation.matrices import Vector

if TYPE_CHECKING:
    import pandas as pd

    from cpbench.bench.results.store import Store


def start_answers(store: Store, table: pd.DataFrame) -> dict[str, Vector]:
    """Return the kept answers by key of the row; none where no problem has several starts."""
    found: dict[str, Vector] = {}
    for key in multi_start.wanted(rows_of.normalised(table, ("start", "node", "status"))):
        _, kept = store.ending(key)
        if kept is not None:
            found[key] = unpack(kept)
    return found
