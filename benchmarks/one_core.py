"""One thread on one core for both sides of a race.

They take turns, and each in a process of its own: on a shared machine two cores differ by half for minutes, and a race
between processes that stay on theirs measures the cores. Children inherit both settings.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator

VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
_ALL = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else set[int]()


def hold() -> None:
    """Before any library of linear algebra is loaded, and before the other side is started."""
    os.environ.update(dict.fromkeys(VARIABLES, "1"))
    if _ALL:
        os.sched_setaffinity(0, {max(_ALL)})


@contextlib.contextmanager
def let_go() -> Iterator[None]:
    """All cores for threads that are started within."""
    held = os.sched_getaffinity(0) if _ALL else _ALL
    if _ALL:
        os.sched_setaffinity(0, _ALL)
    try:
        yield
    finally:
        if _ALL:
            os.sched_setaffinity(0, held)
