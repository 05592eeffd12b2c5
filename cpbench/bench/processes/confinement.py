"""Restricts a worker to write to its own temporary folder, caches and devices, where the system can enforce it.

The results file, the problems and cpbench itself are then out of its reach.
"""

from __future__ import annotations

import contextlib
import os
import tempfile

from cpbench.bench.processes import landlock
from cpbench.bench.processes.isolation import Isolation
from cpbench.foundation import kernel_cache

DEVICES = ("/dev", "/proc/self")
CACHES = (("XDG_CACHE_HOME", "~/.cache"), ("JULIA_DEPOT_PATH", "~/.julia"), ("CUDA_CACHE_PATH", "~/.nv"))
"""Caches of guests for what they compile: the variable that names each, and its default."""


def confine(means: Isolation, scratch: str, own: bool) -> None:
    """Give this process a temporary folder below `scratch`, and forbid it, where the system can, to write elsewhere.

    own : whether it runs a solver of cpbench, which compiles into the package's own cache.
    """
    temporary = tempfile.mkdtemp(prefix="worker-", dir=scratch)
    tempfile.tempdir = temporary
    os.environ["TMPDIR"] = temporary
    if means.writes != "landlock":
        return
    caches = [os.environ.get(variable, "").split(os.pathsep)[0] or usual for variable, usual in CACHES]
    compiled = kernel_cache.folders() if own else []
    for folder in (caches[0], *compiled):  # only existing folders can be allowed, and on a new machine there are none
        with contextlib.suppress(OSError):
            os.makedirs(os.path.expanduser(folder), exist_ok=True)
    writable = [os.path.realpath(os.path.expanduser(path)) for path in (temporary, *DEVICES, *caches, *compiled)]
    landlock.confine(writable)
