"""A first try of a reader that is not ours in a process of its own, which a damaged file may kill."""

from __future__ import annotations

import faulthandler
import os
import resource
import signal
from collections.abc import Callable
from pathlib import Path

from cpbench.errors import FormatError


def require_survivor(path: Path, read: Callable[[], object], reader: str) -> None:
    """Raise FormatError when `read` kills the process that it runs in; what it raises is nobody's concern here.

    Reading twice costs less than sending the arrays over, and the process that asks reads the same bytes.
    """
    pid = os.fork()
    if pid == 0:
        try:
            faulthandler.disable()
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            read()
        finally:
            os._exit(0)  # whatever was raised: no handler of the parent's runs here
    status = os.waitpid(pid, 0)[1]
    if os.WIFSIGNALED(status):
        name = signal.Signals(os.WTERMSIG(status)).name
        raise FormatError(path, "", f"is damaged: {reader} was killed by {name} when it read the file")
