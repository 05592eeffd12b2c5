"""What comes of a pair: the columns of its row, from what referee and worker say."""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from cpbench.errors import FormatError

LATE, LATE_SHARE = 0.25, 1.5
"""An answer that came this many seconds later than so many times what the worker told carries the flag `clock`."""

REMEMBERED, NOTICED = 20.0, 0.01
"""A first solve of so many seconds at least that took so many times the median of its repeats: they were remembered."""


@dataclass(frozen=True)
class Outcome:
    """What came of a pair: the measured columns of its row, and compressed, the kept answer, the history, and the
    proof that there is no solution."""

    row: Mapping[str, Any]
    answer: bytes | None = None
    history: bytes | None = None
    proof: bytes | None = None

    def dated(self, finished: str) -> Outcome:
        """The same with the time at which it was there."""
        return replace(self, row={**self.row, "finished": finished})

    @property
    def status(self) -> str:
        return str(self.row["status"])


@dataclass(frozen=True)
class Predecessor:
    """The step before in a sequence: where its problem is, and the answer of the same solver, if it was verified."""

    address: str
    format: str | None
    fingerprint: str
    status: str
    answer: bytes | None


@dataclass(frozen=True)
class Result:
    """A worker's message `result`, with every part of the type it should have; `waited` is our own clock."""

    claim: str
    answered: bool
    message: str
    counters: dict[str, int]
    setup: float
    solve: float
    cpu: float
    grown: int
    peak: int | None
    children: int
    threads: int
    wrote: bool
    reported: float | None
    waited: float

    @staticmethod
    def from_message(reply: Mapping[str, Any], waited: float) -> Result:
        """Raises KeyError, TypeError, ValueError, OverflowError: what a process says that ran foreign code may be
        anything."""
        setup, solve = _seconds(reply["setup"]), _seconds(reply["solve"])
        return Result(
            claim=str(reply["claim"]),
            answered=bool(reply["answered"]),
            message=str(reply["message"]),
            counters={str(k): _count(v) for k, v in reply["counters"].items()},
            setup=setup,
            solve=solve,
            cpu=_seconds(reply["cpu"]),
            grown=_count(reply["grown"]),
            peak=None if reply.get("peak") is None else _count(reply["peak"]),
            children=_count(reply.get("children", 0)),
            threads=_count(reply.get("threads", 1)),
            wrote=bool(reply.get("wrote", False)),
            reported=None if reply.get("reported") is None else _seconds(reply["reported"]),
            waited=waited,
        )

    def flags(self, threads: int) -> tuple[tuple[str, bool], ...]:
        """What the row is marked with, and whether it is."""
        return (
            ("children", self.children > 0),
            ("wrote", self.wrote),
            ("threads", self.threads > threads),
            ("clock", self.waited > LATE + LATE_SHARE * (self.setup + self.solve)),
        )


def remembered(solves: Sequence[float]) -> bool:
    """Whether repeats were so much faster than the first solve that nothing can have been solved in them.

    >>> remembered([0.7, 3e-4, 1e-4]), remembered([0.7, 0.5, 0.6]), remembered([0.7])
    (True, False, False)
    """
    first, *others = solves
    return bool(others) and first > max(NOTICED, REMEMBERED * statistics.median(others))


def repeat_times(told: Any, most: int) -> list[tuple[float, float]]:
    """Setup and solve seconds of at most so many repeats; raises as `Result.from_message` does."""
    times = [(_seconds(setup), _seconds(solve)) for setup, solve, *_ in told]
    if len(times) > most:
        raise ValueError(f"{len(times)} repeats, {most} were asked for")
    return times


def _seconds(told: Any) -> float:
    seconds = float(told)
    if not 0.0 <= seconds < math.inf:
        raise ValueError(f"a time of {seconds} s")
    return seconds


def _count(told: Any) -> int:
    """Within what the results file keeps."""
    return max(-(2**63), min(int(told), 2**63 - 1))


def conversion_row(prepared: Mapping[str, Any]) -> dict[str, Any]:
    """The part of a row that the referee decides; `status` is empty when a solver may go on."""
    event = prepared["event"]
    if event == "prepared":
        return {
            "status": "",
            "route": prepared["route"],
            "kind": prepared["kind"],
            "convert": prepared["convert"],
            "target_tolerance": prepared["tolerance"],
        }
    stage = prepared.get("stage", "conversion")
    told = {"refused": "unsupported", "timeout": "timeout", "memory": "memout"}
    if stage == "loading" or prepared.get("cause") == FormatError.__name__:  # in a file no solver has a part
        told = {"memory": "memout"}
    status = told.get(event, "error")
    return {"status": status, "message": f"{stage}: {prepared.get('message', event)}"}


def iqr(values: Sequence[float]) -> float:
    """Distance of the quartiles."""
    if len(values) < 2:
        return 0.0
    quartiles = statistics.quantiles(values, n=4, method="inclusive")
    return quartiles[2] - quartiles[0]
