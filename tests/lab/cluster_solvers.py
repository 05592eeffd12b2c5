"""Solvers that know of the Dask worker they are run under; a plugin file, loaded by `--plugin`."""

import os
import signal
import time
from pathlib import Path

import numpy as np
import psutil

from cpbench.formulations import LCPPoint
from cpbench.solvers import Claim, Solver, SolverOutput, SolverSpec, register

FOLDER = Path(os.environ["CLUSTER_TEST"]) if "CLUSTER_TEST" in os.environ else None


def _answer(problem):
    return SolverOutput(claim=Claim.SOLVED, point=LCPPoint(z=np.linalg.solve(problem.M, -problem.q)))


def _above(what):
    """The process among those above this one that runs `what`, the lowest one."""
    return next((p for p in psutil.Process().parents() if what in " ".join(p.cmdline())), None)


def dask_worker():
    """The parent of the remote worker is the Dask worker, under a nanny or not."""
    remote_worker = _above("cpbench_lab.cluster.remote_worker")
    return remote_worker and remote_worker.parent()


@register
class Gate(Solver):
    """Tells which Dask worker it is under, and answers when the gate is open."""

    spec = SolverSpec(name="gate", node="lcp", summary="waits", method="test")

    def solve(self, prepared, budget, options, start=None, record=None):
        worker = dask_worker()
        if FOLDER and worker and prepared.q.size > 1:
            (FOLDER / f"entered-{worker.pid}").touch()
            while not (FOLDER / "open").exists():
                time.sleep(0.02)
        return _answer(prepared)


@register
class KillsWorker(Solver):
    """Kills the Dask worker it is under, on problems of order 5."""

    spec = SolverSpec(name="kills-worker", node="lcp", summary="kills", method="test")

    def solve(self, prepared, budget, options, start=None, record=None):
        if prepared.q.size == 5:
            dask_worker().kill()
            time.sleep(60)
        return _answer(prepared)


@register
class KillsRemoteWorker(Solver):
    """Kills the process with its slot, on problems of order 5."""

    spec = SolverSpec(name="kills-remote-worker", node="lcp", summary="kills", method="test")

    def solve(self, prepared, budget, options, start=None, record=None):
        if prepared.q.size == 5:
            os.kill(_above("cpbench_lab.cluster.remote_worker").pid, signal.SIGKILL)
            time.sleep(60)
        return _answer(prepared)
