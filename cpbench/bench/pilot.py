"""A pilot: some of the pairs of a plan, drawn by its seed, are run for a few seconds and forgotten, to see how long all
of them will take."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from cpbench.bench import block as blocks
from cpbench.bench.events import Compiling, Done, Event, EventHandler, ignore_event
from cpbench.bench.pace import Expected, Pace
from cpbench.bench.planning.plan import Pair
from cpbench.bench.results.store import Store
from cpbench.bench.runner import execute
from cpbench.bench.slot import Slot

SECONDS = 10.0
"""Time that the pairs of a pilot may take together; the start of solvers comes on top."""
MOST = 2000
"""The most pairs of a pilot."""
EACH = 10
"""The most pairs of one block, so that many problems are seen where there are many solvers."""


@dataclass(frozen=True)
class Pilot:
    """Result of a pilot: the number of pairs it timed, and how long all pairs of the plan are expected to take."""

    pairs: int
    expected: Expected | None


class _OverError(Exception):
    """The time of the pilot is over."""


def pilot(slots: Sequence[Slot], todo: Sequence[Pair], seed: int, on_compiling: EventHandler = ignore_event) -> Pilot:
    """Run drawn pairs as a run does, with rows in a file that is removed again. `on_compiling` takes the events of
    solvers that have to compile, since these take long."""
    drawn = draw(todo, seed)
    pace = Pace(len(slots))

    def on_event(event: Event) -> None:
        pace.note(event)
        if isinstance(event, Compiling):
            on_compiling(event)
        if isinstance(event, Done) and pace.seconds > SECONDS:
            raise _OverError

    with tempfile.TemporaryDirectory() as folder, Store(Path(folder) / "pilot.sqlite", create=True) as store:
        store.plan(drawn)
        with contextlib.suppress(_OverError):
            execute(slots, store, drawn, seed, on_event)
    return Pilot(pace.pairs, pace.expected(len(todo)))


def draw(todo: Sequence[Pair], seed: int) -> list[Pair]:
    """Return the pairs of a pilot: of the first blocks, in the order of the run, some or all."""
    drawn: list[Pair] = []
    for block in blocks.blocks(todo, {pair.key for pair in todo}, seed, lambda key: ("not_run", None)):
        part = block if blocks.stackable(block.pairs[0]) else block.cut(EACH)[0]
        drawn += part.pairs
        if len(drawn) >= MOST:
            break
    return drawn
