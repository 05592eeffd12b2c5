"""What has to stay true of a problem while it is reduced: how a solver fails on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from cpbench.errors import CpbenchError
from cpbench.verification import MET_TOLERANCE, PROVEN, REFUSED, Status

if TYPE_CHECKING:
    from cpbench.bench.results.rows import Outcome

FAILURES = tuple(map(str, (
    Status.WRONG, Status.INACCURATE, Status.LOST, Status.CRASH, Status.ERROR, Status.TIMEOUT, Status.MEMOUT,
)))  # fmt: skip
"""Statuses that are failures whatever other solvers do."""
GAVE_UP = (str(Status.FAILED), str(Status.MAX_ITER))
"""Statuses that are failures only where another solver solves the problem."""
SLOWER, DISAGREES = "slower", "disagrees"
LEAST_SLOW = 0.01
"""Seconds below which no solve counts as slow: a call of another program takes about a millisecond by itself."""


@dataclass(frozen=True)
class Predicate:
    """A failure of a solver.

    Attributes
    ----------
    kind : a status, `slower` or `disagrees`. factor : of `slower`. other : the solver of `slower` and `disagrees`,
    empty for the automatic choice.
    """

    kind: str
    factor: float = 0.0
    other: str = ""

    @property
    def needs_other(self) -> bool:
        """Whether another solver has to solve the problem."""
        return self.kind in (SLOWER, DISAGREES, *GAVE_UP)

    def fails(self, outcome: Outcome) -> bool:
        """Return whether an outcome may be the failure, whatever another solver does."""
        if self.kind == SLOWER:
            return outcome.status in MET_TOLERANCE and (outcome.solve or 0.0) >= LEAST_SLOW
        if self.kind == DISAGREES:
            return outcome.status not in (*MET_TOLERANCE, *PROVEN, *REFUSED, str(Status.UNRESOLVABLE))
        return outcome.status == self.kind

    def holds(self, outcome: Outcome, other: Outcome) -> bool:
        """Return whether the failure is one beside the outcome of the other solver."""
        if not self.fails(outcome) or other.status not in MET_TOLERANCE:
            return False
        return self.kind != SLOWER or (outcome.solve or 0.0) >= self.factor * (other.solve or 0.0)

    def __str__(self) -> str:
        if self.kind == SLOWER:
            return f"{self.kind}:{self.factor:g}" + (f":{self.other}" if self.other else "")
        return f"{self.kind}:{self.other}" if self.other else self.kind


def parse_predicate(text: str) -> Predicate:
    """Return the predicate of `--while`: a status, `slower:FACTOR[:OTHER]` or `disagrees[:OTHER]`.

    >>> parse_predicate("slower:100:lemke")
    Predicate(kind='slower', factor=100.0, other='lemke')
    """
    kind, _, rest = text.partition(":")
    if kind in FAILURES and not rest:
        return Predicate(kind)
    if kind in (DISAGREES, *GAVE_UP):
        return Predicate(kind, other=rest)
    if kind == SLOWER:
        number, _, other = rest.partition(":")
        try:
            factor = float(number)
        except ValueError:
            factor = 0.0
        if factor > 1.0:
            return Predicate(kind, factor, other)
    raise CpbenchError(
        f"--while {text}: is none of {', '.join((*FAILURES, *GAVE_UP))}, slower:FACTOR[:OTHER], disagrees[:OTHER]"
    )
