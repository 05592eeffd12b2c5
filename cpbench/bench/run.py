"""Runs a plan: opens it, enters its pairs in the results, runs those that are pending, and writes a row for each.

`open_run` starts the processes and makes the pairs; `OpenRun.execute` enters and runs them. Blocks of pairs (`block`)
run on a slot (`slot`), on several side by side, or elsewhere (`Executor`); outcomes are written as they come.
"""

from __future__ import annotations

import platform
import queue
import threading
import time
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

from cpbench.bench import block as blocks
from cpbench.bench import machine, skipped
from cpbench.bench.block import Block, predecessors
from cpbench.bench.events import Done, Event, EventHandler, Observer, ignore_event
from cpbench.bench.planning.assembly import Assembly, Reading, assemble
from cpbench.bench.planning.plan import Pair
from cpbench.bench.planning.run_plan import RunPlan
from cpbench.bench.planning.selection import RERUN
from cpbench.bench.reference import NAME, Reference
from cpbench.bench.results.rows import Outcome
from cpbench.bench.results.store import Store
from cpbench.bench.slot import FELL_BACK, Slot
from cpbench.bench.worker_pool import Setting
from cpbench.errors import CpbenchError
from cpbench.foundation import extensions
from cpbench.solvers.base import Trait, solvers
from cpbench.solvers.external import declared

REFERENCE_EVERY = 100
"""Pairs between two reference solves."""


class OpenRun:
    """A run whose processes are started and whose pairs are known.

    Nothing is written before `open_results`. Made by `open_run`, and closed with it.

    Attributes
    ----------
    plan : what was asked for. assembly : its pairs, and what was found about its files.
    """

    def __init__(self, plan: RunPlan, assembly: Assembly, slots: Sequence[Slot], setting: Setting, stack: ExitStack):
        self.plan, self.assembly = plan, assembly
        self._slots, self._setting, self._stack = slots, setting, stack
        self._executor: Executor | Sequence[Slot] = slots

    def open_results(self) -> Store:
        """Open the results file for the rest of the run. Raises StoreError, and where the plan needs Dask,
        CpbenchError."""
        self._executor = self._connect()  # before anything is written
        return self._stack.enter_context(Store(self.plan.results, create=True, keep=self.plan.keep))

    def execute(self, store: Store, observer: Observer, command: str) -> None:
        """Enter the pairs in the results and run those that are pending; an interrupted run goes on.

        `command` : the results name it as their origin. Raises CpbenchError.
        """
        pairs = enter_pairs(store, self.plan, self.assembly, command)
        run_pending(self._executor, store, self.plan, pairs, observer, self.assembly.absent)

    def _connect(self) -> Executor | Sequence[Slot]:
        """Return what runs pairs: Dask where the plan asks for it, else the slots."""
        plan = self.plan
        if not plan.cluster:
            return self._slots
        connect = extensions.load(extensions.EXECUTORS, "dask")
        if "://" in plan.cluster:
            return self._stack.enter_context(connect.to_scheduler(plan.cluster, self._setting))
        jobs = plan.jobs if plan.jobs > 1 else None
        return self._stack.enter_context(connect.start(plan.cluster, self._setting, jobs))


@contextmanager
def open_run(plan: RunPlan, builtin: Callable[[], Path], reading: Reading) -> Generator[OpenRun]:
    """Start the processes of a run and make its pairs; everything ends with the context.

    builtin : makes the folder of the built-in problems. reading : passes addresses on while they are read.

    Raises CpbenchError where the plan cannot be executed.
    """
    with ExitStack() as stack:
        setting = Setting(plan.threads, plan.memory)
        count = 1 if plan.cluster else plan.jobs  # with Dask, problems are only read here
        slots = [stack.enter_context(Slot(each)) for each in settings(setting, count)]
        yield OpenRun(plan, assemble(plan, slots[0], builtin, reading), slots, setting, stack)


def require_answers(run_plan: RunPlan, planned: Sequence[Pair]) -> None:
    """Raise CpbenchError where steps are to start from answers that are not kept."""
    if run_plan.keep != "all" and any(pair.scene for pair in planned):
        raise CpbenchError(
            f"--keep {run_plan.keep} with --start previous: a step starts from the kept answer to the one before; "
            "leave --keep out"
        )


