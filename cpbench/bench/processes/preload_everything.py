"""What the forkserver loads beside `preload` where many processes will be forked: all modules of formats, conversions
and solvers, those compiled kernels that lie in the cache, and which packages are installed.

It takes a second of which one solve by one solver needs a tenth. A kernel that has yet to be compiled is left to the
solver that needs it.
"""

from __future__ import annotations

import contextlib
import gc

from cpbench import conversions, formulations, kernel_cache, solvers, storage
from cpbench.imports import uncollected
from cpbench.solvers.base import package_version
from cpbench.solvers.native import linear_program


def preload() -> None:
    """Load them; what cannot be loaded is left to whoever needs it, who will say why."""
    with uncollected():
        for registry in (formulations.formulations, storage.formats, conversions.conversions, solvers.solvers):
            with contextlib.suppress(Exception):
                registry.discover()
        for module in kernel_cache.modules("expressions", "conversions", "solvers"):
            with contextlib.suppress(Exception):
                if kernel_cache.is_compiled(module):
                    kernel_cache.load(module)
        linear_program.load()
        package_version("numpy")  # reads what is installed, once for all
    gc.freeze()  # nor by anybody forked from here


preload()
