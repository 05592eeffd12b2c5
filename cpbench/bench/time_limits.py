"""Time limits of the phases of a run: that of a solve, but never less than the floor of the phase.

Floors allow for what takes time on any machine however short the solves are: a slow disk, the start of another
interpreter, a package that compiles first. A phase that exceeds its limit is killed with all that it started.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.bench.planning.quantities import duration

GRACE = 0.2
"""Seconds after the limit of a solve at which its process is killed; it and all it started have ended half a second
after the limit."""


@dataclass(frozen=True)
class Phase:
    """A part of the work around a solve.

    Attributes
    ----------
    floor : seconds that it may always take. what : what happens in it.
    """

    name: str
    floor: float
    what: str

    def limit(self, timeout: float = 0.0) -> float:
        """Return the limit in seconds where a solve may take `timeout`."""
        return max(self.floor, timeout)


START = Phase("start", 60.0, "imports of a solver's packages, first message of its program")
"""Julia answers after 5 to 20 s; the import of a package from a cold network disk takes as long."""
WARM_UP = Phase("warm-up", 300.0, "the `warmup` of a solver: what its package compiles first, or its program loads")
"""Packages that compile when they are first called take half a minute on a slow machine."""
LOAD = Phase("load", 30.0, "reading the converted problem, `obstacle`, handing over to a program")
"""A gigabyte is read from a slow disk in 10 s."""
REFEREE = Phase("conversion", 120.0, "reading a file, converting, lifting, judging")
"""The work of cpbench itself, dense eliminations included; it is not part of any solver's time."""
PHASES = (START, WARM_UP, LOAD, REFEREE)


def floors() -> str:
    """Return the floors in a sentence.

    >>> floors()
    'start 60 s, warm-up 5 min, load 30 s, conversion 120 s'
    """
    return ", ".join(f"{phase.name} {duration(phase.floor)}" for phase in PHASES)
