"""The sides of a comparison, from files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from cpbench.bench.results import problem_files
from cpbench.bench.results.store import Store
from cpbench.errors import CpbenchError

if TYPE_CHECKING:
    from cpbench.analysis.comparison import ComparisonSide


def side(path: Path) -> ComparisonSide:
    """Return the rows and facts of a results file; raises CpbenchError when it has none."""
    with Store(path) as store:
        return side_of(store)


def side_of(store: Store) -> ComparisonSide:
    """Return the rows and facts of a results file that is open; raises CpbenchError when it has no rows."""
    from cpbench.analysis.comparison import ComparisonSide

    table = store.table()
    if not len(table):
        raise CpbenchError(f"{store.path}: has no rows; make some with: cpbench run PROBLEMS -o {store.path}")
    meta = {**store.meta(), "changed": problem_files.changed(store)}
    return ComparisonSide(str(store.path), table, meta, store.machines())
