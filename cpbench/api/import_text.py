"""Remarks on imported answers: which were refused or not used, and what they lack."""

from __future__ import annotations

from collections.abc import Iterator

from cpbench.bench.results.imported import Imported
from cpbench.foundation.plurals import counted

SHOWN = 10
"""Largest number of lines of a kind; the rest is counted."""


def remarks(done: Imported) -> Iterator[str]:
    """Yield a line for each answer that has no row, and one for each kind of thing that is missing."""
    refused = [reason for _, reason in done.refused]
    for reason, lines in (("refused", refused), ("not used", done.stray), ("error", done.broken)):
        yield from (f"{reason}: {line}" for line in lines[:SHOWN])
        if len(lines) > SHOWN:
            yield f"{reason}: {len(lines) - SHOWN} more"
    if done.unasked:
        listed = ", ".join(f"{node} {count}" for node, count in sorted(done.unasked.items()))
        yield f"no answer to any problem of these formulations, no row: {listed}"
    if done.unanswered:
        yield f"no answer, and a row that says failed: {counted(done.unanswered, 'problem')}"
    if done.untimed:
        yield f"no time (--times not given, or without a line): {counted(done.untimed, 'answer')}"
