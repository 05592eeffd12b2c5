"""Text by number: the place of each value among the distinct ones, so that names are compared once a name.

A table of a million rows has thousands of problems and dozens of labels. Rows in the order of a results file (problem,
label) have those of one problem side by side, which `by_appearance` and `order` go by.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import pandas as pd

Integers: TypeAlias = np.ndarray[tuple[int], np.dtype[np.int64]]


def codes(values: pd.Series) -> tuple[Integers, pd.Index]:
    """Code each value by its place among the distinct ones in ascending order; text is compared once a name.

    >>> place, names = codes(pd.Series(["b", "a", "b"]))
    >>> place.tolist(), names.tolist()
    ([1, 0, 1], ['a', 'b'])
    """
    place, names = pd.factorize(values, sort=True)
    return np.asarray(place, dtype=np.int64), pd.Index(names)


def by_appearance(values: pd.Series) -> tuple[Integers, pd.Index]:
    """Code each value by its place among the distinct ones in order of appearance.

    Rows of one problem lie side by side: what is the same as in the row before is not looked up again.

    >>> place, names = by_appearance(pd.Series(["b", "b", "a", "b"]))
    >>> place.tolist(), names.tolist()
    ([0, 0, 1, 0], ['b', 'a'])
    """
    array = np.asarray(values, dtype=object)
    first = np.flatnonzero(np.append(True, array[1:] != array[:-1])[: len(array)])
    place, names = pd.factorize(array[first])
    times = np.diff(first, append=len(array))
    return np.repeat(np.asarray(place, dtype=np.int64), times), pd.Index(names, dtype=values.dtype)


def order(clean: pd.DataFrame) -> Integers | None:
    """Return the positions of the rows by problem, fingerprint, label and key; None where they lie so already.

    A results file gives its rows in order, and to find that out costs less than to sort them.
    """
    columns = [clean[name] for name in ("problem", "fingerprint", "label")]
    if _in_order(*columns):
        return None
    places = [codes(column)[0] for column in reversed(columns)]
    order = np.lexsort(places)
    same = np.all([np.diff(place[order]) == 0 for place in places], axis=0)
    return np.lexsort([codes(clean["key"])[0], *places]) if same.any() else order  # no two keys are alike


def _in_order(problem: pd.Series[str], fingerprint: pd.Series[str], label: pd.Series[str]) -> bool:
    """Return whether rows ascend strictly by the three; text is compared only where it changes."""
    place, names = by_appearance(problem)
    if not names.is_monotonic_increasing or (np.diff(place) < 0).any():
        return False
    prints = np.asarray(fingerprint, dtype=object)
    same = np.diff(place) == 0
    other = np.flatnonzero(same & (prints[1:] != prints[:-1]))
    if any(prints[k] > prints[k + 1] for k in other):
        return False
    same[other] = False
    return not (same & (np.diff(codes(label)[0]) <= 0)).any()
