"""An executor of blocks on many machines: Dask schedules them, a remote worker on each machine runs them as a slot here
does, and this process takes the outcomes in.

A task is a block. It ends after about `TASK` seconds, and what is left of its block is a new task. Dask repeats a task
whose worker was lost, but does not know that the task may be the reason: such a block is run once more, each pair
alone and after all others, and what then ends a worker again has the status `crash`.
"""

from __future__ import annotations

import contextlib
import logging
import math
import os
import pickle
import queue
import threading
import time
import uuid
from asyncio import CancelledError as AsyncCancelled
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import CancelledError as FutureCancelled
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from distributed import Event

from cpbench import storage
from cpbench.bench.block import Block, Ending
from cpbench.bench.events import EventHandler, Solving, Told
from cpbench.bench.planning.plan import Pair
from cpbench.bench.results.rows import Outcome
from cpbench.bench.worker_pool import Setting
from cpbench.errors import CpbenchError
from cpbench.foundation.text import counted, some_of
from cpbench.registry import DECLARED, PLUGIN_FILES, TABLES
from cpbench.storage.base import split_address
from cpbench_lab.cluster.dask_worker import RemoteWorkerPlugin, TaskResult, run_block
from cpbench_lab.cluster.remote_worker import FilesWanted, PairEnded, RunBlock, WorkerSetup

logger = logging.getLogger("cpbench.bench")

