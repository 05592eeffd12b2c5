"""Modules that the forkserver loads beside those of `preload` where many processes will be forked: all formats,
conversions and solvers, the kernels in the cache, and the list of installed packages.

This takes a second, of which one solver needs a tenth. A kernel that is not compiled yet is left to its solver.
"""

from __future__ import annotations

import contextlib
import gc
import importlib

from cpbench import conversions, formulations, solvers, storage
from cpbench.foundation import kernel_cache
from cpbench.foundation.imports import uncollected
from cpbench.solvers.base import package_version


def preload() -> None:
    """Load them; what cannot be loaded is left to the process that needs it, which reports why."""
    with uncollected():
        for registry in (formulations.formulations, storage.formats, conversions.conversions, solvers.solvers):
            with contextlib.suppress(Exception):
                registry.discover()
        for module in kernel_cache.modules():
            with contextlib.suppress(Exception):
                if kernel_cache.is_compiled(module):
                    kernel_cache.load(module)
        importlib.import_module("scipy.optimize")  # of linear programs, in certificates and vertices
        package_version("numpy")  # reads the installed packages once for all processes
    gc.freeze()  # nor by anybody forked from here


preload()
