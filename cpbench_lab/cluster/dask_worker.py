"""The part of a run that is executed inside a Dask worker: it keeps a process that solves (`remote_worker`), and passes
messages on.

The plugin is installed in every worker, those that join later too. The process ends with the Dask worker, whatever ends
that (the pipe between them is closed), at the end of its run, and when nothing was asked for a while.
"""

from __future__ import annotations

import contextlib
import subprocess
import threading
from dataclasses import dataclass
from multiprocessing import Pipe
from typing import Any

from distributed import Worker, WorkerPlugin, get_worker

import cpbench
from cpbench.foundation.child_processes import start_python
from cpbench_lab.cluster.remote_worker import IDLE, WorkerSetup

CLOSING = 5.0
"""Seconds which a remote worker may take to end by itself."""
_MAIN = "from cpbench_lab.cluster.remote_worker import main; main()"
_solving = threading.Lock()
"""One solve at a time in this process, whatever runs it serves."""


@dataclass(frozen=True)
class TaskResult:
    """The result of a task.

    Attributes
    ----------
    worker : address of the Dask worker. machine : host and description of its machine, where known. outcomes : of the
    first pairs of the block, pickled, since only the client has the modules of the run. died : how the remote worker
    ended that was to answer, "" where it lives.
    """

    worker: str
    machine: tuple[str, dict[str, Any]] | None
    outcomes: tuple[bytes, ...]
    died: str = ""


class RemoteWorkerPlugin(WorkerPlugin):
    """A remote worker in every Dask worker, each of which needs the cpbench of the run.

    setup : the first message for every remote worker.
    """

    def __init__(self, setup: WorkerSetup) -> None:
        self._setup, self._version = setup, cpbench.__version__

    def setup(self, worker: Worker) -> None:
        """Prepare the process; raises RuntimeError where the machine has another cpbench."""
        if cpbench.__version__ != self._version:
            raise RuntimeError(
                f"{worker.address}: has cpbench {cpbench.__version__}, and the run is of {self._version}"
            )
        self.process = RemoteWorker(self._setup)

    def teardown(self, worker: Worker) -> None:
        """End the remote worker, in the middle of a solve if need be."""
        self.process.end()


def run_block(run: str, request: bytes) -> TaskResult:
    """Return what the remote worker of a run answers to a request: a block and seconds, pickled."""
    worker: Any = get_worker()
    with _solving:
        return worker.plugins[run].process.ask(worker.address, request)


class RemoteWorker:
    """The process of `remote_worker` and the pipe to it; started when it is needed."""

    def __init__(self, setup: WorkerSetup, idle: float = IDLE) -> None:
        self._setup, self._idle = setup, idle
        self._process: subprocess.Popen[bytes] | None = None
        self._pipe: Any = None
        self._machine: tuple[str, dict[str, Any]] | None = None

    def ask(self, worker: str, request: bytes, *, again: bool = True) -> TaskResult:
        """Return all that the process answers; `again` : whether one that was idle as the request came is started
        anew."""
        outcomes: list[bytes] = []
        try:
            self._start()
            self._pipe.send(request)
            while (outcome := self._pipe.recv()) is not None:
                outcomes.append(outcome)
            return TaskResult(worker, self._machine, tuple(outcomes))
        except (EOFError, OSError) as cause:
            process, self._process = self._process, None
            code = None if process is None else _exit_code(process)
            if code == 0 and again and not outcomes:
                return self.ask(worker, request, again=False)
            died = f"could not be started ({cause})" if process is None else f"it ended with code {code}"
            return TaskResult(worker, self._machine, tuple(outcomes), died)

    def end(self) -> None:
        """Tell the process to end, and wait for that in a thread."""
        process, self._process = self._process, None
        if process is not None:
            process.terminate()
            threading.Thread(target=_exit_code, args=(process,), daemon=True).start()

    def _start(self) -> None:
        if self._process is not None and self._process.poll() is None:
            return
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


def _exit_code(process: subprocess.Popen[bytes]) -> int:
    with contextlib.suppress(subprocess.TimeoutExpired):
        return process.wait(CLOSING)
    process.kill()
    return process.wait()
