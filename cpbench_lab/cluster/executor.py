"""An executor of blocks on many machines: Dask schedules them, a remote worker on each machine runs them as a slot here
does, and this process takes the outcomes in.

All machines see the files of the run under the same paths, and have the same cpbench. A task is a block. It ends after
about `TASK` seconds, and what is left of its block is a new task. Dask repeats a task whose worker was lost, and gives
up on one that has lost several; such a block is run once more, each pair alone and after all others, and what then ends
a worker again has the status `crash`.
"""

from __future__ import annotations

import contextlib
import logging
import math
import os
import pickle
import queue
import time
import uuid
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import CancelledError
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from cpbench.bench.block import Block, Ending
from cpbench.bench.events import EventHandler, Solving, Told
from cpbench.bench.planning.plan import Pair
from cpbench.bench.results.rows import Outcome
from cpbench.bench.worker_pool import Setting
from cpbench.errors import CpbenchError
from cpbench.foundation.text import counted, some_of
from cpbench.registry import DECLARED, PLUGIN_FILES, TABLES
from cpbench_lab.cluster.dask_worker import RemoteWorkerPlugin, TaskResult, run_block
from cpbench_lab.cluster.remote_worker import WorkerSetup

logger = logging.getLogger("cpbench.bench")

TASK = 2.0
"""Seconds after which a task ends: a worker that is lost loses no more, and one that joins late finds work."""
AHEAD = 2
"""Tasks submitted for every worker: one at work, and one that is there when it ends."""
HOSTS = 8
"""The most hosts that are named."""
LOOK = 0.5
"""Seconds between two looks at which workers there are."""