TASK = 2.0
"""Seconds after which a task ends: a worker that is lost loses no more, and one that joins late finds work."""
AHEAD = 2
"""Tasks submitted for every worker: one at work, and one that is there when it ends."""
HOSTS = 8
"""The most hosts that are named."""
LOOK = 0.5
"""Seconds between two looks at which workers there are."""
FETCH = 30.0
"""Seconds a worker may take to hand over a result, before it is asked again."""
CLOSING = 5.0
"""Seconds in which workers are to end what they are doing, when a run ends."""
LONELY = 10.0
"""Seconds without any worker after which a warning says so."""


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
        """Yield the outcome of every pair, with its host; raises CpbenchError when no worker can or will run them."""
        run = _Run(self._client, _worker_setup(self._setting), todo, on_event, self.machines)
        try:
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
        self,
        client: Any,
        setup: WorkerSetup,
        todo: Iterable[Block],
        on_event: EventHandler,
        machines: dict[str, dict[str, Any]],
    ) -> None:
        self._client, self._on_event, self._machines = client, on_event, machines
        self._name = f"cpbench-{uuid.uuid4().hex}"
        self._plugin = RemoteWorkerPlugin(self._name, setup)
        self._waiting = deque(_Task(block) for block in todo)  # suspects at the end, the rest of a block in front
        self._submitted: dict[str, tuple[_Task, Any]] = {}
        self._ended: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._wanted: dict[str, str | None] = {}
        self._copies: dict[str, Any] = {}
        self._workers: dict[str, Any] = {}
        self._refusal = ""
        self._count, self._looked = 0, -math.inf
        self._joined = -1
        self._pairs: Counter[str] = Counter()
        self._seconds = 0.0
        self._alone_since = time.monotonic()

    def outcomes(self) -> Generator[tuple[Pair, Outcome]]:
        """Yield the outcome of every pair."""
        try:
            self._client.register_plugin(self._plugin, name=self._name)
        except Exception as cause:  # of one worker: the others have the plugin
            self._refuse(str(cause))
        while self._waiting or self._submitted:
            usable = self._look()
            # not all at once: messages of large plans would fill the scheduler's memory
            while self._waiting and len(self._submitted) < AHEAD * usable:
                self._submit(self._waiting.popleft())
            with contextlib.suppress(queue.Empty):
                key = self._ended.get(timeout=LOOK)
                yield from self._take_in(key, *self._submitted.pop(key))

    def stop(self) -> None:
        """Cancel all tasks and end the remote workers, in the middle of solves if need be."""
        for _, future in self._submitted.values():
            with contextlib.suppress(Exception):  # where the scheduler is lost, nothing is left to cancel
                future.cancel()

        def remove() -> None:
            with contextlib.suppress(Exception):
                self._client.unregister_worker_plugin(self._name)

        # a worker that does not answer would hold up this process
        thread = threading.Thread(target=remove, daemon=True)
        thread.start()
        thread.join(CLOSING)
        if self._pairs:
            shares = [f"{host} {counted(count, 'pair')}" for host, count in self._pairs.most_common()]
            ran = f"ran on {counted(len(shares), 'host')} ({some_of(shares, HOSTS)})"
            self._on_event(Told(f"{ran}: {self._seconds / 3600:.2g} CPU hours"))

    def _look(self) -> int:
        """Return how many workers can be used, as of a moment ago; warn of those that were lost."""
        if time.monotonic() - self._looked > LOOK:
            before = self._workers
            try:
                found = self._client.sync(self._client.scheduler.identity, n_workers=-1)["workers"]
            except Exception as cause:
                raise CpbenchError(
                    f"the Dask scheduler does not answer any more ({cause}); what was finished is kept, and the same "
                    "command goes on"
                ) from None
            self._workers, self._looked = dict(found), time.monotonic()
            lost = before.keys() - self._workers.keys()
            for address in lost:
                logger.warning("a Dask worker was lost: %s (%s)", before[address].get("host"), address)
            if lost:
                self._cancel_stranded()
        able = [worker for worker in self._workers.values() if worker.get("resources", {}).get(self._name)]
        usable = len(able)
        if usable != self._joined:
            self._joined = usable
            hosts = sorted({str(worker.get("host", "")) for worker in able})
            on = f" on {counted(len(hosts), 'host')} ({some_of(hosts, HOSTS)})" if hosts else ""
            dashboard = _dashboard(self._client)
            watch = f"; dashboard: {dashboard}" if dashboard else ""
            self._on_event(Told(f"Dask: {counted(usable, 'worker')}{on}{watch}"))
        if usable:
            self._alone_since = time.monotonic()
        elif self._workers and self._refusal:
            raise CpbenchError(f"no worker of the Dask cluster can be used: {self._refusal}")
        elif time.monotonic() - self._alone_since > LONELY:
            logger.warning("no Dask worker is there; waiting for one to join")
            self._alone_since = math.inf
        return usable

    def _cancel_stranded(self) -> None:
        """Cancel tasks for which no worker was left: Dask does not give them to one that offers its resource later."""
        processing = {key for keys in self._client.processing().values() for key in keys}
        for key, (_, future) in self._submitted.items():
            if key not in processing and not future.done():
                future.cancel()

    def _refuse(self, why: str) -> None:
        self._refusal = why
        logger.warning("a Dask worker is not used: %s", why)

    def _submit(self, task: _Task) -> None:
        """Submit a block, with copies of those of its files that some worker did not find."""
        block = task.block.moved(os.path.abspath)
        files = {str(split_address(pair.address)[0]) for pair in (*block.pairs, *block.before.values())}
        for file in files & self._wanted.keys() - self._copies.keys():  # Dask hands the copy on from worker to worker
            (self._copies[file],) = self._client.scatter([_contents(file, self._wanted[file])], hash=False)
        copies = {file: self._copies[file] for file in files & self._copies.keys()}
        request = pickle.dumps(RunBlock(block, 0.0 if task.died else TASK))
        self._count += 1
        key = f"{self._name}-{self._count}"
        future = self._client.submit(run_block, self._name, key, request, copies, key=key, resources={self._name: 1})
        self._submitted[key] = task, future
        future.add_done_callback(lambda done: self._ended.put(done.key))
        self._on_event(Solving(task.block.pairs[0]))

    def _take_in(self, key: str, task: _Task, future: Any) -> Iterator[tuple[Pair, Outcome]]:
        """Yield the outcomes of a task that has ended; what is left of its block waits again."""
        try:
            result: TaskResult | None = future.result(timeout=FETCH)
        except TimeoutError:
            self._submitted[key] = task, future
            self._ended.put(key)
            return
        except (FutureCancelled, AsyncCancelled):  # the scheduler is gone, or the last worker, or copies of files
            self._looked = -math.inf
            self._look()
            self._copies.clear()
            if not Event(key, client=self._client).is_set():
                self._waiting.appendleft(task)
                return
            result = None
        except Exception as cause:
            result = TaskResult(died=f"{type(cause).__name__}: {cause}")
        if result is None:
            result = TaskResult(died="a Dask worker was lost")
        host = self._host(result)
        self._seconds += result.seconds
        endings: dict[str, Ending] = {}
        for reply in map(pickle.loads, result.replies):
            if isinstance(reply, PairEnded):
                pair, outcome = task.block.pairs[reply.place], reply.outcome
                endings[pair.key] = outcome.status, outcome.answer
                self._pairs[host] += 1
                message = outcome.message and outcome.message.replace(reply.file, str(split_address(pair.address)[0]))
                yield pair, replace(outcome, jobs=self._jobs(result.worker), message=message)
            elif isinstance(reply, FilesWanted):
                self._wanted |= reply.files
        rest = task.block.rest(endings)
        if result.failed:
            self._refuse(f"{host}: {result.failed}")
        if rest is None:
            return
        if result.died:
            yield from self._suspect(_Task(rest, task.died), result.died, host)
        else:
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
            return str(self._workers.get(result.worker, {}).get("host", ""))
        host, machine = result.machine
        self._machines[host] = machine
        return host

    def _jobs(self, worker: str) -> int:
        """Return how many workers there are on the machine of one."""
        host = self._workers.get(worker, {}).get("host")
        return max(1, sum(other.get("host") == host for other in self._workers.values()))


def _dashboard(client: Any) -> str:
    """Return the address of the scheduler's dashboard, '' where it has none."""
    try:
        return str(client.dashboard_link)
    except (KeyError, AttributeError):
        return ""


def _contents(file: str, format: str | None) -> dict[str, bytes]:
    """Return the contents of all files that a problem is read from; none where they cannot be read here either."""
    try:
        return {path.name: path.read_bytes() for path in storage.files(file, format)}
    except (CpbenchError, OSError):
        return {}


def _worker_setup(setting: Setting) -> WorkerSetup:
    """Return the first message for remote workers.

    Files of tables stay here: what they declare is sent, with the paths that it has here.
    """
    names = [name for name in os.environ.get(PLUGIN_FILES, "").split(os.pathsep) if name and not name.endswith(TABLES)]
    # cores and slots side by side are of this machine
    anywhere = {k: v for k, v in asdict(setting).items() if k not in ("cpus", "slots")}
    return WorkerSetup(anywhere, {name: Path(name).read_bytes() for name in names}, os.environ.get(DECLARED, ""))
