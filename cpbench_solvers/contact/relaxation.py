"""Base of relaxations of frictional contact: compiled sweeps in pieces, watched, and their best point."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, TypeAlias

import numpy as np

from cpbench.formulations.contact import FCPoint
from cpbench.formulations.fc import FrictionContact
from cpbench.foundation.kernel_cache import compiled
from cpbench.foundation.matrices import Vector
from cpbench.solvers.base import Budget, Claim, Record, SolverOutput
from cpbench.solvers.shared.progress import Progress
from cpbench_solvers.contact.by_parts import SolverByParts
from cpbench_solvers.contact.sweeps import (
    CONTINUE,
    ITERATION,
    LEAST,
    LOG,
    LOGGED,
    ROUNDED,
    SEEN,
    BlockRows,
    SweepState,
    block_rows,
    conclude,
    kernel,
    work,
)

BLOCKS_A_CALL = 4_000_000
"""About 20 ms of block products between two looks at the clock."""
AT_FIRST = 50
"""Sweeps in the first call, which is one for small problems."""

Advance: TypeAlias = Callable[..., int]
"""Sweeps in place, called with (tolerance, until, state, measured, log_iteration, log_error, best) of the kernel."""


class Local(StrEnum):
    """Solver of one contact: by its secular equation, Newton on the function of Alart and Curnier, one or many
    projections, or the nearest of all solutions, sliding ones by a polynomial of degree 4."""

    EXACT = "exact"
    NEWTON = "newton"
    PROJECTION = "projection"
    PROJECTIONS = "projections"
    QUARTIC = "quartic"


@dataclass(frozen=True)
class Shape:
    """A relaxation: `simultaneous` for Jacobi's, else contact after contact."""

    local: Local
    omega: float
    shuffle: bool = False
    symmetric: bool = False
    simultaneous: bool = False


def general(prepared: BlockRows, shape: Shape, at: SweepState) -> Advance:
    """Make sweeps of any shape, in place."""
    problem, relax = prepared.problem, compiled(kernel("contact_relaxation").relax)
    iterate = (at.r, at.lam, _lengths(problem), np.arange(problem.nc), np.array([shape.omega, 0.0]))
    method = list(Local).index(shape.local)
    way = (method, shape.simultaneous, shape.shuffle, shape.symmetric, problem.dimension)
    return lambda tolerance, until, *progress: relax(*prepared.law, *iterate, *way, tolerance, until, *progress)


def _lengths(problem: FrictionContact) -> Vector:
    """Return ρ of every contact's projections, shape (nc,): 1/√(‖D‖₁‖D‖∞), at most 1/‖D‖₂; ρ_c = d/tr D is too long
    where the entries of D are very different."""
    size = np.abs(problem.diagonal_blocks)
    bound = np.sqrt(size.sum(axis=1).max(axis=1) * size.sum(axis=2).max(axis=1))
    return np.where(bound > 0, 1.0 / np.where(bound > 0, bound, 1.0), problem.rho)


class Relaxation(SolverByParts):
    """Sweeps until the judged error is small, or falls no longer; its options have `max_iterations`, `stall_window`."""

    @abstractmethod
    def advance(self, prepared: BlockRows, options: Any, at: SweepState) -> Advance:
        """Make the sweeps of one solve, in place."""

    def prepare(self, problem: FrictionContact, budget: Budget, options: Any) -> BlockRows:
        return block_rows(problem)

    def solve_part(
        self, prepared: BlockRows, budget: Budget, options: Any, start: Any, record: Record | None
    ) -> SolverOutput:
        problem = prepared.problem
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
        return self.swept(prepared, budget, options, at, error, record)

    def swept(
        self, prepared: BlockRows, budget: Budget, options: Any, at: SweepState, error: float, record: Record | None
    ) -> SolverOutput:
        """Make sweeps from where `at` is, whose error was measured or is not known (∞)."""
        problem, r, state = prepared.problem, at.r, at.state
        sweeps = self.advance(prepared, options, at)
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
