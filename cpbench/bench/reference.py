"""A solve that is always the same, repeated during a run: changes of its time are the machine's.

It is LAPACK's, not one of cpbench: a faster solver must not look like a faster machine.
"""

from __future__ import annotations

import os
import statistics
import time

import numpy as np

from cpbench.bench.processes.channel import Channel
from cpbench.bench.processes.launch import context
from cpbench.bench.processes.server import NoAnswer, ServerProcess, serve
from cpbench.bench.time_limits import START
from cpbench.bench.worker_pool import Setting

ORDER = 200
"""Order of the dense system: about a millisecond, and a third of a megabyte, which stays in the cache."""
REPEATS = 5
NAME = f"dense system of order {ORDER}, numpy {np.__version__}"
"""System and library: the times of runs with different references do not compare."""
PATIENCE = 30.0
"""Seconds to wait for a solve of milliseconds; a slower machine is not fit for measurements."""


class Reference(ServerProcess):
    """A process of its own with one linear system."""

    def __init__(self, setting: Setting) -> None:
        super().__init__(context(setting.threads), main, cpus=setting.cpus)

    def measure(self) -> tuple[float, float | None]:
        """Return the median seconds of the solve, and the load of the machine where the system tells it.

        The seconds are NaN when the process did not answer; the next solve gets a new process.
        """
        load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
        try:
            reply, _ = self.ask(PATIENCE if self.running else START.floor, {})
        except NoAnswer:
            return float("nan"), load
        return statistics.median(reply["seconds"]), load


def main(channel: Channel) -> None:
    """Solve at every request, until the runner closes the channel."""
    rng = np.random.default_rng(0)
    A, b = rng.standard_normal((ORDER, ORDER)), rng.standard_normal(ORDER)
    np.linalg.solve(A, b)  # LAPACK is loaded
    serve(channel, lambda *_: ({"seconds": [_timed(A, b) for _ in range(REPEATS)]}, {}))


def _timed(A: np.ndarray, b: np.ndarray) -> float:
    started = time.perf_counter()
    np.linalg.solve(A, b)
    return time.perf_counter() - started
