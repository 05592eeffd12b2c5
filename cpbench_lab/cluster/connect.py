"""Connects to a Dask scheduler that runs, or starts one with processes here."""

from __future__ import annotations

import importlib
import os
import re
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from cpbench.bench.worker_pool import Setting
from cpbench.errors import CpbenchError

if TYPE_CHECKING:
    from cpbench_lab.cluster.executor import DaskExecutor

LOCAL = "local"
ANSWER = 15.0
"""Seconds in which a scheduler is to answer."""
_LOCAL = {
    "threads_per_worker": 1,
    "memory_limit": 0,  # a slot has its own limits
    "dashboard_address": ":0",  # any port: several runs may go on side by side
    "preload": ["import os; os.setpgid(0, 0)"],  # Ctrl-C is for the client, which ends them
}


def to_scheduler(address: str, setting: Setting) -> DaskExecutor:
    """Return the executor behind the scheduler at `tcp://host:port`; raises CpbenchError without an answer."""
    distributed = _distributed()
    if not re.fullmatch(r"\w+://.+:\d+", address):
        raise CpbenchError(f"'{address}' is no address of a Dask scheduler: expected one like tcp://host:8786")
    try:
        client = distributed.Client(address, timeout=ANSWER, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as cause:
        raise CpbenchError(
            f"no Dask scheduler answers at {address} ({cause}); start one with: dask scheduler"
        ) from None
    return _executor(client, setting)


def start(what: str, setting: Setting, jobs: int | None = None) -> DaskExecutor:
    """Return an executor with its own workers: so many `local` processes, one a core by default.

    Raises CpbenchError, with the reason, when it cannot be started.
    """
    if what != LOCAL:
        raise CpbenchError(f"--cluster {what}: is {LOCAL}, or the address of a Dask scheduler, as tcp://host:8786")
    distributed = _distributed()
    try:
        cluster = distributed.LocalCluster(**_LOCAL, n_workers=jobs or os.cpu_count() or 1)
    except (TypeError, ValueError, OSError, RuntimeError) as cause:
        raise CpbenchError(f"the cluster '{what}' cannot be started: {' '.join(str(cause).split())}") from None
    return _executor(distributed.Client(cluster, set_as_default=False), setting, [cluster.close])


def _executor(client: Any, setting: Setting, ending: Sequence[Callable[[], None]] = ()) -> DaskExecutor:
    from cpbench_lab.cluster.executor import DaskExecutor  # not before Dask is known to be installed

    return DaskExecutor(client, setting, ending)


def _distributed() -> Any:
    """Return Dask's package; raises CpbenchError where it is not installed."""
    try:
        return importlib.import_module("distributed")
    except ImportError as cause:
        raise CpbenchError(f"clusters need Dask ({cause}): pip install 'cpbench[dask]'") from None
