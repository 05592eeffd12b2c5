"""Tables as TOML, for commands that write a plan or the declaration of a solver."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any

_BARE = re.compile(r"[A-Za-z0-9_-]+")
"""Keys that TOML takes without quotes."""


def lines(table: Mapping[str, Any]) -> list[str]:
    """Return keys of a table, a line each; a key that may not stand bare is quoted.

    >>> lines({"omega": 1.2, "a b": True, "": 3})
    ['omega = 1.2', '"a b" = true', '"" = 3']
    """
    return [f"{key if _BARE.fullmatch(key) else value(key)} = {value(entry)}" for key, entry in table.items()]


def value(entry: Any) -> str:
    """Return a value in TOML: texts are those of JSON save one character, a mapping is an inline table.

    >>> value([1e-6, "a\\nb", True]), value({"A": float("inf"), "B": 3})
    ('[1e-06, "a\\\\nb", true]', '{"A" = inf, "B" = 3}')
    """
    if isinstance(entry, Mapping):
        return "{" + ", ".join(f"{value(key)} = {value(item)}" for key, item in entry.items()) + "}"
    if isinstance(entry, list):
        return f"[{', '.join(value(item) for item in entry)}]"
    if isinstance(entry, float):
        return repr(float(entry))
    return json.dumps(entry, ensure_ascii=False).replace("\x7f", "\\u007f")
