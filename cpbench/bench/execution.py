"""A run from its plan to its results: lanes are opened, pairs planned, entered and worked off, whoever asks for it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, TypeVar

from cpbench.bench import campaign
from cpbench.bench.lane import Lane
from cpbench.bench.planning.assembly import Assembly, assemble
from cpbench.bench.planning.run_plan import RunPlan
from cpbench.bench.results.store import Store
from cpbench.bench.runner import settings
from cpbench.bench.worker_pool import Setting

if TYPE_CHECKING:
    from cpbench.bench.cluster.crew import Cluster

T = TypeVar("T")


class Audience(campaign.Watcher, Protocol):
    """An observer of how a run goes, from reading the problems on."""

    def reading(self, addresses: Sequence[str]) -> Iterator[str]:
        """Yield the addresses; each is being read from when it is yielded until the next is asked for."""
        ...


class Silent:
    """An audience that shows nothing."""

    def reading(self, addresses: Sequence[str]) -> Iterator[str]:
        yield from addresses

    def begin(self, planned: object, pending: object) -> None: ...

    def progress(self, event: object) -> None: ...

    def end(self) -> None: ...


def execute_plan(
    asked: RunPlan,
    builtin: Callable[[], Path],
    audience: Audience,
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
        lanes = [stack.enter_context(Lane(s)) for s in settings(common, own, pin=asked.affinity)]
        assembly = assemble(asked, lanes[0], builtin, audience.reading)
        if not planned(assembly):
            return None
        crew = stack.enter_context(_cluster(asked, common)) if asked.dask or asked.cluster else lanes
        store = stack.enter_context(Store(asked.results, create=True, keep=asked.keep, expel=True))
        opened(store)
        pairs = campaign.enter(store, asked, assembly, command)
        campaign.work(crew, store, asked, pairs, audience, assembly.absent)
        return finished(store, assembly)


def _cluster(asked: RunPlan, common: Setting) -> AbstractContextManager[Cluster]:
    from cpbench.bench.cluster import lenders

    if asked.dask:
        return lenders.connect(asked.dask, common)
    return lenders.start(asked.cluster or "", common, asked.jobs if asked.jobs > 1 else None)
