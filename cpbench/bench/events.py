"""Events of a run's progress."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

from cpbench.bench.planning.plan import Pair
from cpbench.bench.results.rows import Outcome


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


Event: TypeAlias = Starting | Compiling | Solving | Done
EventHandler: TypeAlias = Callable[[Event], None]


def ignore_event(event: Event) -> None:
    """Ignore an event."""
