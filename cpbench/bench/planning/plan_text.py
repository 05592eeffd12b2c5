"""Writes plan files, for commands that make one."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cpbench import toml_text
from cpbench.bench.planning.run_plan import BUILTIN
from cpbench.storage.base import write_atomic


def beside(folder: Path, text: str) -> str:
    """Return a problem's address relative to the folder of the plan."""
    return text if text.split("/")[0] == BUILTIN else os.path.relpath(text, folder)


def lines(table: Mapping[str, Any]) -> list[str]:
    """Return keys of a TOML table."""
    return [f"{key} = {value(item)}" for key, item in table.items()]


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


def write(path: Path, text: str) -> None:
    """Write a plan, whole or not at all; raises FormatError."""
    write_atomic(path, text.encode(), force=True)
