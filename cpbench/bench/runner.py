"""Runs a plan: an executor runs blocks of pairs, and every pair becomes a row in the store."""

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
from cpbench.bench.events import Done, Event, EventHandler, ignore_event
from cpbench.bench.planning.plan import Pair
from cpbench.bench.reference import Reference
from cpbench.bench.results.rows import Outcome
from cpbench.bench.results.store import Store
from cpbench.bench.slot import Slot
from cpbench.bench.worker_pool import Setting

REFERENCE_EVERY = 100
"""Pairs between two reference solves."""


def settings(common: Setting, jobs: int = 1) -> list[Setting]:
    """Return one setting a slot, each with its own cores where there are enough of them.

    The first cores of the machine, which serve interrupts and the runner, are assigned last.
    """
    allowed = machine.cores()
    enough = len(allowed) >= jobs * common.threads
    taken = [
        allowed[len(allowed) - (i + 1) * common.threads :][: common.threads] if enough else () for i in range(jobs)
    ]
    return [replace(common, cpus=tuple(cpus), slots=jobs) for cpus in taken]


class Executor(Protocol):
    """An executor of blocks: slots of this machine, or the machines of a cluster."""

    @property
    def reference(self) -> Setting | None:
        """Setting of the reference solves on this machine; None where other machines solve."""
        ...

    @property
    def machines(self) -> Mapping[str, Mapping[str, Any]]:
        """Description of each machine by host, known before its first outcome."""
        ...

    def outcomes(self, todo: Sequence[Block], on_event: EventHandler) -> Generator[tuple[Pair, Outcome]]:
        """Yield the outcome of every pair, with its host. Closing the generator stops the work."""
        ...


class LocalExecutor:
    """The executor of this machine: one slot in this thread, or several in threads of their own."""

    def __init__(self, slots: Sequence[Slot]) -> None:
        self._slots = slots
        self.machines = {platform.node(): machine.describe()}

    @property
    def reference(self) -> Setting:
        return self._slots[0].setting

    def outcomes(self, todo: Sequence[Block], on_event: EventHandler) -> Generator[tuple[Pair, Outcome]]:
        if len(self._slots) > 1:
            return _side_by_side(self._slots, todo, on_event)
        slot, first = self._slots[0], todo[0].pairs[0]
        slot.workers.begin(first.entry.solver, first.limits.memory)
        slot.start([first.entry.solver], first.limits, on_event)  # or it would disturb the reference
        return (ended for block in todo for ended in blocks.run(slot, block, on_event))


def execute(
    executor: Executor | Sequence[Slot],
    store: Store,
    planned: Sequence[Pair],
    seed: int = 0,
    on_event: EventHandler = ignore_event,
) -> None:
    """Run every planned pair that the store has not run yet.

    Rows are written by this thread alone, one transaction each, in the order in which outcomes come.
    """
    todo = blocks.blocks(planned, store.pending(), seed, store.ending)
    if not todo:
        return
    executor = LocalExecutor(executor) if isinstance(executor, Sequence) else executor
    pairs = sum(len(block.pairs) for block in todo)
    hosts = set[str]()
    with ExitStack() as stack:
        reference = stack.enter_context(Reference(executor.reference)) if executor.reference else None
        # closed whatever happens, so that an interrupt ends the processes at work
        outcomes = stack.enter_context(closing(executor.outcomes(todo, on_event)))
        if reference:
            store.add_reference(0, *reference.measure())
        for done, (pair, outcome) in enumerate(outcomes, 1):
            if outcome.host and outcome.host not in hosts:
                store.note_machine(outcome.host, executor.machines[outcome.host])
                hosts.add(outcome.host)
            store.finish(pair.key, outcome)
            on_event(Done(pair, outcome))
            if reference and (done % REFERENCE_EVERY == 0 or done == pairs):
                store.add_reference(done, *reference.measure())


def _side_by_side(
    slots: Sequence[Slot], todo: Sequence[Block], on_event: EventHandler
) -> Generator[tuple[Pair, Outcome]]:
    """Yield outcomes of several slots, one thread each: a thread mostly waits for processes. Closing this generator
    stops the slots."""
    waiting: queue.SimpleQueue[Block | None] = queue.SimpleQueue()
    events: queue.SimpleQueue[Event | BaseException | None] = queue.SimpleQueue()
    stopped = threading.Event()
    # one None for each thread, behind all blocks: each takes one, and ends
    for block in (*todo, *(None for _ in slots)):
        waiting.put(block)

    def work(slot: Slot) -> None:
        try:
            while (block := waiting.get()) is not None and not stopped.is_set():
                for ended in blocks.run(slot, block, events.put):
                    if stopped.is_set():
                        return
                    events.put(Done(*ended))
        # raised again in the thread that iterates, where somebody can see it
        except BaseException as error:
            events.put(error)
        finally:
            events.put(None)

    threads = [threading.Thread(target=work, args=(slot,), daemon=True) for slot in slots]
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
                on_event(event)
    finally:
        stopped.set()
        for slot in slots:
            # a thread waits for its processes: it goes on when these are dead
            slot.interrupt()
        for thread in threads:
            thread.join(10.0)
