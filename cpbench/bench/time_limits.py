"""How long each phase of a run may take: as long as a solve, but never less than its floor.

Floors are for what happens on honest machines however short the solves are to be: a slow disk, the start of another
interpreter, a first compilation. What is not over at its limit is killed with all that it started.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from cpbench.bench.planning.quantities import duration

GRACE = 0.2
"""Seconds after the limit of a solve at which its process is killed: it and all it started are gone half a second
after the limit."""


@dataclass(frozen=True)
class Phase:
    """A part of the work around a solve.

    Attributes
    ----------
    floor : seconds that it has at least. what : what happens in it.
    """

    name: str
    floor: float
    what: str

    def limit(self, timeout: float = 0.0) -> float:
        """Return seconds that it may take where a solve may take `timeout`."""
        return max(self.floor, timeout)


START = Phase("start", 60.0, "imports of a solver's packages, hello of its program")
"""Julia says hello after 5 to 20 s; a package is imported from a cold network disk in as many."""
WARM_UP = Phase("warm-up", 300.0, "compiling, once a machine; the warm-up of a program")
"""What compiles longest takes 25 s alone on a slow machine, and shares it with other slots."""
LOAD = Phase("load", 30.0, "reading the converted problem, `obstacle`, handing over to a program")
"""A gigabyte is read in 10 s from a slow disk."""
REFEREE = Phase("conversion", 120.0, "reading a file, converting, lifting, judging")
"""The work of cpbench itself, dense eliminations included: no solver waits for it, or is charged for it."""
PHASES = (START, WARM_UP, LOAD, REFEREE)


def floors() -> str:
    """Return the floors in a sentence.

    >>> floors()
    'start 60 s, warm-up 5 min, load 30 s, conversion 120 s'
    """
    return ", ".join(f"{phase.name} {duration(phase.floor)}" for phase in PHASES)


def told() -> Iterator[tuple[str, str]]:
    """Yield each phase with its limit, for a reader."""
    yield "solve", "--timeout: set-up, solve, and bringing back the answer"
    for phase in PHASES:
        yield phase.name, f"--timeout, at least {duration(phase.floor)}: {phase.what}"
