"""Keys and values of a plan file as text, for commands that write one."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from cpbench.foundation import toml_text


def lines(table: Mapping[str, Any]) -> list[str]:
    """Return keys of a TOML table."""
    return toml_text.lines({key: _with_none(item) for key, item in table.items()})


def value(item: Any) -> str:
    """Return a value as TOML, in which "none" stands for no limit.

    >>> value([1e-6, "a\\nb", True]), value(float("inf"))
    ('[1e-06, "a\\\\nb", true]', '"none"')
    """
    return toml_text.value(_with_none(item))


def _with_none(value: Any) -> Any:
    if isinstance(value, list):
        return [_with_none(item) for item in value]
    return "none" if isinstance(value, float) and math.isinf(value) else value
