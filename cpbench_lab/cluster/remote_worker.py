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
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any, NoReturn

from cpbench.registry import DECLARED, PLUGIN_FILES

IDLE = 300.0
"""Seconds after which the process ends that nothing was asked of: a client that was killed takes nothing back."""
CLOSING = 20.0
"""Seconds this process may take to end once the other end of its pipe is closed."""


@dataclass(frozen=True)
class WorkerSetup:
    """The first message to a remote worker: the client's folder, from which files have the paths of the run, the fields
    of its `Setting`, the paths of plugin files, and declared solvers."""

    folder: str
    setting: Mapping[str, Any]
    plugins: str
    solvers: str


def main() -> None:
    """Serve the other end of the pipe whose number is the first argument, until it is closed, SIGTERM comes, or nothing
    was asked for as many seconds as the second argument says."""
    signal.signal(signal.SIGTERM, _interrupt)
    connection = Connection(int(sys.argv[1]))
    requests: queue.SimpleQueue[Any] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(connection, requests), daemon=True).start()
    with contextlib.suppress(KeyboardInterrupt, BrokenPipeError, queue.Empty):
        setup: WorkerSetup = requests.get()
        os.chdir(setup.folder)
        os.environ[PLUGIN_FILES], os.environ[DECLARED] = setup.plugins, setup.solvers
        _serve(connection, requests, setup.setting, float(sys.argv[2]))


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


def _serve(connection: Connection, requests: queue.SimpleQueue[Any], setting: Mapping[str, Any], idle: float) -> None:
    """Run the pairs of each block that comes, as many as end within its seconds, one at least; send the outcomes,
    pickled, and None behind them."""
    # what knows solvers and conversions looks for plugins when it is imported: not before these are set
    from cpbench.bench import block as blocks
    from cpbench.bench import machine
    from cpbench.bench.slot import Slot
    from cpbench.bench.worker_pool import Setting

    with Slot(Setting(**setting)) as slot:
        described = {**machine.describe(), **{f"version {k}": v for k, v in machine.versions().items()}}
        connection.send((platform.node(), described))
        while True:
            block, seconds = pickle.loads(requests.get(timeout=idle))
            deadline = time.monotonic() + seconds
            for _, outcome in blocks.run(slot, block):
                connection.send(pickle.dumps(outcome))
                if time.monotonic() > deadline:
                    break
            connection.send(None)
