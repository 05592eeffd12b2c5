"""The events of a run as lines of a log."""

from __future__ import annotations

import logging
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cpbench.bench.planning.plan import Pair
from cpbench.errors import CpbenchError
from cpbench.plain_text import printable


def run_log(verbose: bool, log: Path | None) -> logging.Logger | None:
    """Return the logger of a run's events, to stderr and to a file; None for neither.

    Raises CpbenchError where the file cannot be written.
    """
    if not verbose and log is None:
        return None
    logger = logging.getLogger("cpbench.run")
    logger.setLevel(logging.INFO)
    logger.propagate = False
    try:
        handlers: list[logging.Handler] = []
        if log is not None:
            handlers.append(logging.FileHandler(log, encoding="utf-8", errors="backslashreplace"))
    except OSError as cause:
        raise CpbenchError(f"{log}: cannot be written ({cause.strerror}); name another file with --log") from None
    if verbose:
        handlers.append(logging.StreamHandler(sys.stderr))
    logger.handlers = handlers
    for handler in handlers:
        handler.setFormatter(logging.Formatter("%(asctime)s %(message)s", "%Y-%m-%dT%H:%M:%S"))
    return logger


def log_line(event: str, pair: Pair | None, row: Mapping[str, Any]) -> str:
    """Return an event of the run in one line."""
    if pair is None:
        return f"{event:<12} {row.get('solver', '')}".rstrip()
    named = f"{pair.address} {pair.label}"
    if event != "done":
        return f"{event:<12} {named}"
    took = f", solve {row['solve']:.3g} s" if row.get("solve") is not None else ""
    error = f", error {row['error']:.2e}" if row.get("error") is not None else ""
    message = f": {' '.join(str(row['message']).split())}" if row.get("message") else ""
    return printable(f"{row['status']:<12} {named}{error}{took}{message}")
