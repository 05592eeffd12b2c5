"""Connects to a Dask scheduler that runs, or starts one: with processes here, or jobs of a batch system."""

from __future__ import annotations

import importlib
import os
import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cpbench.bench.worker_pool import Setting
from cpbench.errors import CpbenchError, FormatError, UnknownName

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
_KEYS = {"cluster", "jobs", "arguments"}


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
    """Return an executor with its own workers: `local` processes, jobs of a batch system with dask-jobqueue's
    configuration, or what a file describes; `jobs` workers (of a batch system: jobs) go before the number in the file.

    Raises CpbenchError, with the reason, when it cannot be started.
    """
    name, number, arguments = (what, None, {}) if what in (LOCAL, *BATCH) else _described(what)
    jobs = jobs or number or (os.cpu_count() or 1 if name == LOCAL else 1)
    distributed = _optional("distributed", "clusters need Dask")
    try:
        if name == LOCAL:
            cluster = distributed.LocalCluster(**{**_LOCAL, "n_workers": jobs, **arguments})
        else:
            cluster = getattr(_optional("dask_jobqueue", "batch systems need dask-jobqueue"), BATCH[name])(**arguments)
            cluster.scale(jobs=jobs)
    except (TypeError, ValueError, OSError, RuntimeError) as cause:
        raise CpbenchError(f"the cluster '{what}' cannot be started: {' '.join(str(cause).split())}") from None
    return _executor(distributed.Client(cluster, set_as_default=False), setting, [cluster.close])


def _described(path: str) -> tuple[str, int | None, Mapping[str, Any]]:
    """Return kind, number of jobs and arguments in a file: TOML of cpbench, or YAML of dask-jobqueue."""
    file = Path(path)
    if not file.is_file():
        raise UnknownName("cluster", path, [LOCAL, *BATCH, "a file"])
    try:
        found = _jobqueue(file) if file.suffix.lower() in (".yaml", ".yml") else tomllib.loads(file.read_text())
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as cause:
        raise FormatError(file, "", f"cannot be read ({cause})") from None
    if unknown := found.keys() - _KEYS:
        raise FormatError(file, min(unknown), f"is not known here; known: {', '.join(sorted(_KEYS))}")
    name, jobs, arguments = found.get("cluster"), found.get("jobs"), found.get("arguments", {})
    if name not in (LOCAL, *BATCH):
        raise FormatError(file, "cluster", f"is {name!r}, expected one of {', '.join((LOCAL, *BATCH))}")
    if jobs is not None and not (isinstance(jobs, int) and jobs > 0):
        raise FormatError(file, "jobs", f"is {jobs!r}, expected a number of jobs")
    if not isinstance(arguments, dict):
        raise FormatError(file, "arguments", "is not a table")
    return name, jobs, arguments


def _jobqueue(file: Path) -> Mapping[str, Any]:
    """Return what a configuration of dask-jobqueue says, as a file of cpbench would."""
    import yaml

    try:
        ((name, arguments),) = yaml.safe_load(file.read_text())["jobqueue"].items()
    except (yaml.YAMLError, KeyError, TypeError, ValueError, AttributeError) as cause:
        why = " ".join(str(cause).split())
        raise FormatError(file, "jobqueue", f"does not hold one table of {', '.join(BATCH)} ({why})") from None
    return {"cluster": name, "arguments": arguments}


def _executor(client: Any, setting: Setting, ending: Sequence[Callable[[], None]] = ()) -> DaskExecutor:
    from cpbench_lab.cluster.executor import DaskExecutor  # not before Dask is known to be installed

    return DaskExecutor(client, setting, ending)


def _optional(package: str, why: str) -> Any:
    """Return a package of the extra `dask`; raises CpbenchError where it is not installed."""
    try:
        return importlib.import_module(package)
    except ImportError as cause:
        raise CpbenchError(f"{why} ({cause}): pip install 'cpbench[dask]'") from None
