"""Frictional contact by Gauss–Seidel, Newton, ADMM and interior points in turns, by what they cost."""

from __future__ import annotations

import math
import time
from collections import Counter
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.contact import FCPoint
from cpbench.formulations.local_contact import FrictionContact
from cpbench.foundation.matrices import Vector
from cpbench.solvers.base import Budget, Claim, Record, SolverOutput, SolverSpec, StackCall, register, solved
from cpbench_solvers.contact.by_parts import SURE, SolverByParts, contact_spec
from cpbench_solvers.contact.parts import ContactPart, at_hand, at_rest
from cpbench_solvers.contact.phases import Phases, counters
from cpbench_solvers.contact.sweeps import (
    APART,
    ROUNDED,
    AcceleratedSweeps,
    BlockRows,
    ScaledContacts,
    conclude,
)
from cpbench_solvers.stacks import CONTACT_SHARES, solve_fc

STEEP = 1e4
"""Friction from which on a contact hardly ever slides: first it is solved with this."""
WORDS = 12
"""Phases that the message tells of, the last ones."""


@dataclass(frozen=True)
class AutoContactOptions:
    """Options of auto-fc. `sweeps` : in the first phase. `max_iterations` : sweeps, Newton steps, steps of interior
    points and iterations of ADMM together."""

    sweeps: int = 50
    max_iterations: int = 400_000


@register
class AutoContact(SolverByParts):
    """Accelerated sweeps first; then, phase by phase, what `policy` says. The message tells the phases and what they
    reached where there were several. Work is counted, not timed: the way to an answer is the same on every machine.
    """

    spec: ClassVar[SolverSpec] = contact_spec(
        name="auto-fc",
        summary="Gauss-Seidel with acceleration, Newton, interior points or ADMM, whichever promises to be done first",
        method="automatic choice",
        options=AutoContactOptions,
    )
    stack_call: ClassVar[StackCall | None] = StackCall(solve_fc, shares=CONTACT_SHARES)

    def setup(self, problem: Any, budget: Budget, options: Any) -> Any:
        return problem if at_rest(problem.q, problem.dimension) else super().setup(problem, budget, options)

    def solve(
        self, prepared: Any, budget: Budget, options: Any, start: Any = None, record: Record | None = None
    ) -> SolverOutput:
        if isinstance(prepared, ContactPart):
            return self._solved(prepared, budget, options, start, record)
        if isinstance(prepared, FrictionContact):
            return at_hand(FCPoint(np.zeros(prepared.q.size)), counters(0), record)
        return super().solve(prepared, budget, options, start, record)

    def at_once(
        self, blocks: BlockRows, budget: Budget, options: AutoContactOptions
    ) -> tuple[Vector, dict[str, int]] | None:
        sweeps = AcceleratedSweeps(blocks)
        sweeps.sweep(min(options.sweeps, budget.iterations or options.max_iterations), budget.tolerance)
        return sweeps.best.copy(), counters(sweeps.done)

    def _solved(
        self, part: ContactPart, budget: Budget, options: Any, start: Any | None, record: Record | None
    ) -> SolverOutput:
        if start is not None or record is not None:
            return super()._solved(part, budget, options, start, record)
        # most small problems are done here, and calls take as long as they do
        sweeps, deadline = AcceleratedSweeps(part.prepared.rows), budget.deadline()
        sweeps.sweep(min(options.sweeps, budget.iterations or options.max_iterations), budget.tolerance)
        if sweeps.error <= budget.tolerance - APART:
            point, enough = FCPoint(sweeps.best), SURE * budget.tolerance
            output, error = solved(point, counters(sweeps.done)), part.error(point.r)
            if error <= enough and not part.hidden(point.r, enough):
                return output
        else:
            output, error = None, math.inf
        problem = part.problem
        if not (problem.mu > STEEP).any():
            if output is not None:
                del sweeps  # others take the same memory, which is faster than new
                return self._within(part, output, error, budget.left(deadline), options, None)
            return super()._solved(part, budget, options, sweeps, None)
        # what sticks under less friction does so under more, and μ times the rounding of a velocity is not a velocity
        less = replace(problem, mu=np.minimum(problem.mu, STEEP))
        near = ContactPart.of(part.rows, less, self.prepare(less, budget, options))
        output = super()._solved(near, replace(budget, seconds=0.5 * budget.seconds), options, None, None)
        if output.point is not None and part.error(output.point.r) <= SURE * budget.tolerance:
            return solved(output.point, output.counters)
        left = budget.left(deadline)
        rest = super()._solved(part, left, options, output.point, None)
        return replace(rest, counters=dict(Counter(output.counters) + Counter(rest.counters)))

    def solve_part(
        self, prepared: ScaledContacts, budget: Budget, options: AutoContactOptions, start: Any, record: Record | None
    ) -> SolverOutput:
        """Solve one part; start : a point, or sweeps that have begun."""
        rows, limit = prepared.rows, budget.iterations or options.max_iterations
        deadline = time.monotonic() + budget.seconds
        begun = isinstance(start, AcceleratedSweeps)
        begin = np.zeros(rows.problem.q.size) if begun or start is None else start.r
        sweeps = start if begun else AcceleratedSweeps(rows, None if start is None else begin)
        if record is not None:
            record(0, rows.judged_error(begin), lambda: FCPoint(begin))
        look = None if record is None else lambda: record(sweeps.done, sweeps.error, lambda: FCPoint(sweeps.best))
        if not begun:
            sweeps.sweep(min(options.sweeps, limit), budget.tolerance, look)
        if sweeps.error <= budget.tolerance:
            spent = counters(sweeps.done)
            return conclude(rows.problem, sweeps.best, sweeps.error, budget, Claim.INACCURATE, ROUNDED, spent)
        run = Phases(prepared, budget, begin, sweeps, limit, deadline, record)
        claim, message = Claim.MAX_ITER, f"{limit} iterations"
        while not run.solved and run.iterations < limit:
            if time.monotonic() > deadline:
                claim, message = Claim.FAILED, f"out of time after {run.iterations} iterations"
                break
            run.take_turn()
        if run.error <= budget.tolerance:
            claim, message = Claim.INACCURATE, ROUNDED
        output = conclude(rows.problem, run.best, run.error, budget, claim, message, run.counters)
        parts = (", ".join(run.messages[-WORDS:]), output.message)
        return replace(output, message="; ".join(part for part in parts if part))
