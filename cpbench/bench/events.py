"""Events of a run's progress."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from cpbench.bench.planning.plan import Pair
from cpbench.bench.results.rows import Outcome


@dataclass(frozen=True)
class Starting:
    """The process of a solver starts."""

    solver: str


@dataclass(frozen=True)
class Solving:
    """A pair starts to run; on another machine, the first pair of a block."""

    pair: Pair


@dataclass(frozen=True)
class Done:
    """A pair has ended."""

    pair: Pair
    outcome: Outcome


@dataclass(frozen=True)
class Told:
    """A line of the executor for a reader, as on the machines of a cluster."""

    line: str


Event: TypeAlias = Starting | Solving | Done | Told
EventHandler: TypeAlias = Callable[[Event], None]


def ignore_event(event: Event) -> None:
    """Ignore an event."""


class Observer:
    """An observer of a run, which shows nothing; a display shows what it overrides."""

    def reading(self, addresses: Sequence[str]) -> Iterator[str]:
        """Yield the addresses; an address is being read from its yield until the next one."""
        yield from addresses

    def begin(self, planned: Sequence[Pair], pending: Collection[str]) -> None:
        """Take note that the pending pairs begin to run."""

    def progress(self, event: Event) -> None:
        """Take an event of the run."""

    def end(self) -> None:
        """Take note that the pairs have ended, whatever the reason."""
