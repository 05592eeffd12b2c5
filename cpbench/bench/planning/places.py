"""Names of the built-in problems as paths; the only module of planning that loading a problem needs."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from cpbench.storage.base import SEPARATOR

BUILTIN = "builtin"


def located(text: str, builtin: Callable[[], Path]) -> str:
    """Return `builtin/...` as a path below the folder of the built-in problems, any other text as it is.

    >>> located("builtin/lcp/lcp-classics.h5::fathi-10", lambda: Path("problems"))
    'problems/lcp/lcp-classics.h5::fathi-10'
    """
    head, slash, rest = text.partition("/")
    head, separator, member = head.partition(SEPARATOR) if not slash else (head, "", "")
    if head != BUILTIN or os.path.exists(text):
        return text
    return f"{builtin()}{slash}{rest}{separator}{member}"
