"""A plugin file of false_alarms.py: a projected Gauss-Seidel method in numpy that takes `CPBENCH_BENCH_SLOWER` (0.2: a
fifth) more of its own time, busily."""

import os
import time

import numpy as np

from cpbench.formulations import LCPPoint
from cpbench.solvers import Claim, Solver, SolverOutput, SolverSpec, register

SWEEPS = 2000


@register
class Slowed(Solver):
    """Sweeps z_i = max(0, z_i - (q_i + M_i z) / M_ii) until no component moves."""

    spec = SolverSpec(name="slowed", node="lcp", summary="PGS that can be made slower", method="sweeps")

    def solve(self, prepared, budget, options, start=None, record=None):
        begun = time.perf_counter()
        M, q = np.asarray(prepared.M), np.asarray(prepared.q)
        z, sweeps, moved = np.zeros(len(q)), 0, np.inf
        diagonal = np.diag(M).copy()
        while sweeps < SWEEPS and moved > budget.tolerance * 1e-3:
            before = z.copy()
            for i in range(len(q)):
                z[i] = max(0.0, z[i] - (q[i] + M[i] @ z) / diagonal[i])
            moved = np.abs(z - before).max()
            sweeps += 1
        ended = time.perf_counter()
        until = ended + float(os.environ.get("CPBENCH_BENCH_SLOWER", "0")) * (ended - begun)
        while time.perf_counter() < until:
            pass
        claim = Claim.SOLVED if sweeps < SWEEPS else Claim.MAX_ITER
        return SolverOutput(claim=claim, point=LCPPoint(z=z), counters={"iterations": sweeps})
