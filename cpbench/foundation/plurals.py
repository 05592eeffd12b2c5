"""Numbers with their nouns, and names of which there are many, in messages and reports."""

from __future__ import annotations

from collections.abc import Mapping, Sequence


def counted(value: int, noun: str, nouns: str = "") -> str:
    """Return a number and its noun.

    >>> counted(1, "problem"), counted(2, "problem"), counted(2, "family", "families")
    ('1 problem', '2 problems', '2 families')
    """
    return f"{value} {noun}" if value == 1 else f"{value} {nouns or noun + 's'}"


def some_of(names: Sequence[str], most: int) -> str:
    """Join the first names, and count the others.

    >>> some_of("abc", 6), some_of("abc", 2)
    ('a, b, c', 'a, b and 1 more')
    """
    more = len(names) - most
    return ", ".join(names[:most]) + (f" and {more} more" if more > 0 else "")


def summary(counts: Mapping[str, int]) -> str:
    """Return counts by status, the most frequent first.

    >>> summary({"failed": 1, "solved": 8})
    '8 solved, 1 failed'
    """
    return ", ".join(f"{counts[status]} {status}" for status in sorted(counts, key=lambda s: -counts[s]))
