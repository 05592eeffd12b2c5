"""Nonsmooth Gauss–Seidel on frictional contact: one contact after the other is solved exactly, until all agree."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.contact import FCPoint
from cpbench.formulations.fc import FrictionContact
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register
from cpbench.solvers.native.contact_sweeps import BlockRows, block_rows, conclude, kernel
from cpbench.solvers.native.progress import Progress
from cpbench.solvers.options import fixed, searched

BLOCKS_A_CALL = 4_000_000
"""About 20 ms of block products between two looks at the clock."""
LOG = 256
"""Error evaluations a call can log."""


@dataclass(frozen=True)
class NSGSOptions:
    """`omega` : relaxation of every contact's change. `shuffle` : a new random order for every sweep.
    `max_iterations` : sweeps. `stall_window` : sweeps without gain after which it gives up."""

    omega: float = searched(1.0, low=0.5, high=1.9)
    shuffle: bool = False
    max_iterations: int = fixed(100_000)
    stall_window: int = fixed(10_000)


@register
class NSGS(Solver):
    """Block Gauss–Seidel with exact one-contact solves; W may be nonsymmetric, its diagonal blocks singular.

    Converges in practice for most W ⪰ 0, linearly and slowly where contacts are hyperstatic. A contact whose
    W_NN is not positive takes a step of the natural map instead.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="nsgs",
        node="fc",
        summary="nonsmooth Gauss-Seidel, exact one-contact solves",
        method="splitting",
        citation="Jean and Moreau 1987; Jourdan, Alart and Jean 1998, CMAME 155:31",
        traits=frozenset({Trait.SPARSE, Trait.WARM_START, Trait.HISTORY, Trait.DETERMINISTIC}),
        options=NSGSOptions,
    )

    def setup(self, problem: FrictionContact, budget: Budget, options: NSGSOptions) -> BlockRows:
        return block_rows(problem)

    def warmup(self) -> None:
        for d in (2, 3):
            q = np.zeros(d)
            q[0] = -1.0
            self.run(FrictionContact(W=np.eye(d), q=q, mu=np.array([0.5]), dimension=d))

    def solve(
        self,
        prepared: BlockRows,
        budget: Budget,
        options: NSGSOptions,
        start: Any | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        problem = prepared.problem
        r = np.zeros(problem.q.size) if start is None else np.array(start.r)
        if problem.nc == 0:
            return SolverOutput(claim=Claim.SOLVED, point=FCPoint(r), counters={"iterations": 0})
        gauss_seidel = kernel("gauss_seidel")
        sweeps = gauss_seidel.sweeps_3d if problem.dimension == 3 else gauss_seidel.sweeps_2d
        limit = budget.iterations or options.max_iterations
        call = max(50, BLOCKS_A_CALL // (prepared.column.size + 10 * problem.nc))
        lam, order = np.zeros(problem.nc), np.arange(problem.nc)
        state, pace = np.array([0, 1, 0, budget.seed]), np.full(1, np.inf)
        best = r.copy()
        log_iteration, log_error = np.zeros(LOG, np.int64), np.zeros(LOG)
        matrix = (prepared.start, prepared.column, prepared.blocks, prepared.diagonal)
        law = (problem.q, problem.mu, problem.rho)
        progress = Progress(options.stall_window)
        deadline = time.monotonic() + budget.seconds
        evaluations = 1
        claim, message = Claim.MAX_ITER, f"{limit} sweeps"
        error = prepared.judged(r)
        least = np.full(1, error if np.isfinite(error) else np.inf)
        if record is not None:
            record(0, error, lambda: FCPoint(r))
        while not error <= budget.tolerance and state[0] < limit:
            until = min(limit, int(state[0]) + call)
            while True:
                room = LOG if record is None else int(state[2]) + 1  # with one place left it is back at its next check
                log = (log_iteration[:room], log_error[:room])
                status = sweeps(
                    *matrix,
                    prepared.local,
                    *law,
                    r,
                    lam,
                    order,
                    options.omega,
                    options.shuffle,
                    budget.tolerance,
                    until,
                    state,
                    pace,
                    *log,
                    least,
                    best,
                )
                if record is not None:
                    record(int(state[0]), float(log_error[room - 1]), lambda: FCPoint(r))
                if record is None or status != gauss_seidel.CONTINUE or state[0] == until or room == LOG:
                    break
            why = None
            for k in range(int(state[2])):
                error = float(log_error[k])
                why = why or progress.trouble(int(log_iteration[k]), error)
            evaluations += int(state[2])
            state[2] = 0
            if why is None and time.monotonic() > deadline:
                why = f"out of time after {state[0]} sweeps"
            if why is not None:
                claim, message = Claim.FAILED, why
                break
        if error <= budget.tolerance:
            claim, message = Claim.INACCURATE, "converged up to rounding"
        done = int(state[0])
        counters = {
            "iterations": done,
            "projections": done * problem.nc,
            "matrix_vector_products": evaluations,
        }
        return conclude(problem, best, float(least[0]), budget, claim, message, counters)
