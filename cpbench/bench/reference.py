"""A solve that is always the same, repeated during a run: what it takes more or less is the machine's doing."""

from __future__ import annotations

import os
import statistics
from typing import Any

import numpy as np

import cpbench.bench.worker as worker_process
from cpbench.bench import handover
from cpbench.bench.processes import wire
from cpbench.bench.processes.launch import context
from cpbench.bench.processes.process import Child, Died, TimedOut
from cpbench.bench.scratch import Scratch
from cpbench.bench.staff import STARTUP, Setting
from cpbench.formulations import LCP

SOLVER = "lemke"
ORDER = 40
REPEATS = 5
PATIENCE = 30.0
"""Seconds to wait for what takes a few milliseconds: longer, and the machine is not fit for measuring."""


class Reference:
    """A worker of its own with one strictly monotone LCP. Use as a context manager."""

    def __init__(self, setting: Setting) -> None:
        self._scratch = Scratch()
        self._path = str(self._scratch.folder / "reference")
        rng = np.random.default_rng(0)
        A = rng.standard_normal((ORDER, ORDER))
        problem = LCP(M=A @ A.T + np.eye(ORDER), q=rng.standard_normal(ORDER), name="reference")
        handover.write(problem, self._path)
        arguments = (SOLVER, 0, False)
        ctx = context(setting.threads)
        self._child = Child(ctx, worker_process.main, arguments, cpus=setting.cpus)
        self._child.receive(STARTUP)

    def __enter__(self) -> Reference:
        return self

    def __exit__(self, *_: object) -> None:
        self._child.kill()
        self._scratch.remove()

    def measure(self) -> tuple[float, float | None]:
        """Median seconds of the solve, and the load of the machine (where the system tells).

        The seconds are NaN when the worker did not answer.
        """
        load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
        budget = {"tolerance": 1e-8, "seconds": PATIENCE}
        message = {"path": self._path, "budget": budget, "options": {}, "repeats": REPEATS, "history": False}
        try:
            self._child.send(wire.pack(message))
            replies: dict[str, dict[str, Any]] = {}
            while "repeats" not in replies:
                reply, _ = wire.unpack(self._child.receive(PATIENCE))
                replies[reply["event"]] = reply
        except (TimedOut, Died):
            return float("nan"), load
        solves = [replies["result"]["solve"], *(solve for _, solve, *_ in replies["repeats"]["times"])]
        return statistics.median(solves), load