class DaskExecutor:
    """The executor behind a Dask scheduler. Use as a context manager; `close` ends what `ending` names too."""

    reference: Setting | None = None

    def __init__(self, client: Any, setting: Setting, ending: Iterable[Callable[[], None]] = ()) -> None:
        self.machines: dict[str, dict[str, Any]] = {}
        self._client, self._setting = client, setting
        self._ending = (client.close, *ending)

    def __enter__(self) -> DaskExecutor:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Leave the scheduler, and end what was started with it."""
        for end in self._ending:
            with contextlib.suppress(Exception):  # what is lost need not be closed
                end()

    def outcomes(self, todo: Sequence[Block], on_event: EventHandler) -> Generator[tuple[Pair, Outcome]]:
        """Yield the outcome of every pair, with its host; raises CpbenchError where a worker cannot run them, or the
        scheduler is lost."""
        run = _Run(self._client, todo, on_event, self.machines)
        try:
            try:
                self._client.register_plugin(RemoteWorkerPlugin(_worker_setup(self._setting)), name=run.name)
            except Exception as cause:
                raise CpbenchError(f"a worker of the Dask cluster cannot be used: {cause}") from None
            yield from run.outcomes()
        finally:
            run.stop()


@dataclass(frozen=True)
class _Task:
    """A block to be run. `died` : how the worker ended that ran it first, "" for a first try."""

    block: Block
    died: str = ""


class _Run:
    """The blocks of one run, and the tasks by which they are done."""

    def __init__(
        self, client: Any, todo: Iterable[Block], on_event: EventHandler, machines: dict[str, dict[str, Any]]
    ) -> None:
        self._client, self._on_event, self._machines = client, on_event, machines
        self.name = f"cpbench-{uuid.uuid4().hex}"
        self._waiting = deque(_Task(block) for block in todo)  # suspects at the end, the rest of a block in front
        self._submitted: dict[str, tuple[_Task, Any]] = {}
        self._ended: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._workers: dict[str, Any] = {}
        self._count, self._joined, self._looked = 0, -1, -math.inf
        self._pairs: Counter[str] = Counter()

    def outcomes(self) -> Generator[tuple[Pair, Outcome]]:
        """Yield the outcome of every pair."""
        while self._waiting or self._submitted:
            self._look()
            # not all at once: messages of large plans would fill the scheduler's memory
            while self._waiting and len(self._submitted) < AHEAD * len(self._workers):
                self._submit(self._waiting.popleft())
            with contextlib.suppress(queue.Empty):
                key = self._ended.get(timeout=LOOK)
                yield from self._take_in(*self._submitted.pop(key))

    def stop(self) -> None:
        """Cancel all tasks and end the remote workers, in the middle of solves if need be."""
        with contextlib.suppress(Exception):  # where the scheduler is lost, nothing is left to cancel
            self._client.cancel([future for _, future in self._submitted.values()])
            self._client.unregister_worker_plugin(self.name)
        if self._pairs:
            shares = [f"{host} {counted(count, 'pair')}" for host, count in self._pairs.most_common()]
            self._on_event(Told(f"ran on {counted(len(shares), 'host')} ({some_of(shares, HOSTS)})"))

    def _look(self) -> None:
        """Look at which workers there are, unless that was a moment ago; tell of those that joined or were lost."""
        if time.monotonic() - self._looked <= LOOK:
            return
        before = self._workers
        try:
            self._workers = dict(self._client.sync(self._client.scheduler.identity, n_workers=-1)["workers"])
        except Exception as cause:
            raise CpbenchError(
                f"the Dask scheduler does not answer any more ({cause}); what was finished is kept, and the same "
                "command goes on"
            ) from None
        self._looked = time.monotonic()
        for address in before.keys() - self._workers.keys():
            logger.warning("a Dask worker was lost: %s (%s)", before[address].get("host"), address)
        if len(self._workers) != self._joined:
            self._joined = len(self._workers)
            hosts = sorted({str(worker.get("host", "")) for worker in self._workers.values()})
            on = f" on {counted(len(hosts), 'host')} ({some_of(hosts, HOSTS)})" if hosts else ""
            self._on_event(Told(f"Dask: {counted(self._joined, 'worker')}{on}"))

    def _submit(self, task: _Task) -> None:
        request = pickle.dumps((task.block, 0.0 if task.died else TASK))
        self._count += 1
        key = f"{self.name}-{self._count}"
        future = self._client.submit(run_block, self.name, request, key=key)
        self._submitted[key] = task, future
        future.add_done_callback(lambda done: self._ended.put(done.key))
        self._on_event(Solving(task.block.pairs[0]))

    def _take_in(self, task: _Task, future: Any) -> Iterator[tuple[Pair, Outcome]]:
        """Yield the outcomes of a task that has ended; what is left of its block waits again."""
        try:
            result: TaskResult = future.result()
        except CancelledError:  # the scheduler is gone, as the next look says
            self._looked = -math.inf
            self._waiting.appendleft(task)
            return
        except Exception as cause:
            result = TaskResult("", None, (), f"{type(cause).__name__}: {cause}")
        host = self._host(result)
        endings: dict[str, Ending] = {}
        for pair, outcome in zip(task.block.pairs, map(pickle.loads, result.outcomes), strict=False):
            endings[pair.key] = outcome.status, outcome.answer
            self._pairs[host] += 1
            yield pair, replace(outcome, jobs=self._jobs(result.worker))
        rest = task.block.rest(endings)
        if rest is not None and result.died:
            yield from self._suspect(_Task(rest, task.died), result.died, host)
        elif rest is not None:
            self._waiting.appendleft(_Task(rest, task.died))

    def _suspect(self, task: _Task, died: str, host: str) -> Iterator[tuple[Pair, Outcome]]:
        """Run each pair of a block alone after all others, or all of it where they start from one another; yield the
        crash of the first pair where it was alone already."""
        rest: Block | None = task.block
        died = f"{died} on {host}" if host else died
        if task.died:
            pair = task.block.pairs[0]
            message = f"its machine's worker died twice while it ran ({task.died}; {died})"
            at = time.strftime("%Y-%m-%dT%H:%M:%S")
            yield pair, Outcome(status="crash", message=message, finished=at, host=host or None)
            rest = task.block.rest({pair.key: ("crash", None)})
        while rest is not None:
            alone, rest = (rest, None) if rest.chained else rest.cut(1)
            self._waiting.append(_Task(alone, died))

    def _host(self, result: TaskResult) -> str:
        """Return the host of a result's worker, whose machine is noted."""
        if result.machine is None:
            return ""
        host, machine = result.machine
        self._machines[host] = machine
        return host

    def _jobs(self, worker: str) -> int:
        """Return how many workers there are on the machine of one."""
        host = self._workers.get(worker, {}).get("host")
        return max(1, sum(other.get("host") == host for other in self._workers.values()))


def _worker_setup(setting: Setting) -> WorkerSetup:
    """Return the first message for remote workers; of files of tables, what they declare is sent."""
    names = [name for name in os.environ.get(PLUGIN_FILES, "").split(os.pathsep) if not name.endswith(TABLES)]
    # cores and slots side by side are of this machine
    anywhere = {k: v for k, v in asdict(setting).items() if k not in ("cpus", "slots")}
    return WorkerSetup(str(Path.cwd()), anywhere, os.pathsep.join(names), os.environ.get(DECLARED, ""))
