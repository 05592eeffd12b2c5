"""Opens runs: slots, the pairs of a plan, its results file, and the execution of what is pending."""

from __future__ import annotations

from collections.abc import Callable, Collection, Generator, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Protocol

from cpbench.bench import planned_run
from cpbench.bench.planning.assembly import Assembly, Reading, assemble
from cpbench.bench.planning.run_plan import RunPlan
from cpbench.bench.results.store import Store
from cpbench.bench.runner import Executor, settings
from cpbench.bench.slot import Slot
from cpbench.bench.worker_pool import Setting
from cpbench.foundation import extensions, kernel_cache


class RunObserver(planned_run.RoundObserver, Protocol):
    """An observer of a run, from reading the problems on."""

    def reading(self, addresses: Sequence[str]) -> Iterator[str]:
        """Yield the addresses; an address is being read from its yield until the next one."""
        ...


class SilentObserver:
    """An observer that displays nothing."""

    def reading(self, addresses: Sequence[str]) -> Iterator[str]:
        yield from addresses

    def begin(self, planned: object, pending: object) -> None: ...

    def progress(self, event: object) -> None: ...

    def end(self) -> None: ...


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

    def keep(self, wanted: Collection[str]) -> None:
        """Keep the pairs whose keys are wanted, with all steps of their sequences."""
        pairs = self.assembly.pairs
        scenes = {(pair.scene, pair.label) for pair in pairs if pair.scene and pair.key in wanted}
        kept = [pair for pair in pairs if pair.key in wanted or (pair.scene, pair.label) in scenes]
        self.assembly = replace(self.assembly, pairs=kept)

    def open_results(self) -> Store:
        """Open the results file for the rest of the run. Raises StoreError, and where the plan needs Dask,
        CpbenchError."""
        self._executor = self._connect()  # before anything is written
        return self._stack.enter_context(Store(self.plan.results, create=True, keep=self.plan.keep))

    def execute(self, store: Store, observer: planned_run.RoundObserver, command: str) -> None:
        """Enter the pairs in the results and run those that are pending; an interrupted run goes on.

        `command` : the results name it as their origin. Raises CpbenchError.
        """
        pairs = planned_run.enter_pairs(store, self.plan, self.assembly, command)
        planned_run.run_pending(self._executor, store, self.plan, pairs, observer, self.assembly.absent)

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
    kernel_cache.ensure_cache_dir()  # before processes start: they inherit it
    with ExitStack() as stack:
        setting = Setting(plan.threads, plan.memory)
        count = 1 if plan.cluster else plan.jobs  # with Dask, problems are only read here
        slots = [stack.enter_context(Slot(each)) for each in settings(setting, count)]
        yield OpenRun(plan, assemble(plan, slots[0], builtin, reading), slots, setting, stack)
