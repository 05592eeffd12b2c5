"""Parts of outcomes: flags, times, statuses and messages, from what referee and worker report."""

from __future__ import annotations

import json
import statistics
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from cpbench.bench.messages import Declined, Failure, Late, Message, OutOfMemory, Result, Seconds
from cpbench.bench.results.rows import Outcome
from cpbench.errors import FormatError
from cpbench.verification import MET_TOLERANCE, PROVEN

LATE, LATE_SHARE = 0.25, 1.5
"""Seconds, and multiple of the time that the worker reports, after which an answer carries the flag `clock`."""

CLOCK = "clock"
"""Flag of an answer that came much later than the clock of its process says: the time is the runner's."""

TWICE = "twice"
"""Flag of a pair whose solver was asked once more because its first claim failed."""

REMEMBERED, NOTICED = 20.0, 0.01
"""Ratio of the first solve to the median of its repeats, and seconds of the first, from which the repeats are taken to
be a cache's."""


def marks(result: Result, waited: float, threads: int) -> list[str]:
    """Return the flags for side effects of a solve.

    waited : seconds by the runner's clock. threads : number that the solver may use.
    """
    flags = (
        ("children", result.children > 0),
        ("wrote", result.wrote),
        ("threads", result.threads > threads),
        (CLOCK, late(waited, result.setup + (result.solve if result.solve_wall is None else result.solve_wall))),
    )
    return [flag for flag, holds in flags if holds]


def runners_time(result: Result, waited: float) -> Result:
    """Return a result with the seconds that the runner waited in place of those by a clock that is not believed."""
    return replace(result, setup=Seconds(0.0), solve=Seconds(waited))


def late(waited: float, seconds: float) -> bool:
    """Return whether one clock shows much more than another one for the same solve [s]."""
    return waited > LATE + LATE_SHARE * seconds


def method_seconds(wall: float, reported: float | None, trip: float | None, *, trusted: bool) -> float:
    """Return the seconds of a method that ran in another process.

    Parameters
    ----------
    wall : seconds between request and reply. reported : by the program's own clock. trip : seconds of an empty request,
        None where the method ran in this process, whose clock counts then.
    trusted : whether the program's clock is read by code of cpbench. What a program of others reports of itself is its
        claim.

    The program's clock counts where it is plausible: it is not over `wall`, and not so far below that the rest cannot
    be the request (`late`). Else the wall clock counts, less the round trip.

    >>> method_seconds(7.2e-3, 0.65e-3, 5e-5, trusted=True), method_seconds(2.0, 0.65e-3, 5e-5, trusted=True)
    (0.00065, 1.99995)
    >>> method_seconds(7e-3, 1e-9, 1e-3, trusted=False), method_seconds(7e-3, None, None, trusted=False)
    (0.006, 0.007)
    """
    if trip is None:
        return wall
    if trusted and reported is not None and 0.0 < reported <= wall and not late(wall, reported):
        return reported
    return max(wall - trip, 0.0)


def remembered(solves: Sequence[float]) -> bool:
    """Return whether repeats were so much faster than the first solve that nothing can have been solved in them.

    >>> remembered([0.7, 3e-4, 1e-4]), remembered([0.7, 0.5, 0.6]), remembered([0.7])
    (True, False, False)
    """
    first, *others = solves
    return bool(others) and first > max(NOTICED, REMEMBERED * statistics.median(others))


@dataclass(frozen=True)
class Times:
    """Seconds of the first solve and of its repeats: of `setup`, of `solve`, and that passed meanwhile (`wall`).
    `lost` : why repeats or the history failed."""

    setup: Sequence[float]
    solve: Sequence[float]
    wall: Sequence[float]
    lost: str = ""

    @property
    def remembered(self) -> bool:
        """Tell whether the repeats are those of a cache."""
        return remembered(self.solve)

    def columns(self) -> dict[str, Any]:
        """Return the columns of a row."""
        several = len(self.solve) > 1
        low, _, high = statistics.quantiles(self.solve, n=4, method="inclusive") if several else (0.0, 0.0, 0.0)
        return {
            "setup": statistics.median(self.setup),
            "solve": self.solve[0] if self.remembered else statistics.median(self.solve),
            "repeats": len(self.solve),
            "samples": json.dumps([float(f"{seconds:.6g}") for seconds in self.solve]),
            "solve_min": min(self.solve),
            "solve_iqr": high - low,
        }


def of_both(first: Outcome, second: Outcome, tolerance: float) -> Outcome:
    """Return the row of a pair whose solver was asked once more, for a smaller tolerance, because its claim failed.

    The second run is reported, with its times, where its answer is right; else the first one. Either row says so.
    """
    if second.status in (*MET_TOLERANCE, *PROVEN):
        kept, other = second, f"a first answer, claimed {first.claim}, was {first.status}: {_errors(first)}"
    else:
        kept, other = first, f"the second answer is {second.status}: {_errors(second)}"
    return replace(
        kept,
        flags=",".join(filter(None, (kept.flags, TWICE))),
        message="; ".join(filter(None, (kept.message, f"asked twice, then for {tolerance:.1e}", other))),
        target_tolerance=first.target_tolerance,
    )


def _errors(outcome: Outcome) -> str:
    return "no error was measured" if outcome.error is None else f"error {outcome.error:.1e}"


def unprepared(why: Message, *, loading: bool) -> Outcome:
    """Return the outcome of a pair whose problem could not be loaded, or not be converted to its solver's node."""
    statuses: dict[type, str] = {Declined: "unsupported", Late: "timeout", OutOfMemory: "memout"}
    if loading or (isinstance(why, Declined) and why.cause == FormatError.__name__):  # not the solver's
        statuses = {OutOfMemory: "memout"}
    return Outcome(
        status=statuses.get(type(why), "error"), message=f"{'loading' if loading else 'conversion'}: {reason(why)}"
    )


def reason(message: Message) -> str:
    """Return the text of a message that came in place of the expected one."""
    return (message.message if isinstance(message, Failure) else "") or type(message).__name__
