"""The events of a run as lines of a log."""

from __future__ import annotations

import logging
import sys
from pathlib import Path

from cpbench.bench.events import Compiling, Event, Joined, Solving, Spent, Starting
from cpbench.errors import CpbenchError
from cpbench.foundation.plain_text import on_one_line


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


def log_line(event: Event) -> str:
    """Return an event of the run in one line."""
    if isinstance(event, Starting):
        return f"{'start':<12} {event.solver}"
    if isinstance(event, Compiling):
        return f"{'compiling':<12} {event.solver}"
    if isinstance(event, Joined | Spent):
        return on_one_line(f"{'cluster':<12} {event}")
    named = f"{event.pair.address} {event.pair.label}"
    if isinstance(event, Solving):
        return on_one_line(f"{'solve':<12} {named}")
    outcome = event.outcome
    took = f", solve {outcome.solve:.3g} s" if outcome.solve is not None else ""
    error = f", error {outcome.error:.2e}" if outcome.error is not None else ""
    message = f": {' '.join(outcome.message.split())}" if outcome.message else ""
    return on_one_line(f"{outcome.status:<12} {named}{error}{took}{message}")
