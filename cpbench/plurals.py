"""Numbers with their nouns, in messages and reports."""

from __future__ import annotations


def counted(value: int, noun: str, nouns: str = "") -> str:
    """A number and its noun.

    >>> counted(1, "problem"), counted(2, "problem"), counted(2, "family", "families")
    ('1 problem', '2 problems', '2 families')
    """
    return f"{value} {noun}" if value == 1 else f"{value} {nouns or noun + 's'}"
