"""What the forkserver has loaded before anybody asks: every process forked from it starts with that.

Solvers' modules and formats; for a run of many processes what `preload_kernels` adds.
"""

from __future__ import annotations

import contextlib
import gc
import os

from cpbench import conversions, formulations, solvers, storage
from cpbench.bench import referee, worker  # noqa: F401  # pyright: ignore[reportUnusedImport] - to have them


def preload() -> None:
    """Import it all; what cannot be imported is left to whoever needs it, who will say why."""
    for registry in (formulations.formulations, storage.formats, conversions.conversions, solvers.solvers):
        with contextlib.suppress(Exception):
            registry.discover()
    os.environ.pop("PYTHONSAFEPATH", None)  # was for this process alone (`launch`)
    gc.collect()
    gc.freeze()  # nobody forked from here walks through all this again


preload()
