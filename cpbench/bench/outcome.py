"""What comes of a pair: the columns of its row, from what referee and worker say."""

from __future__ import annotations

import statistics
from collections.abc import Sequence

from cpbench.bench.messages import Declined, Failure, Late, Message, OutOfMemory, Result
from cpbench.bench.results.rows import Outcome
from cpbench.errors import FormatError

LATE, LATE_SHARE = 0.25, 1.5
"""An answer that came this many seconds later than so many times what the worker told carries the flag `clock`."""

REMEMBERED, NOTICED = 20.0, 0.01
"""A first solve of so many seconds at least that took so many times the median of its repeats: they were remembered."""


def marks(result: Result, waited: float, threads: int) -> list[str]:
    """Return the flags of a row for what a solver did beside its solve.

    `waited` : our own clock [s]. `threads` : those that it may have.
    """
    found = (
        ("children", result.children > 0),
        ("wrote", result.wrote),
        ("threads", result.threads > threads),
        ("clock", waited > LATE + LATE_SHARE * (result.setup + result.solve)),
    )
    return [flag for flag, holds in found if holds]


def remembered(solves: Sequence[float]) -> bool:
    """Return whether repeats were so much faster than the first solve that nothing can have been solved in them.

    >>> remembered([0.7, 3e-4, 1e-4]), remembered([0.7, 0.5, 0.6]), remembered([0.7])
    (True, False, False)
    """
    first, *others = solves
    return bool(others) and first > max(NOTICED, REMEMBERED * statistics.median(others))


def unprepared(why: Message, *, loading: bool) -> Outcome:
    """Return what comes of a pair whose problem could not be loaded, or not be brought to its solver's node."""
    statuses: dict[type, str] = {Declined: "unsupported", Late: "timeout", OutOfMemory: "memout"}
    if loading or (isinstance(why, Declined) and why.cause == FormatError.__name__):  # in a file no solver has a part
        statuses = {OutOfMemory: "memout"}
    return Outcome(
        status=statuses.get(type(why), "error"), message=f"{'loading' if loading else 'conversion'}: {told(why)}"
    )


def told(message: Message) -> str:
    """Return what a message says in place of another that was expected."""
    return (message.message if isinstance(message, Failure) else "") or type(message).__name__


def iqr(values: Sequence[float]) -> float:
    """Return distance of the quartiles."""
    if len(values) < 2:
        return 0.0
    quartiles = statistics.quantiles(values, n=4, method="inclusive")
    return quartiles[2] - quartiles[0]
