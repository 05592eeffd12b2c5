"""A process with one slot, on any machine of a cluster: blocks come in through a pipe, outcomes go out.

It is started inside a Dask worker (`dask_worker`). Solves need a process of their own there: a Dask worker runs its
tasks in threads that come and go, is itself a daemon that may have no children by `multiprocessing`, and keeps the
modules of the first run that it served.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import platform
import queue
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import psutil

from cpbench.foundation.locks import RUN, TemporaryHome
from cpbench.registry import DECLARED, PLUGIN_FILES

if TYPE_CHECKING:  # what knows solvers and conversions looks for plugins when it is imported: not before these are set
    from cpbench.bench.block import Block
    from cpbench.bench.results.rows import Outcome
    from cpbench.bench.slot import Slot

CLOSING = 20.0
"""Seconds this process may take to end once the other end of its pipe is closed."""


@dataclass(frozen=True)
class WorkerSetup:
    """The first message to a remote worker: the fields of its `Setting`, plugin files, and declared solvers."""

    setting: Mapping[str, Any]
    plugins: Mapping[str, bytes]
    solvers: str


@dataclass(frozen=True)
class RunBlock:
    """A request for the outcomes of a block's pairs, of as many as can be run within `seconds`, one at least; pairs
    have the absolute paths of their files on the client's machine."""

    block: Block
    seconds: float


@dataclass(frozen=True)
class PairEnded:
    """The outcome of a block's pair, by its place in the block. `file` : what the problem was read from here."""

    place: int
    outcome: Outcome
    file: str


@dataclass(frozen=True)
class FilesWanted:
    """Files that are not on this machine, or hold something else than was planned, each with how it is read."""

    files: Mapping[str, str | None]


@dataclass(frozen=True)
class RequestEnded:
    """The end of the replies to a request: what failed on this machine, '' for nothing, and the time of processors [s]
    that the process and all that it started have taken so far."""

    failed: str
    seconds: float


def main() -> None:
    """Serve the other end of the pipe whose number is the first argument, until it is closed, SIGTERM comes, or nothing
    was asked for as many seconds as the second argument says."""
    signal.signal(signal.SIGTERM, _interrupt)
    connection = Connection(int(sys.argv[1]))
    requests: queue.SimpleQueue[Any] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(connection, requests), daemon=True).start()
    try:
        setup: WorkerSetup = requests.get()
        home = TemporaryHome(RUN)
        try:
            os.environ[PLUGIN_FILES] = os.pathsep.join(_plugin_files(setup.plugins, home.folder))
            os.environ[DECLARED] = setup.solvers
            _serve(connection, requests, setup.setting, home.folder, float(sys.argv[2]))
        finally:
            home.remove()
    except (KeyboardInterrupt, BrokenPipeError, queue.Empty):
        return


def _interrupt(*_: object) -> NoReturn:
    """End what is being done; a second signal, while that ends, is ignored."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    raise KeyboardInterrupt


def _listen(connection: Connection, requests: queue.SimpleQueue[Any]) -> None:
    """Take messages in; at the end of the pipe the whole process ends, as by Ctrl-C."""
    try:
        while True:
            requests.put(connection.recv())
    except (EOFError, OSError):
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(CLOSING)
        os._exit(1)


def _serve(
    connection: Connection, requests: queue.SimpleQueue[Any], setting: Mapping[str, Any], folder: Path, idle: float
) -> None:
    """Answer each request by its replies, pickled, and an `RequestEnded` behind them."""
    from cpbench.bench import machine
    from cpbench.bench.slot import Slot
    from cpbench.bench.worker_pool import Setting

    with Slot(Setting(**setting)) as slot:
        described = {**machine.describe(), **{f"version {k}": v for k, v in machine.versions().items()}}
        connection.send((platform.node(), described))
        files = FetchedFiles(slot, folder)
        while True:
            request, copies = requests.get(timeout=idle)
            failure = ""
            try:
                files.keep(copies)
                for reply in _run(pickle.loads(request), slot, files):
                    connection.send(pickle.dumps(reply))
            except BrokenPipeError:
                raise
            except Exception as error:  # of this machine: no solver, conversion or file makes a slot raise
                failure = f"{type(error).__name__}: {error}"
            connection.send(RequestEnded(failure, _processor_seconds()))


def _processor_seconds() -> float:
    """Return the time of processors that this process and all that it started have taken [s]."""
    own = psutil.Process()
    total = 0.0
    for process in (own, *own.children(recursive=True)):
        with contextlib.suppress(psutil.Error):  # it ended meanwhile: its parent has its time
            total += sum(process.cpu_times()[:4])
    return total


def _run(request: RunBlock, slot: Slot, files: FetchedFiles) -> Iterator[PairEnded | FilesWanted]:
    """Yield outcomes until the block is done or the seconds are over, or what files are wanted."""
    from cpbench.bench import block as blocks
    from cpbench.storage.base import split_address

    deadline = time.monotonic() + request.seconds
    if missing := files.missing(request.block):
        yield FilesWanted(missing)
        return
    block = request.block.moved(files.local)
    for k, (pair, outcome) in enumerate(blocks.run(slot, block)):
        yield PairEnded(k, outcome, str(split_address(pair.address)[0]))
        if time.monotonic() > deadline:
            return


class FetchedFiles:
    """The problem files of a run on this machine: those that the client's machine has too, or copies of them."""

    def __init__(self, slot: Slot, folder: Path) -> None:
        self._slot, self._folder = slot, folder
        self._local: dict[str, str] = {}

    def keep(self, copies: Mapping[str, Mapping[str, bytes]]) -> None:
        """Write files into folders of their own, each with those that belong to it, the one asked for first."""
        for file, contents in copies.items():
            folder = Path(tempfile.mkdtemp(dir=self._folder))
            for name, content in contents.items():
                (folder / name).write_bytes(content)
            # without contents the client cannot read it either: the row will say why
            self._local[file] = str(folder / next(iter(contents))) if contents else file

    def local(self, file: str) -> str:
        """Return the path that a file of the client has here."""
        return self._local[file]

    def missing(self, block: Block) -> dict[str, str | None]:
        """Return the files of a block that are not here, or hold something else than was planned."""
        from cpbench.bench.messages import Declined, Open, Opened
        from cpbench.bench.time_limits import REFEREE
        from cpbench.storage.base import split_address

        wanted: dict[str, str | None] = {}
        for pair in (*block.pairs, *block.before.values()):
            file = str(split_address(pair.address)[0])
            if file not in self._local:
                asked = Open(pair.address, pair.format, pair.fingerprint)
                reply = self._slot.referee.ask(REFEREE.limit(pair.limits.seconds), asked, Opened)
                if isinstance(reply, Declined):
                    wanted[file] = pair.format
                else:
                    self._local[file] = file
        return wanted


def _plugin_files(plugins: Mapping[str, bytes], folder: Path) -> Iterator[str]:
    """Yield the plugin files: where they are, if this machine has the same, else written into `folder`."""
    for k, (name, content) in enumerate(plugins.items()):
        path = Path(name)
        if not (path.is_file() and path.read_bytes() == content):
            path = folder / f"plugin-{k}" / path.name
            path.parent.mkdir()
            path.write_bytes(content)
        yield str(path)
