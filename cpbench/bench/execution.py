"""A run from its plan to its results: slots are opened, pairs planned, entered and worked off, whoever asks for it."""

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
    """An observer of how a run goes, from reading the problems on."""

    def reading(self, addresses: Sequence[str]) -> Iterator[str]:
        """Yield the addresses; each is being read from when it is yielded until the next is asked for."""
        ...


class SilentObserver:
    """An observer that shows nothing."""

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
    """Carry a plan out and return what `finished` makes of the results, while their file is still open.

    Parameters
    ----------
    builtin : makes the folder of the built-in problems. command : what the results say they were made by.
    planned : called with the pairs before anything is written; where it returns False nothing is run, and None
        returned. opened : called with the results file before the first pair is run.

    Raises CpbenchError where the plan cannot be carried out, before anything is written.
    """
    with ExitStack() as stack:
        common = Setting(asked.threads, asked.memory, fresh=asked.isolate == "fresh")
        own = 1 if asked.dask or asked.cluster else asked.jobs  # it reads the problems, others solve them
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
