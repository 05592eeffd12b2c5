"""Something long and simple done by a copy of this process while it goes on."""

from __future__ import annotations

import gc
import os
import signal
import sys
import warnings
from collections.abc import Callable, Generator
from contextlib import contextmanager


@contextmanager
def meanwhile(task: Callable[[], None], *, copied: bool) -> Generator[None]:
    """Do `task` and what is within; both are done when it is left, unless that raises.

    Parameters
    ----------
    task : reads what there is and writes files; it takes no lock and starts no thread. copied : whether a copy of this
        process (fork) does it, where the system has such. Whatever the copy did not finish is done here, and raises
        here.
    """
    child = _copy(task) if copied else None
    try:
        yield
    except BaseException:
        if child is not None:
            os.kill(child, signal.SIGTERM)
            os.waitpid(child, 0)
        raise
    if child is None or os.waitpid(child, 0)[1]:
        task()


def _copy(task: Callable[[], None]) -> int | None:
    """The process that does the task; None where there is none."""
    if not hasattr(os, "fork"):
        return None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # other threads may hold locks: the task takes none
            child = os.fork()
    except OSError:
        return None
    if not child:
        try:
            signal.signal(signal.SIGTERM, lambda *_: sys.exit())  # temporary files are removed on the way out
            gc.disable()  # it would write to, and so copy, the memory of every object
            task()
            os._exit(0)
        except BaseException:
            os._exit(1)
    return child
