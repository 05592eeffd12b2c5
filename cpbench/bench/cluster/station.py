"""A process with one lane, on any machine of a cluster: blocks come in through a pipe, outcomes go out.

It is started and fed by `keeper`, inside a Dask worker. Solves need a process of their own there: a Dask worker runs
its tasks in threads that come and go, is itself a daemon that may have no children by `multiprocessing`, and keeps
the modules of the first run that it served.
"""

from __future__ import annotations

import os
import platform
import queue
import signal
import sys
import threading
import time
from collections.abc import Iterable, Mapping
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NoReturn

import cpbench
from cpbench import frames
from cpbench.bench.cluster.keeper import END
from cpbench.registry import DECLARED, PLUGIN_FILES
from cpbench.temporary import RUN, TemporaryHome

PARTING = 20.0
"""Seconds a station may take to end after it was told to."""


def main() -> None:
    """Serve whoever holds the other end of the pipe whose number is the argument, until it is closed or SIGTERM."""
    signal.signal(signal.SIGTERM, _leave)
    connection = Connection(int(sys.argv[1]))
    inbox: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(connection, inbox), daemon=True).start()
    try:
        header, sources = frames.unpack(inbox.get())
        scratch = TemporaryHome(RUN)
        try:
            _serve(connection, inbox, header, sources, scratch.folder)
        finally:
            scratch.remove()
    except (KeyboardInterrupt, BrokenPipeError):
        return


def _leave(*_: object) -> NoReturn:
    """End what is being done; told again while it ends, it goes on ending."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    raise KeyboardInterrupt


def _listen(connection: Connection, inbox: queue.SimpleQueue[bytes]) -> None:
    """Take messages in; at the end of the pipe the whole process ends, as by Ctrl-C."""
    try:
        while True:
            inbox.put(connection.recv_bytes())
    except (EOFError, OSError):
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(PARTING)
        os._exit(1)


def _serve(
    connection: Connection,
    inbox: queue.SimpleQueue[bytes],
    opening: Mapping[str, Any],
    sources: Mapping[str, bytes],
    folder: Path,
) -> None:
    if opening["cpbench"] != cpbench.__version__:
        message = f"has cpbench {cpbench.__version__}, and the run is of {opening['cpbench']}"
        connection.send_bytes(frames.pack({"event": "refused", "message": message}))
        return
    os.environ[PLUGIN_FILES] = os.pathsep.join(_plugins(opening["plugins"], sources, folder))
    os.environ[DECLARED] = opening["solvers"]
    # what knows solvers and conversions looks for plugins when it is imported
    from cpbench.bench import machine
    from cpbench.bench.cluster.outpost import Outpost
    from cpbench.bench.lane import Lane
    from cpbench.bench.worker_pool import Setting

    with Lane(Setting(**opening["setting"])) as lane:
        described = {**machine.describe(), **{f"version {k}": v for k, v in machine.versions().items()}}
        connection.send_bytes(frames.pack({"event": "ready", "host": platform.node(), "machine": described}))
        outpost = Outpost(lane, folder)
        while True:
            header, vectors = frames.unpack(inbox.get())
            try:
                for message in outpost.work(header, vectors):
                    connection.send_bytes(message)
            except BrokenPipeError:
                raise
            except Exception as error:  # of this machine: no solver, conversion or file makes a lane raise
                failed = {"event": "failed", "message": f"{type(error).__name__}: {error}"}
                connection.send_bytes(frames.pack(failed))
            connection.send_bytes(END)


def _plugins(names: Iterable[str], sources: Mapping[str, bytes], folder: Path) -> list[str]:
    """Return the plugin files: where they stand, if this machine has the same, else written into `folder`."""
    found: list[str] = []
    for place, name in enumerate(names):
        path = Path(name)
        if not (path.is_file() and path.read_bytes() == sources[name]):
            path = folder / f"plugin-{place}" / path.name
            path.parent.mkdir()
            path.write_bytes(sources[name])
        found.append(str(path))
    return found
