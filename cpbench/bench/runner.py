"""Runs a plan: a crew works blocks of pairs off, and every pair becomes a row in the store."""

from __future__ import annotations

import platform
import queue
import threading
from collections.abc import Generator, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import replace
from typing import Any, Protocol

from cpbench.bench import block as blocks
from cpbench.bench import machine
from cpbench.bench.block import Block
from cpbench.bench.events import Done, Event, Notice, silent
from cpbench.bench.lane import Lane
from cpbench.bench.planning.plan import Pair
from cpbench.bench.reference import Reference
from cpbench.bench.results.rows import Outcome
from cpbench.bench.results.store import Store
from cpbench.bench.worker_pool import Setting

REFERENCE_EVERY = 100
"""Pairs between two reference solves."""


def settings(common: Setting, jobs: int = 1, *, pin: bool = True) -> list[Setting]:
    """Return one setting a lane; with `pin`, each with cores of its own, where there are enough of them.

    The first cores of the machine, where interrupts and the runner are at home, are given away last.
    """
    allowed = machine.cores()
    enough = pin and len(allowed) >= jobs * common.threads
    taken = [
        allowed[len(allowed) - (i + 1) * common.threads :][: common.threads] if enough else () for i in range(jobs)
    ]
    return [replace(common, cpus=tuple(cpus), lanes=jobs) for cpus in taken]


class Crew(Protocol):
    """An executor of blocks: lanes of this machine, or the machines of a cluster."""

    @property
    def reference(self) -> Setting | None:
        """Under which the reference is solved here during the run; None where others do the work."""
        ...

    @property
    def machines(self) -> Mapping[str, Mapping[str, Any]]:
        """What each machine is, by host, before the first outcome from there."""
        ...

    def outcomes(self, todo: Sequence[Block], notice: Notice) -> Generator[tuple[Pair, Outcome]]:
        """Yield what comes of every pair, with the host that it was run on. Closing the generator stops the work."""
        ...


class Lanes:
    """The crew of this machine: one lane at work in this thread, or several in threads of their own."""

    def __init__(self, lanes: Sequence[Lane]) -> None:
        self._lanes = lanes
        self.machines = {platform.node(): machine.describe()}

    @property
    def reference(self) -> Setting:
        return self._lanes[0].setting

    def outcomes(self, todo: Sequence[Block], notice: Notice) -> Generator[tuple[Pair, Outcome]]:
        if len(self._lanes) > 1:
            return _side_by_side(self._lanes, todo, notice)
        lane, first = self._lanes[0], todo[0].pairs[0]
        lane.workers.begin(first.entry.solver, first.limits.memory)
        lane.start([first.entry.solver], first.limits, notice, patient=False)  # or it would disturb the reference
        return _one_by_one(lane, todo, notice)


def execute(
    crew: Crew | Sequence[Lane], store: Store, planned: Sequence[Pair], seed: int = 0, notice: Notice = silent
) -> None:
    """Run every planned pair that the store has not run yet.

    Rows are written by this thread alone, a transaction each, in the order in which they are there.
    """
    todo = blocks.blocks(planned, store.pending(), seed, store.ending)
    if not todo:
        return
    crew = Lanes(crew) if isinstance(crew, Sequence) else crew
    pairs = sum(len(block.pairs) for block in todo)
    hosts = set[str]()
    with ExitStack() as stack:
        reference = stack.enter_context(Reference(crew.reference)) if crew.reference else None
        outcomes = stack.enter_context(closing(crew.outcomes(todo, notice)))
        if reference:
            store.add_reference(0, *reference.measure())
        for done, (pair, outcome) in enumerate(outcomes, 1):
            host = str(outcome.host)
            if host not in hosts:
                store.note_machine(host, crew.machines[host])
                hosts.add(host)
            store.finish(pair.key, outcome)
            notice(Done(pair, outcome))
            if reference and (done % REFERENCE_EVERY == 0 or done == pairs):
                store.add_reference(done, *reference.measure())


def _one_by_one(lane: Lane, todo: Sequence[Block], notice: Notice) -> Generator[tuple[Pair, Outcome]]:
    """Block after block; what has to be compiled is put off, and waited for when nothing else is left."""
    waiting = list(todo)
    while waiting:
        now, waiting, idle = waiting, list[Block](), True
        for block in now:
            for ended in blocks.run(lane, block, notice, waiting):
                idle = False
                yield ended
        if idle:
            lane.compiler.give_back()


def _side_by_side(lanes: Sequence[Lane], todo: Sequence[Block], notice: Notice) -> Generator[tuple[Pair, Outcome]]:
    """Yield a thread a lane: it waits for processes nearly all the time. Whoever stops listening stops the lanes."""
    waiting: queue.SimpleQueue[Block | None] = queue.SimpleQueue()
    events: queue.SimpleQueue[Event | BaseException | None] = queue.SimpleQueue()
    stopped = threading.Event()
    for block in (*todo, *(None for _ in lanes)):
        waiting.put(block)

    def work(lane: Lane) -> None:
        try:
            while (block := waiting.get()) is not None and not stopped.is_set():
                for ended in blocks.run(lane, block, events.put):
                    if stopped.is_set():
                        return
                    events.put(Done(*ended))
        except BaseException as error:
            events.put(error)
        finally:
            events.put(None)

    threads = [threading.Thread(target=work, args=(lane,), daemon=True) for lane in lanes]
    try:
        for thread in threads:
            thread.start()
        working = len(threads)
        while working:
            event = events.get()
            if event is None:
                working -= 1
            elif isinstance(event, BaseException):
                raise event
            elif isinstance(event, Done):
                yield event.pair, event.outcome
            else:
                notice(event)
    finally:
        stopped.set()
        for lane in lanes:
            lane.interrupt()
        for thread in threads:
            thread.join(10.0)
