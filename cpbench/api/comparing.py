"""A comparison of results files, or of two labels of one."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from cpbench.bench.results.store import Store
from cpbench.errors import CpbenchError

if TYPE_CHECKING:
    from cpbench.analysis.comparison import Comparison, ComparisonSide, Thresholds


def compare_files(
    base: Path,
    new: Path | None,
    labels: tuple[str, str] = ("", ""),
    settings: Thresholds | None = None,
    noise: tuple[str, str] | None = None,
) -> Comparison:
    """Compare two results files, or two labels of one.

    Parameters
    ----------
    base : a results file. new : None to compare `labels` of the base.
    settings : margins and levels, None for the default. noise : two labels of equal code, whose difference is noise.

    Raises CpbenchError where a file has no rows or the sides have no pair in common.
    """
    from cpbench.analysis import comparison

    chosen = settings or comparison.Thresholds()
    if new is None:
        return comparison.compare_labels(side(base), *labels, chosen, noise)
    after = side(new)
    equal = comparison.equal_pairs(after, noise) if noise is not None else None
    return comparison.compare(side(base), after, chosen, equal)


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
    return ComparisonSide(str(store.path), table, store.meta(), store.machines())
