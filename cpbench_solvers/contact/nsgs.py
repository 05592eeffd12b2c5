"""Nonsmooth Gauss–Seidel on frictional contact: one contact after the other is solved exactly, until all agree."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, TypeAlias

import numpy as np

from cpbench.formulations.contact import FCPoint
from cpbench.solvers.base import Budget, Claim, Record, SolverOutput, SolverSpec, register
from cpbench.solvers.shared.progress import Progress
from cpbench_solvers.contact.by_parts import SolverByParts, contact_spec
from cpbench_solvers.contact.run import MethodOptions
from cpbench_solvers.contact.sweeps import (
    CONTINUE,
    ITERATION,
    LEAST,
    LOG,
    LOGGED,
    ROUNDED,
    SEEN,
    AcceleratedSweeps,
    BlockRows,
    SweepState,
    block_rows,
    conclude,
    work,
)
from cpbench_solvers.kernels import gauss_seidel

BLOCKS_A_CALL = 4_000_000
"""About 20 ms of block products between two looks at the clock."""
AT_FIRST = 50
"""Sweeps in the first call, which is one for small problems."""

Advance: TypeAlias = Callable[..., int]
"""Sweeps in place, called with (tolerance, until, state, measured, log_iteration, log_error, best) of the kernel."""


@dataclass(frozen=True)
class NSGSOptions(MethodOptions):
    """Options of nsgs. `omega` : relaxation of every contact's change. `shuffle` : a new random order for every sweep.
    `max_iterations` : sweeps. `stall_window` : sweeps without gain after which it gives up."""

    omega: float = 1.0
    shuffle: bool = False
    stall_window: int = 10_000


@register
class NSGS(SolverByParts):
    """Block Gauss–Seidel with exact one-contact solves; W may be nonsymmetric, its diagonal blocks singular.

    Converges in practice for most W ⪰ 0, linearly and slowly where contacts are hyperstatic. A contact whose
    W_NN is not positive takes a step of the natural map instead. Ends when the judged error is small, or falls no
    longer; the answer is the best point that was measured.
    """

    spec: ClassVar[SolverSpec] = contact_spec(
        name="nsgs",
        summary="nonsmooth Gauss-Seidel, exact one-contact solves",
        method="splitting",
        citation="Jean and Moreau 1987; Jourdan, Alart and Jean 1998, CMAME 155:31",
        quick=True,
        options=NSGSOptions,
    )

    def prepare(self, problem: Any, budget: Budget, options: NSGSOptions) -> BlockRows:
        return block_rows(problem)

    def solve_part(
        self, prepared: BlockRows, budget: Budget, options: NSGSOptions, start: Any, record: Record | None
    ) -> SolverOutput:
        problem = prepared.problem
        if start is None and record is None and options.omega == 1.0 and not options.shuffle:
            sweeps = AcceleratedSweeps(prepared, way=prepared.plain)
            sweeps.sweep(min(AT_FIRST, budget.iterations or options.max_iterations), budget.tolerance)
            # most small problems are done here, in less time than it takes to prepare for more
            if sweeps.error <= budget.tolerance:
                spent = work(problem, sweeps.done, sweeps.seen)
                return conclude(problem, sweeps.best, sweeps.error, budget, Claim.INACCURATE, ROUNDED, spent)
            at = sweeps.iterate()
            at.state[LOGGED] = 0
            return _swept(prepared, budget, options, at, np.inf, None)
        r = np.zeros(problem.q.size) if start is None else np.array(start.r)
        at = SweepState.initial(r, problem.nc, budget.seed)
        if start is None:
            error = np.inf if (problem.q[:: problem.dimension] < 0.0).any() else 0.0
        else:
            error, at.state[SEEN] = prepared.judged_error(r), problem.nc
        if error < np.inf:
            at.measured[LEAST] = error
        if record is not None:
            record(0, prepared.judged_error(r) if start is None else error, lambda: FCPoint(r))
        return _swept(prepared, budget, options, at, error, record)


def _swept(
    prepared: BlockRows, budget: Budget, options: NSGSOptions, at: SweepState, error: float, record: Record | None
) -> SolverOutput:
    """Make sweeps from where `at` is, whose error was measured or is not known (∞)."""
    problem, r, state = prepared.problem, at.r, at.state
    sweeps = _sweeps(prepared, options, at)
    limit = budget.iterations or options.max_iterations
    call = max(50, BLOCKS_A_CALL // (prepared.column.size + 10 * problem.nc))
    log_iteration, log_error = np.empty(LOG, np.int64), np.empty(LOG)
    progress = Progress(options.stall_window, budget.seconds, "sweeps")
    done = int(state[ITERATION])
    claim, message = Claim.MAX_ITER, ""
    while not error <= budget.tolerance and done < limit:
        until = min(limit, done + call if done >= AT_FIRST else AT_FIRST)
        log = (log_iteration, log_error)
        while True:
            if record is not None:  # with one place left in the log it is back at its next check
                room = int(state[LOGGED]) + 1
                log = (log_iteration[:room], log_error[:room])
            status = sweeps(budget.tolerance, until, state, at.measured, *log, at.best)
            done, logged = int(state[ITERATION]), int(state[LOGGED])
            if record is not None:
                record(done, float(log_error[logged - 1]), lambda: FCPoint(r))
            if record is None or status != CONTINUE or done == until or logged == LOG:
                break
        why = None
        for k in range(logged):
            error = float(log_error[k])
            why = why or progress.trouble(int(log_iteration[k]), error)
        state[LOGGED] = 0
        if why is not None:
            claim, message = Claim.FAILED, why
            break
    if error <= budget.tolerance:
        claim, message = Claim.INACCURATE, ROUNDED
    counters, message = work(problem, done, int(state[SEEN])), message or f"{limit} sweeps"
    return conclude(problem, at.best, float(at.measured[LEAST]), budget, claim, message, counters)


def _sweeps(prepared: BlockRows, options: NSGSOptions, at: SweepState) -> Advance:
    """Return the compiled sweeps from where `at` is."""
    problem = prepared.problem
    sweeps = gauss_seidel.sweeps_3d if problem.dimension == 3 else gauss_seidel.sweeps_2d
    order = prepared.order.copy() if options.shuffle else prepared.order
    iterate = (at.r, at.lam, order)
    relaxed = (options.omega, options.shuffle)
    return lambda tolerance, until, *progress: sweeps(*prepared.law, *iterate, *relaxed, tolerance, until, *progress)