def enter_pairs(store: Store, run_plan: RunPlan, assembly: Assembly, command: str) -> list[Pair]:
    """Enter a plan in the results: its rows, its files, what is to be run again, and the plan itself.

    Returns the pairs that have a row: all but those that an earlier command skipped. Raises StoreError, with the rows
    unchanged, when the file was made with other limits.
    """
    before = store.meta()
    pairs = skipped.planned(store, assembly.pairs, run_plan.rerun)
    store.plan(pairs)
    if run_plan.rerun:
        store.reset(RERUN[run_plan.rerun], [pair.key for pair in pairs])
        _reset_followers(store, pairs)
    planned = {pair.fingerprint for pair in pairs}
    surveyed = {survey.fingerprint: survey.features for survey in reversed(assembly.surveys)}
    store.note_features({fingerprint: facts for fingerprint, facts in surveyed.items() if fingerprint in planned})
    store.note_files(assembly.read, assembly.refused)
    store.set_meta(
        command=command,
        cpbench=machine.versions().get("cpbench", ""),
        date=time.strftime("%Y-%m-%d %H:%M"),
        seed=run_plan.seed,
        machine=machine.describe(),
        versions=machine.versions(),
        jobs=run_plan.jobs,
        reference=NAME,
        kept_all=run_plan.keep == "all" and bool(before.get("kept_all", "plan" not in before)),
        builtin=run_plan.builtin,
        formats=_formats(before.get("formats", {}), assembly.read),
        plan=run_plan.effective(assembly.fingerprints),
    )
    return pairs


def run_pending(
    executor: Executor | Sequence[Slot],
    store: Store,
    run_plan: RunPlan,
    planned: Sequence[Pair],
    observer: Observer,
    absent: Mapping[str, str] | None = None,
) -> None:
    """Run the pending pairs; those that cannot be run are skipped, as are `absent` solvers (`skipped.settle`)."""
    versions: dict[str, str] = {}

    def on_event(event: Event) -> None:
        if isinstance(event, Done) and event.outcome.version:
            versions[event.pair.entry.solver] = event.outcome.version
        observer.progress(event)

    try:
        _reset_followers(store, planned)
        observer.begin(planned, store.pending())
        execute(executor, store, planned, run_plan.seed, on_event)
    finally:
        observer.end()
        skipped.settle(store, planned, absent or {})
        store.set_meta(solvers=_solver_metadata(store.meta().get("solvers", {}), planned, versions))


def _reset_followers(store: Store, planned: Sequence[Pair]) -> None:
    """Plan steps again that began cold because the preceding step had failed, where that one is run again."""
    ordered = sorted((pair for pair in planned if pair.scene), key=lambda pair: pair.step)
    before = predecessors(ordered)
    pending = store.pending()
    again: list[str] = []
    for pair in ordered:
        if pair.key in pending or pair.key not in before or before[pair.key].key not in pending:
            continue
        # a step that did start from an answer keeps its row: another solve of the same step would give the same start
        if (store.row(pair.key).started or "").startswith(FELL_BACK):
            again.append(pair.key)
            pending.add(pair.key)
    if again:
        store.reset(None, again)


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
        slot = self._slots[0]
        slot.start(todo[0].limits, on_event)  # or it would disturb the reference
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


def _formats(before: Mapping[str, str], read: Mapping[str, str | None]) -> dict[str, str]:
    """Return the format by which each file of the results was read, where one was given."""
    kept = {address: name for address, name in before.items() if address not in read}
    return kept | {address: name for address, name in read.items() if name is not None}


def _plugin_of_variant(name: str) -> str:
    """Return the file that declares the solver of which `name` is a variant: another command needs both."""
    solver, at, _ = name.partition(declared.AT)
    return declared.origin(solver) if at and solver in solvers else ""


def _solver_metadata(
    before: Mapping[str, Mapping[str, Any]],
    planned: Sequence[Pair],
    versions: Mapping[str, str],
) -> dict[str, Any]:
    """Return the facts of each solver for the results: those of earlier commands are kept, and so is the version of a
    solver that had nothing left to do."""
    metadata: dict[str, Any] = dict(before)
    for pair in planned:
        spec = solvers.get(pair.entry.solver).spec
        metadata[pair.label] = dict(before.get(pair.label, {})) | {
            "name": spec.name,
            "node": spec.node,
            "method": spec.method,
            "native": solvers.get(pair.entry.solver).origin == "native",
            "launches": Trait.LAUNCHES in spec.traits,
            "version": versions.get(spec.name) or before.get(pair.label, {}).get("version", ""),
            "licence": spec.licence,
            "publishing": spec.publishing,
            "summary": spec.summary,
            "citation": spec.citation,
            "plugin": declared.origin(spec.name),
            "variant_of": _plugin_of_variant(spec.name),
        }
    return metadata
