"""What the forkserver loads beside `preload` where many processes will be forked: those compiled kernels that lie in
the cache, and which packages are installed.

It takes a second of which one solve by one solver needs a tenth. A kernel that has yet to be compiled is left to the
solver that needs it.
"""

from __future__ import annotations

import contextlib
import gc
import pkgutil

import cpbench.conversions.kernels
import cpbench.solvers.kernels
from cpbench import kernel_cache
from cpbench.solvers.base import package_version

KERNELS = (cpbench.solvers.kernels, cpbench.conversions.kernels)


def preload() -> None:
    """Load them; what cannot be loaded is left to whoever needs it, who will say why."""
    for package in KERNELS:
        for module in pkgutil.iter_modules(package.__path__):
            name = f"{package.__name__}.{module.name}"
            with contextlib.suppress(Exception):
                if kernel_cache.is_compiled(name):
                    kernel_cache.load(name)
    package_version("numpy")  # reads what is installed, once for all
    gc.collect()
    gc.freeze()


preload()
