"""Executes a plan: opens slots, makes its pairs, enters them in the results file and runs them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, TypeVar

from cpbench.bench import planned_run
from cpbench.bench.planning.assembly import Assembly, assemble
from cpbench.bench.planning.run_plan import RunPlan
from cpbench.bench.results.store import Store
from cpbench.bench.runner import settings
from cpbench.bench.slot import Slot
from cpbench.bench.worker_pool import Setting

if TYPE_CHECKING:
    from cpbench.bench.cluster.executor import DaskExecutor

T = TypeVar("T")


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


def execute_plan(
    asked: RunPlan,
    builtin: Callable[[], Path],
    observer: RunObserver,
    command: str,
    planned: Callable[[Assembly], bool],
    finished: Callable[[Store, Assembly], T],
    opened: Callable[[Store], None] = lambda store: None,
) -> T | None:
    """Execute a plan and return what `finished` makes of the results while their file is open.

    Parameters
    ----------
    builtin : makes the folder of the built-in problems. command : the command that the results name as their origin.
    planned : called with the pairs before anything is written; where it returns False, nothing is run and None
        returned.
    opened : called with the results file before the first pair is run.

    Raises CpbenchError, before anything is written, where the plan cannot be executed.
    """
    with ExitStack() as stack:
        common = Setting(asked.threads, asked.memory, fresh=asked.isolate == "fresh")
        own = 1 if asked.dask or asked.cluster else asked.jobs  # here problems are only read
        slots = [stack.enter_context(Slot(s)) for s in settings(common, own, pin=asked.affinity)]
        assembly = assemble(asked, slots[0], builtin, observer.reading)
        if not planned(assembly):
            return None
        executor = stack.enter_context(_cluster(asked, common)) if asked.dask or asked.cluster else slots
        store = stack.enter_context(Store(asked.results, create=True, keep=asked.keep, expel=True))
        opened(store)
        pairs = planned_run.enter_pairs(store, asked, assembly, command)
        planned_run.run_pending(executor, store, asked, pairs, observer, assembly.absent)
        return finished(store, assembly)


def _cluster(asked: RunPlan, common: Setting) -> AbstractContextManager[DaskExecutor]:
    from cpbench.bench.cluster import connect

    if asked.dask:
        return connect.to_scheduler(asked.dask, common)
    return connect.start(asked.cluster or "", common, asked.jobs if asked.jobs > 1 else None)
