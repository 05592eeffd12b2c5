"""Connects to a Dask scheduler that runs, or starts one: with processes here, or jobs of a batch system."""

from __future__ import annotations

import importlib
import os
import re
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from cpbench.bench.worker_pool import Setting
from cpbench.errors import CpbenchError, UnknownName

if TYPE_CHECKING:
    from cpbench_lab.cluster.executor import DaskExecutor

BATCH = {
    "htcondor": "HTCondorCluster",
    "lsf": "LSFCluster",
    "moab": "MoabCluster",
    "oar": "OARCluster",
    "pbs": "PBSCluster",
    "sge": "SGECluster",
    "slurm": "SLURMCluster",
}
"""Batch systems, by the class of dask-jobqueue that speaks to each."""
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
    distributed = _optional("distributed", "clusters need Dask")
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
    """Return an executor with its own workers: so many `local` processes, one a core by default, or so many jobs of a
    batch system with dask-jobqueue's configuration, one by default.

    Raises CpbenchError, with the reason, when it cannot be started.
    """
    if what not in (LOCAL, *BATCH):
        raise UnknownName("cluster", what, [LOCAL, *BATCH])
    jobs = jobs or (os.cpu_count() or 1 if what == LOCAL else 1)
    distributed = _optional("distributed", "clusters need Dask")
    try:
        if what == LOCAL:
            cluster = distributed.LocalCluster(**_LOCAL, n_workers=jobs)
        else:
            cluster = getattr(_optional("dask_jobqueue", "batch systems need dask-jobqueue"), BATCH[what])()
            cluster.scale(jobs=jobs)
    except (TypeError, ValueError, OSError, RuntimeError) as cause:
        raise CpbenchError(f"the cluster '{what}' cannot be started: {' '.join(str(cause).split())}") from None
    return _executor(distributed.Client(cluster, set_as_default=False), setting, [cluster.close])


def _executor(client: Any, setting: Setting, ending: Sequence[Callable[[], None]] = ()) -> DaskExecutor:
    from cpbench_lab.cluster.executor import DaskExecutor  # not before Dask is known to be installed

    return DaskExecutor(client, setting, ending)


def _optional(package: str, why: str) -> Any:
    """Return a package of the extra `dask`; raises CpbenchError where it is not installed."""
    try:
        return importlib.import_module(package)
    except ImportError as cause:
        raise CpbenchError(f"{why} ({cause}): pip install 'cpbench[dask]'") from None
