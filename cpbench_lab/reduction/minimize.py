"""Delta debugging: a list made as short as a predicate lets it be (Zeller & Hildebrandt 2002), by its complements."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

T = TypeVar("T")

FEW = 12
"""Chunks of a size that are tried by themselves, at most."""


def minimized(items: Sequence[T], holds: Callable[[Sequence[T]], bool]) -> list[T]:
    """Return a part of the items for which the predicate holds and fails without any single one of them.

    Short chunks are tried by themselves first, for what is short is solved fast: of one item, of two, of four, a few
    over the whole list. Then chunks are left out, of half of the items at first, of one each at last, until nothing can
    be left out any more. The predicate is not asked about the whole list, for which it has to hold.

    >>> minimized(range(100), lambda some: {17, 42} <= set(some))
    [17, 42]
    """
    kept = _short(list(items), holds)
    size = len(kept)
    while size:
        size = min((size + 1) // 2, len(kept))
        start, shorter = 0, False
        while start < len(kept):
            rest = kept[:start] + kept[start + size :]
            if holds(rest):
                kept, shorter = rest, True
            else:
                start += size
        if size == 1 and not shorter:
            break
    return kept


def _short(items: list[T], holds: Callable[[Sequence[T]], bool]) -> list[T]:
    """Return the first short chunk for which the predicate holds, all items where there is none."""
    size = 1
    while size <= len(items) // 4:
        stride = max(-(-len(items) // FEW), size)
        for start in range(0, len(items), stride):
            chunk = items[start : start + size]
            if holds(chunk):
                return chunk
        size *= 2
    return items
