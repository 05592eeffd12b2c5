"""Durations, sizes and counts as people write them, in options and in plan files."""

from __future__ import annotations

import math
import re

from cpbench.errors import CpbenchError

LARGEST = 2**63 - 1
"""Largest integer in a results file."""
_SECONDS = {"ms": 1e-3, "s": 1.0, "": 1.0, "m": 60.0, "h": 3600.0}
_PREFIXES = " KMGT"


def seconds(text: str) -> float:
    """Return a positive duration [s]; `none` is infinite. Raises CpbenchError.

    >>> seconds("500ms"), seconds("10m"), seconds("2.5"), seconds("none")
    (0.5, 600.0, 2.5, inf)
    """
    if text.strip().lower() == "none":
        return math.inf
    matched = re.fullmatch(r"(\d+(?:\.\d+)?)\s*(ms|s|m|h)?", text.strip())
    if not matched or float(matched[1]) <= 0:
        raise CpbenchError(f"'{text}' is no duration; write 500ms, 10s, 5m, 2h or none")
    value = float(matched[1]) * _SECONDS[matched[2] or ""]
    if value > LARGEST:
        raise CpbenchError(f"'{_short(text)}' is too long a duration; write none for no limit")
    return value


def size(text: str) -> int:
    """Return a number of bytes, in powers of 1024; `none` and `0` are no limit. Raises CpbenchError.

    >>> size("512M"), size("4GiB"), size("none")
    (536870912, 4294967296, 0)
    """
    if text.strip().lower() == "none":
        return 0
    matched = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([KMGT]?)(?:i?B)?", text.strip(), re.IGNORECASE)
    if not matched:
        raise CpbenchError(f"'{text}' is no size; write 512M, 4G or none")
    value = float(matched[1]) * 1024 ** _PREFIXES.index((matched[2] or " ").upper())
    if value > LARGEST:
        raise CpbenchError(f"'{_short(text)}' is too large a size; write none for no limit")
    return int(value)


def _short(text: str) -> str:
    return text if len(text) <= 30 else f"{text[:27]}..."


def facet_count(number: int) -> int:
    """Return a number of facets, even and at least 4; raises CpbenchError."""
    if number < 4 or number % 2:
        raise CpbenchError(f"{number} facets: the number must be even and at least 4")
    return number


def duration(value: float) -> str:
    """Return seconds for readers, rounded up: a bound stays one.

    >>> duration(0.25), duration(90.5), duration(200), duration(9000), duration(math.inf)
    ('0.25 s', '91 s', '4 min', '2.5 h', 'without limit')
    """
    if not math.isfinite(value):
        return "without limit"
    if value < 10:
        return f"{value:.3g} s"
    if value <= 120:
        return f"{math.ceil(value)} s"
    return f"{math.ceil(value / 60)} min" if value <= 7200 else f"{math.ceil(value / 360) / 10:g} h"
