"""A process with one slot, on any machine of a cluster: blocks come in through a pipe, outcomes go out.

It is started inside a Dask worker (`dask_worker`). Solves need a process of their own there: a Dask worker runs its
tasks in threads that come and go, is itself a daemon that may have no children by `multiprocessing`, and keeps the
modules of the first run that it served.
"""

from __future__ import annotations

import os
import platform
import queue
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from cpbench import frames
from cpbench.registry import DECLARED, PLUGIN_FILES
from cpbench.temporary import RUN, TemporaryHome

if TYPE_CHECKING:  # what knows solvers and conversions looks for plugins when it is imported: not before these are set
    from cpbench.bench.block import Block
    from cpbench.bench.cluster.messages import FileCopies, FilesWanted, PairEnded, RunBlock
    from cpbench.bench.planning.plan import Pair
    from cpbench.bench.results.rows import Outcome
    from cpbench.bench.slot import Slot

MESSAGE, DONE = b"m", b"d"
"""First byte of what is sent: a message, or the end of an answer, with what went wrong on this machine."""
CLOSING = 20.0
"""Seconds this process may take to end once nobody is at the other end of its pipe."""


def main() -> None:
    """Serve the other end of the pipe whose number is the first argument, until it is closed, SIGTERM comes, or nothing
    was asked for as many seconds as the second argument says."""
    signal.signal(signal.SIGTERM, _interrupt)
    connection = Connection(int(sys.argv[1]))
    requests: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(connection, requests), daemon=True).start()
    try:
        terms, plugins = frames.unpack(requests.get())
        home = TemporaryHome(RUN)
        try:
            os.environ[PLUGIN_FILES] = os.pathsep.join(_plugin_files(terms["plugins"], plugins, home.folder))
            os.environ[DECLARED] = terms["solvers"]
            _serve(connection, requests, terms, home.folder, float(sys.argv[2]))
        finally:
            home.remove()
    except (KeyboardInterrupt, BrokenPipeError, queue.Empty):
        return


def _interrupt(*_: object) -> NoReturn:
    """End what is being done; a second signal, while that ends, is ignored."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    raise KeyboardInterrupt


def _listen(connection: Connection, requests: queue.SimpleQueue[bytes]) -> None:
    """Take messages in; at the end of the pipe the whole process ends, as by Ctrl-C."""
    try:
        while True:
            requests.put(connection.recv_bytes())
    except (EOFError, OSError):
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(CLOSING)
        os._exit(1)


def _serve(
    connection: Connection, requests: queue.SimpleQueue[bytes], terms: Mapping[str, Any], folder: Path, idle: float
) -> None:
    from cpbench.bench import machine, messages
    from cpbench.bench.cluster.messages import FileCopies, RunBlock
    from cpbench.bench.slot import Slot
    from cpbench.bench.worker_pool import Setting

    with Slot(Setting(**terms["setting"])) as slot:
        described = {**machine.describe(), **{f"version {k}": v for k, v in machine.versions().items()}}
        connection.send_bytes(frames.pack({"host": platform.node(), "machine": described}))
        files = LocalFiles(slot, folder)
        while True:
            request = messages.unpack(requests.get(timeout=idle))
            if isinstance(request, FileCopies):
                files.keep(request)
                continue
            failure = ""
            try:
                assert isinstance(request, RunBlock)
                for reply in _run(request, slot, files):
                    connection.send_bytes(MESSAGE + messages.pack(reply))
            except BrokenPipeError:
                raise
            except Exception as error:  # of this machine: no solver, conversion or file makes a slot raise
                failure = f"{type(error).__name__}: {error}"
            connection.send_bytes(DONE + failure.encode(errors="replace"))


def _run(request: RunBlock, slot: Slot, files: LocalFiles) -> Iterator[PairEnded | FilesWanted]:
    """Yield outcomes until the block is done or the seconds are over, or what files are wanted."""
    from cpbench.bench import block as blocks
    from cpbench.bench.cluster.messages import FilesWanted, PairEnded

    deadline = time.monotonic() + request.seconds
    if missing := files.missing(request):
        yield FilesWanted(tuple(missing))
        return
    pairs = request.pairs
    for k, (_, outcome) in enumerate(blocks.run(slot, files.placed(request))):
        yield PairEnded.of(k, files.renamed(request, pairs[k], outcome))
        # the rows that a history answers cost nothing, and would cost a solve in another request
        derived = k + 1 < len(pairs) and blocks.variant(pairs[k + 1]) == blocks.variant(pairs[k])
        if time.monotonic() > deadline and not derived:
            return


class LocalFiles:
    """The problem files of a run on this machine: those that the client's machine has too, or copies of them."""

    def __init__(self, slot: Slot, folder: Path) -> None:
        self._slot, self._folder = slot, folder
        self._local: dict[str, str] = {}

    def keep(self, copies: FileCopies) -> None:
        """Write files that belong together into a folder of their own."""
        folder = Path(tempfile.mkdtemp(dir=self._folder))
        for name, content in copies.vectors.items():
            (folder / name).write_bytes(content)
        first = next(iter(copies.vectors), None)
        self._local[copies.file] = copies.file if first is None else str(folder / first)

    def missing(self, request: RunBlock) -> list[str]:
        """Return the files of a request that are not here, or hold something else than was planned."""
        from cpbench.bench.messages import Declined, Open, Opened
        from cpbench.bench.time_limits import REFEREE

        wanted: list[str] = []
        for pair in (*request.pairs, *request.before.values()):
            file, member = request.files[pair.address]
            if file not in self._local:
                asked = Open(_address(file, member), pair.format, pair.fingerprint)
                reply = self._slot.referee.ask(REFEREE.limit(pair.limits.seconds), asked, Opened)
                if not isinstance(reply, Declined):
                    self._local[file] = file
                elif file not in wanted:
                    wanted.append(file)
        return wanted

    def placed(self, request: RunBlock) -> Block:
        """Return the block with the addresses its problems have here."""

        def placed(pair: Pair) -> Pair:
            file, member = request.files[pair.address]
            return replace(pair, address=_address(self._local[file], member))

        before = {key: placed(pair) for key, pair in request.before.items()}
        return replace(request.block, pairs=tuple(map(placed, request.pairs)), before=before)

    def renamed(self, request: RunBlock, pair: Pair, outcome: Outcome) -> Outcome:
        """Return the outcome with the client's address in its message."""
        file, member = request.files[pair.address]
        local, message = self._local[file], outcome.message or ""
        if local == file or local not in message:
            return outcome
        planned = pair.address.removesuffix(f"::{member}") if member else pair.address
        return outcome.changed(message=message.replace(local, planned))


def _address(file: str, member: str) -> str:
    return f"{file}::{member}" if member else file


def _plugin_files(names: list[str], contents: Mapping[str, bytes], folder: Path) -> Iterator[str]:
    """Yield the plugin files: where they are, if this machine has the same, else written into `folder`."""
    for k, name in enumerate(names):
        path = Path(name)
        if not (path.is_file() and path.read_bytes() == contents[name]):
            path = folder / f"plugin-{k}" / path.name
            path.parent.mkdir()
            path.write_bytes(contents[name])
        yield str(path)
