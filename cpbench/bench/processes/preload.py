"""What the forkserver has loaded before anybody asks: every process forked from it starts with that.

Solvers' modules, formats, and those compiled kernels that lie in the cache; a kernel that has yet to be compiled is
left to the solver that needs it.
"""

from __future__ import annotations

import contextlib
import gc
import os
import pkgutil
from pathlib import Path

import cpbench.bench.referee  # pyright: ignore[reportUnusedImport] - to have it
import cpbench.bench.worker  # pyright: ignore[reportUnusedImport]
import cpbench.conversions.kernels
import cpbench.solvers.kernels
from cpbench import conversions, formulations, kernel_cache, solvers, storage
from cpbench.solvers.base import package_version

KERNELS = (cpbench.solvers.kernels, cpbench.conversions.kernels)


def preload() -> None:
    """Import it all; what cannot be imported is left to whoever needs it, who will say why."""
    for registry in (formulations.formulations, storage.formats, conversions.conversions, solvers.solvers):
        with contextlib.suppress(Exception):
            registry.discover()
    for package in KERNELS:
        for module in pkgutil.iter_modules(package.__path__):
            with contextlib.suppress(Exception):
                if compiled(Path(package.__path__[0]) / f"{module.name}.py"):
                    kernel_cache.load(f"{package.__name__}.{module.name}")

    os.environ.pop("PYTHONSAFEPATH", None)  # was for this process alone (`launch`)
    package_version("cpbench")  # reads what is installed, once for all
    gc.collect()
    gc.freeze()  # nobody forked from here walks through all this again


def compiled(source: Path) -> bool:
    """Whether the cache has kernels of this module that are younger than its source."""
    directory = kernel_cache.ensure_cache_dir()
    beside = source.parent / "__pycache__"
    found = [*beside.glob(f"{source.stem}.*.nbi"), *directory.rglob(f"{source.stem}.*.nbi")]
    changed = source.stat().st_mtime
    return any(index.stat().st_mtime >= changed for index in found)


preload()
