"""The line by which results quote the collection that their problems are of."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cpbench.foundation.plurals import counted

META = "collection"
"""Name of the quotation among the facts of a run."""
DIGITS = 16
"""Digits of the hash that a line shows."""


def quotation(meta: Mapping[str, Any]) -> str:
    """Return the line about the collection by the facts of a run, '' where they quote none.

    >>> quotation({"collection": {"name": "c 1", "problems": 9, "sha256": "ab" * 32, "here": 2}})
    '2 problems of c 1 (9 problems, sha256 abababababababab)'
    """
    quoted = meta.get(META)
    if not quoted:
        return ""
    whole = f"{counted(quoted['problems'], 'problem')}, sha256 {quoted['sha256'][:DIGITS]}"
    return f"{counted(quoted['here'], 'problem')} of {quoted['name']} ({whole})"
