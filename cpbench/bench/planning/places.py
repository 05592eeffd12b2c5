"""Names of built-in problems and of collections as paths; the only module of planning that loading a problem needs."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from cpbench.storage.base import SEPARATOR
from cpbench.storage.collections import PREFIX

BUILTIN = "builtin"


def located(text: str, builtin: Callable[[], Path]) -> str:
    """Return `builtin/...` as a path below the folder of the built-in problems, `collection/...` as one in the
    sets that the user has, any other text as it is.

    Raises UnknownName, and CpbenchError where a collection is not there.

    >>> located("builtin/lcp/lcp-classics.h5::fathi-10", lambda: Path("problems"))
    'problems/lcp/lcp-classics.h5::fathi-10'
    """
    head, slash, rest = text.partition("/")
    head, separator, member = head.partition(SEPARATOR) if not slash else (head, "", "")
    if head not in (BUILTIN, PREFIX) or os.path.exists(text):
        return text
    if head == PREFIX:
        from cpbench.storage.collections import added

        return added.local_path(f"{rest}{separator}{member}")
    return f"{builtin()}{slash}{rest}{separator}{member}"
