"""What the forkserver has loaded before anybody asks: every process forked from it starts with that.

It is what referee and workers have in common; for a run of many solvers what `preload_everything` adds.
"""

from __future__ import annotations

import gc
import os

from cpbench import conversions, formulations, solvers, storage  # noqa: F401  # pyright: ignore[reportUnusedImport]
from cpbench.bench import referee, worker  # noqa: F401  # pyright: ignore[reportUnusedImport] - to have them

os.environ.pop("PYTHONSAFEPATH", None)  # was for this process alone (`launch`)
gc.collect()
gc.freeze()  # nobody forked from here walks through all this again
