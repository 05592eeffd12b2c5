"""The part of a run that is executed inside a Dask worker: it keeps a process that solves (`remote_worker`), and passes
messages on.

The plugin is installed in every worker, those that join later too. A worker that can take part offers one unit of a
resource named after the run; Dask then gives it one block at a time. The process ends with the Dask worker, whatever
ends that (the pipe between them is closed), at the end of its run, and when nothing was asked for a while (a client
that was killed removes no plugin).
"""

from __future__ import annotations

import contextlib
import subprocess
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from multiprocessing import Pipe
from typing import Any, TypeAlias

from distributed import Event, Worker, WorkerPlugin, get_worker

import cpbench
from cpbench.foundation.child_processes import start_python
from cpbench_lab.cluster.remote_worker import RequestEnded, WorkerSetup

IDLE = 300.0
"""Seconds after which a remote worker ends that nothing was asked of."""
CLOSING = 5.0
"""Seconds which a remote worker may take to end by itself."""
_MAIN = "from cpbench_lab.cluster.remote_worker import main; main()"
Contents: TypeAlias = Mapping[str, bytes]
"""A file and those that belong to it, by name."""
_solving = threading.Lock()
"""One solve at a time in this process, whatever runs it serves."""


@dataclass(frozen=True)
class TaskResult:
    """The result of a task.

    Attributes
    ----------
    worker : address of the Dask worker. machine : host and description of its machine, where known. replies : pickled,
    since only the client has the modules of the run. died : how the remote worker ended that was to answer. failed :
    why this machine can take no further block. seconds : time of processors that it took [s], 0 where it died.
    """

    worker: str = ""
    machine: tuple[str, dict[str, Any]] | None = None
    replies: tuple[bytes, ...] = ()
    died: str = ""
    failed: str = ""
    seconds: float = 0.0


class RemoteWorkerPlugin(WorkerPlugin):
    """A remote worker in every Dask worker that has the cpbench of the run.

    name : of the run, and of its resource. setup : the first message for every remote worker.
    """

    def __init__(self, name: str, setup: WorkerSetup) -> None:
        self.name, self._setup, self._version = name, setup, cpbench.__version__

    async def setup(self, worker: Worker) -> None:
        """Offer the resource; raises RuntimeError where the machine has another cpbench."""
        if cpbench.__version__ != self._version:
            raise RuntimeError(
                f"{worker.address}: has cpbench {cpbench.__version__}, and the run is of {self._version}"
            )
        self.process = RemoteWorker(self._setup)
        await worker.set_resources(**{self.name: 1})

    async def teardown(self, worker: Worker) -> None:
        """End the remote worker, in the middle of a solve if need be."""
        self.process.end()
        await worker.set_resources(**{self.name: 0})


def run_block(run: str, task: str, request: bytes, copies: Mapping[str, Contents]) -> TaskResult | None:
    """Return what the remote worker of a run answers to a request; `copies` are of files that it may lack.

    None where the task was begun before: Dask repeats what a lost worker was doing, but what kills a worker is not to
    kill all of them one after the other. The client decides.
    """
    worker: Any = get_worker()
    begun = Event(task)
    with _solving:
        if begun.is_set():
            return None
        begun.set()
        result = worker.plugins[run].process.ask(worker.address, request, copies)
    if result.failed:
        worker.loop.add_callback(worker.set_resources, **{run: 0})
    begun.clear()
    return result


class RemoteWorker:
    """The process of `remote_worker` and the pipe to it; started when it is needed."""

    def __init__(self, setup: WorkerSetup, idle: float = IDLE) -> None:
        self._setup, self._idle = setup, idle
        self._lock = threading.RLock()
        self._process: subprocess.Popen[bytes] | None = None
        self._pipe: Any = None
        self._machine: tuple[str, dict[str, Any]] | None = None
        self._copied = set[str]()
        self._seconds = 0.0

    def ask(self, worker: str, request: bytes, copies: Mapping[str, Contents]) -> TaskResult:
        """Return all that the process answers."""
        result, code = self._ask(worker, request, copies)
        if code == 0 and not result.replies:  # idle for so long that it ended as the request came
            result, _ = self._ask(worker, request, copies)
        return result

    def _ask(self, worker: str, request: bytes, copies: Mapping[str, Contents]) -> tuple[TaskResult, int | None]:
        """Return the same with the exit code of a process that ended meanwhile, else None."""
        try:
            self._start()
        except (EOFError, OSError) as cause:
            code = self._exit()
            why = cause if code is None else _ended(code)
            return TaskResult(worker, failed=f"no process could be started ({why})"), None
        replies: list[bytes] = []
        try:
            self._pipe.send((request, {file: copies[file] for file in copies.keys() - self._copied}))
            self._copied |= copies.keys()
            while isinstance(reply := self._pipe.recv(), bytes):
                replies.append(reply)
            ended: RequestEnded = reply
            before, self._seconds = self._seconds, ended.seconds
            spent = ended.seconds - before
            return TaskResult(worker, self._machine, tuple(replies), failed=ended.failed, seconds=spent), None
        except (EOFError, OSError):
            code = self._exit()
            died = "it was ended" if code is None else _ended(code)
            return TaskResult(worker, self._machine, tuple(replies), died=died), code

    def end(self) -> None:
        """Tell the process to end, and wait for that in a thread."""
        with self._lock:
            process, self._process = self._process, None
        if process is not None:
            process.terminate()
            threading.Thread(target=_exit_code, args=(process,), daemon=True).start()

    def _start(self) -> None:
        with self._lock:
            if self._process is not None and self._process.poll() is None:
                return
            self._copied.clear()
            self._seconds = 0.0
            self._pipe, theirs = Pipe()
            self._process = start_python(
                _MAIN,
                str(theirs.fileno()),
                str(self._idle),
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                start_new_session=True,  # Ctrl-C in a terminal is for the client
            )
            theirs.close()
        self._pipe.send(self._setup)
        self._machine = self._pipe.recv()

    def _exit(self) -> int | None:
        with self._lock:
            process, self._process = self._process, None
        return _exit_code(process) if process is not None else None


def _ended(code: int) -> str:
    return f"it ended with code {code}"


def _exit_code(process: subprocess.Popen[bytes]) -> int:
    with contextlib.suppress(subprocess.TimeoutExpired):
        return process.wait(CLOSING)
    process.kill()
    return process.wait()
