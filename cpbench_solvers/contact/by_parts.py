"""Solves the connected parts of a local contact problem one after the other.

A pile is many clusters of bodies. A norm over all of them says little of the small ones, and sweeps over all of them
are made until the slowest has converged. Each part ends by its own error, so that the work is that of the parts.

A method ends by norms that it has at hand. An answer that passes these is measured once by the free velocities of
its part (the kernel `part_error`); where that is more than the tolerance, the method goes on, to an error as much
smaller.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from cpbench.formulations.contact import FCPoint
from cpbench.foundation.matrices import EPS, Vector
from cpbench.solvers.base import Budget, Claim, Record, SolverOutput, SolverSpec, solved
from cpbench.solvers.shared.progress import reduced
from cpbench_solvers.contact.parts import (
    Contact,
    ContactPart,
    ContactParts,
    Index,
    MeasuredParts,
    PartSolver,
    PartsProgress,
    claimed,
    connected_parts,
    labels_of,
    part_of,
    rows_of,
    rows_of_blocks,
)
from cpbench_solvers.contact.sweeps import BlockRows, scaled_contacts
from cpbench_solvers.traits import ITERATIVE

SURE = 0.995
"""Share of the tolerance that is claimed: the verdict has its own rounding, to a thousandth."""

contact_spec = partial(SolverSpec, node="fc", traits=ITERATIVE)
"""The spec of a solver of local contact problems, with what most of them share."""


class SolverByParts(PartSolver):
    """A solver of local contact problems, with or without rolling friction.

    A subclass says how it solves one part, and what it prepares for that where it is not `ScaledContacts`.
    """

    def prepare(self, problem: Any, budget: Budget, options: Any) -> Any:
        return scaled_contacts(problem)

    def at_once(self, blocks: BlockRows, budget: Budget, options: Any) -> tuple[Vector, dict[str, int]] | None:
        """Return reactions of the whole problem by a cheap method, with counters; None where there is none.

        Parts in which they are good enough are not looked at by themselves.
        """
        return None

    def setup(self, problem: Contact, budget: Budget, options: Any) -> ContactPart | ContactParts:
        parts = connected_parts(problem)
        if len(parts) == 1:
            return ContactPart.of(slice(None), problem, self.prepare(problem, budget, options))
        label = labels_of(parts, problem.nc)
        position = np.empty(problem.nc, np.int64)

        def make(contacts: Index) -> ContactPart:
            rows = rows_of(contacts, problem.dimension)
            position[contacts] = np.arange(contacts.size)
            part = part_of(problem, contacts, rows, position)
            return ContactPart.of(rows, part, self.prepare(part, budget, options))

        whole = MeasuredParts(rows_of_blocks(problem), label, len(parts))
        return ContactParts(whole, tuple(parts), make)

    def solve(
        self,
        prepared: ContactPart | ContactParts,
        budget: Budget,
        options: Any,
        start: Any = None,
        record: Record | None = None,
    ) -> SolverOutput:
        if isinstance(prepared, ContactPart):
            return self._solved(prepared, budget, options, start, record)
        r = np.zeros(prepared.whole.blocks.problem.q.size) if start is None else np.array(start.r)
        deadline, counters, failed = budget.deadline(), Counter[str](), []
        left_over: Any = range(prepared.whole.count)
        warm = start is not None
        if start is None and record is None:
            begun = self.at_once(prepared.whole.blocks, budget, options)
            if begun is not None:
                r, spent = begun
                counters.update(spent)
                left_over, warm = np.flatnonzero(~(prepared.whole.errors(r) <= SURE * budget.tolerance)), True
        progress = None if record is None else _progress(record, prepared, r, budget)
        for k in left_over:
            part = prepared[k]
            begin = FCPoint(r[part.rows]) if warm else None
            look = None if progress is None else progress.of_part(k, counters["iterations"])
            output = self._solved(part, budget.left(deadline), options, begin, look)
            counters.update(output.counters)
            if output.point is not None:
                r[part.rows] = output.point.r
            if output.claim is not Claim.SOLVED:
                failed.append((prepared.contacts[k].size, output))
        return claimed(FCPoint(r), dict(counters), failed, prepared.whole.count)

    def _solved(
        self, part: ContactPart, budget: Budget, options: Any, start: Any | None, record: Record | None
    ) -> SolverOutput:
        """Solve one part; go on where its error is not small enough over the free velocities of the part."""
        if not part.problem.nc:
            return solved(FCPoint(np.zeros(0)), {"iterations": 0})
        deadline = budget.deadline()
        output = self.solve_part(part.prepared, budget, options, start, record)
        if output.point is None or output.claim is not Claim.SOLVED:
            return output
        left = budget.left(deadline)
        return self._within(part, output, part.error(output.point.r), left, options, record)

    def _within(
        self, part: ContactPart, output: SolverOutput, error: float, budget: Budget, options: Any, record: Record | None
    ) -> SolverOutput:
        """Go on from an answer to the part that passes the norms, and has that error."""
        deadline, asked, enough = budget.deadline(), budget.tolerance, SURE * budget.tolerance
        while not error <= enough and asked > EPS:
            asked = reduced(asked, error, enough)
            left = replace(budget.left(deadline), tolerance=asked)
            further = self.solve_part(part.prepared, left, options, output.point, _after(record, output.counters))
            counters = Counter(output.counters)
            counters.update(further.counters)
            now = error if further.point is None else part.error(further.point.r)
            better = further if now < error else output
            output = replace(better, counters=dict(counters), message=further.message)
            error = min(now, error)
            if further.claim is not Claim.SOLVED:
                break
        point: Any = output.point
        what = f"error {error:.1e} over the free velocities of the part"
        if error <= enough:
            if not part.hidden(point.r, enough):
                return output if output.claim is Claim.SOLVED else solved(point, output.counters)
            what = "rounding hides the error"
        message = f"{output.message}; {what}" if output.message else what
        return SolverOutput(claim=Claim.INACCURATE, point=point, counters=output.counters, message=message)


def _after(record: Record | None, counters: Any) -> Record | None:
    """Return the record of a run that goes on after the iterations counted."""
    if record is None:
        return None
    done = counters["iterations"]

    def further(iteration: int, error: float, answer: Any) -> None:
        if iteration:  # the start is the answer that the run before has recorded
            record(done + iteration, error, answer)

    return further


def _progress(record: Record, parts: ContactParts, r: Vector, budget: Budget) -> PartsProgress:
    every = [parts[k] for k in range(parts.whole.count)]
    errors = [part.problem.residuals(FCPoint(r[part.rows]), budget.tolerance).error for part in every]
    now = r.copy()

    def put(k: int, point: Any) -> FCPoint:
        now[every[k].rows] = point.r
        return FCPoint(now)  # a copy

    return PartsProgress(record, errors, put)
