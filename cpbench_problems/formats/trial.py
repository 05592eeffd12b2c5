"""First try of a foreign reader in a separate process, which a damaged file may kill."""

from __future__ import annotations

import contextlib
import faulthandler
import math
import os
import resource
import signal
from collections.abc import Callable
from pathlib import Path

from cpbench.errors import FormatError
from cpbench.foundation.child_processes import fork


def require_survivor(path: Path, read: Callable[[], object], reader: str, seconds: float = 0.0) -> None:
    """Raise FormatError when `read` kills the process that it runs in, or needs more than `seconds` of processor time
    (0: no limit); what it raises is ignored.

    Reading twice costs less than sending the arrays over, and the process that asks reads the same bytes.
    """

    def attempt() -> None:
        faulthandler.disable()
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        if seconds:
            resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(seconds), math.ceil(seconds)))
        with contextlib.suppress(BaseException):
            read()

    pid = fork(attempt)
    status = os.waitpid(pid, 0)[1]
    if os.WIFSIGNALED(status):
        name = signal.Signals(os.WTERMSIG(status)).name
        raise FormatError(path, "", f"is damaged: {reader} was killed by {name} when it read the file")
