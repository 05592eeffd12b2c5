"""Events of a run's progress."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from cpbench.bench.planning.plan import Pair
from cpbench.bench.results.rows import Outcome
from cpbench.foundation.text import counted, some_of

HOSTS = 8
"""The most hosts that are named."""


@dataclass(frozen=True)
class Starting:
    """The process of a solver starts."""

    solver: str


@dataclass(frozen=True)
class Compiling:
    """A solver compiles before it is ready, which takes seconds and happens once on each machine."""

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
class Joined:
    """The workers of a cluster that take part have changed.

    Attributes
    ----------
    workers : their number. hosts : of these. dashboard : its address, '' where there is none.
    """

    workers: int
    hosts: tuple[str, ...]
    dashboard: str

    def __str__(self) -> str:
        on = f" on {counted(len(self.hosts), 'host')} ({some_of(self.hosts, HOSTS)})" if self.hosts else ""
        watch = f"; dashboard: {self.dashboard}" if self.dashboard else ""
        return f"Dask: {counted(self.workers, 'worker')}{on}{watch}"


@dataclass(frozen=True)
class Spent:
    """The machines of a cluster on which a run was done: pairs by host, and the time of processors [s]."""

    pairs: Mapping[str, int]
    seconds: float

    def __str__(self) -> str:
        shares = [f"{host} {counted(count, 'pair')}" for host, count in self.pairs.items()]
        return f"ran on {counted(len(shares), 'host')} ({some_of(shares, HOSTS)}): {self.seconds / 3600:.2g} CPU hours"


Event: TypeAlias = Starting | Compiling | Solving | Done | Joined | Spent
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
