"""Limits of rows: those of one results file, or of one set in it, have to agree."""

from __future__ import annotations

from typing import Any

from cpbench.bench.results.rows import Planned

LIMITS = {"seconds": "timeout", "memory": "memory", "threads": "threads", "repeats_asked": "repeats"}
"""The columns of limits, by the name that an option gives them."""


def limits_of(row: Planned) -> tuple[float | None, int | None, int | None, int | None]:
    """Return the limits of a row, in the order of `LIMITS`."""
    return row.seconds, row.memory, row.threads, row.repeats_asked


def agree(old: tuple[Any, ...], asked: tuple[Any, ...]) -> bool:
    """Return whether results with these limits may share a file; an unknown old limit (None) agrees with any."""
    return all(a is None or a == b for a, b in zip(old, asked, strict=True))


def difference(name: str, old: tuple[Any, ...], asked: tuple[Any, ...]) -> str:
    """Return why a file refuses limits that do not `agree` with the old ones of set `name`."""
    for limit, before, now in zip(LIMITS.values(), old, asked, strict=True):
        if before is not None and before != now:
            origin = f"set '{name}' was made" if name else "was made"
            return (
                f"{origin} with {limit} {before:.12g}, now {now:.12g}; results of other limits do not mix: use another "
                "file with -o"
            )
    return "was made with other limits"
