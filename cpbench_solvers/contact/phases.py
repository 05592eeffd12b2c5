"""The phases of the automatic choice on contact: sweeps, Newton steps, proximal points, ADMM, interior points.

Accelerated sweeps begin at the best point so far, the other methods (`members`) go their own ways; each goes on until
the work of its turn is done. `policy` says which is next.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from cpbench.formulations.contact import FCPoint
from cpbench.foundation.matrices import EPS, Vector
from cpbench.solvers.base import Budget, Record
from cpbench.solvers.shared.progress import reduced
from cpbench_solvers.contact.by_parts import SURE
from cpbench_solvers.contact.members import (
    PIECE,
    ADMMMember,
    InteriorMember,
    Member,
    NewtonMember,
    PlainMember,
    ProximalMember,
)
from cpbench_solvers.contact.newton_equation import ContactFunction
from cpbench_solvers.contact.parts import MeasuredParts
from cpbench_solvers.contact.policy import SweepProgress, next_method, sweep_work
from cpbench_solvers.contact.sweeps import AcceleratedSweeps, ScaledContacts

GAINED = 0.1
"""A method that took the error below this times what it was has not failed; from so much nearer what failed may not."""
SHORTER = 8
"""Sweeps are so many times fewer again where another method has come much nearer."""


def counters(sweeps: int) -> dict[str, int]:
    """Return the counters after so many sweeps and nothing else."""
    none = dict.fromkeys(("newton_steps", "admm_iterations", "interior_steps", "factorizations"), 0)
    return {"iterations": sweeps, "sweeps": sweeps, **none}


class Phases:
    """Phases after the first sweeps: the best point so far, what the methods cost and how they fared."""

    def __init__(
        self,
        contacts: ScaledContacts,
        budget: Budget,
        start: Vector,
        sweeps: AcceleratedSweeps,
        limit: int,
        deadline: float,
        record: Record | None,
    ) -> None:
        self._contacts, self._seed, self._record, self.tolerance = contacts, budget.seed, record, budget.tolerance
        self._enough = SURE * budget.tolerance
        self._measured = MeasuredParts(contacts.rows, np.zeros(contacts.rows.problem.nc, np.int64), 1)
        self.limit, self.deadline = limit, deadline
        self.best, self.error, self.iterations = sweeps.best.copy(), sweeps.error, sweeps.done
        self.counters = counters(sweeps.done)
        self.messages = [f"{sweeps.done} sweeps to {sweeps.error:.1e}"]
        self._first, self._starts = max(sweeps.done, 1), 0
        self._count = 2 * self._first
        self._sweeps: AcceleratedSweeps | None = sweeps
        self._mark = self.error
        cost = sweep_work(contacts.rows)
        self._progress = SweepProgress(cost, self._count, sweeps.done, sweeps.done, 1.0, self.error)
        self._ahead: str | None = None
        self._members: dict[str, Member] = {
            "interior": InteriorMember(contacts),
            "newton": NewtonMember(contacts, start, ContactFunction.ALART_CURNIER),
            "natural": NewtonMember(contacts, start, ContactFunction.NATURAL_MAP),
            "proximal": ProximalMember(contacts),
            "admm": ADMMMember(contacts),
            "plain": PlainMember(contacts, start),
        }

    @property
    def solved(self) -> bool:
        """Whether the best point is within the tolerance by norms and over the free velocities of the part. Where it is
        only by norms, members go on from where they are, sweeps from there, to an error as much smaller."""
        while self.error <= self.tolerance:
            error = float(self._measured.errors(self.best)[0])
            if error <= self._enough or self.tolerance <= EPS:
                return True
            self.tolerance = reduced(self.tolerance, error, self._enough)
            self._sweeps, self._starts, self._count = None, 0, self._first
            self._progress = SweepProgress(self._progress.cost, self._count, self._progress.spent)
        return False

    def take_turn(self) -> None:
        """Give the method whose turn it is its turn: until the problem is solved, or the work of the turn is done.

        A method that has just come much nearer has the next turn too.
        """
        before = self.error
        due = {name: member.due(self.tolerance) for name, member in self._members.items()}
        name = self._ahead or next_method(self._progress.due(self.tolerance), due)
        if name is None:
            done, unit = self._sweep(), "sweeps"
        else:
            done, unit = self._advance(self._members[name]), self._members[name].unit
        self.messages.append(f"{done} {unit} to {self.error:.1e}")
        gained = self.error <= GAINED * before
        if name is None:
            self._swept(done)
        elif self._sweeps is not None and self.error <= GAINED * self._sweeps.error:
            # sweeps go on from the new point, and accelerated: the reasons to begin otherwise are gone
            self._sweeps, self._starts = None, 0
        if self.error <= GAINED * self._mark:
            self._mark = self.error
            if name is not None:
                self._count = max(self._count // SHORTER, self._first)
            for member in self._members.values():
                # from a point so much nearer, methods that have failed from the old one are to be tried again, cheaply
                # first
                member.turns, member.spent = 0, 0.0
            self._progress = replace(self._progress, spent=0)
        if self._sweeps is None:
            self._progress = SweepProgress(self._progress.cost, self._count, self._progress.spent)
        self._ahead = name if gained and not (name and self._members[name].over) else None

    def _swept(self, done: int) -> None:
        """Note what a turn of sweeps came to; those that gained nothing in it do not go on."""
        sweeps, old = self._sweeps, self._progress
        assert sweeps is not None
        if sweeps.error < old.error:
            spent = old.spent + done
            self._progress = replace(old, next=self._count, spent=spent, sweeps=sweeps.done, error=sweeps.error)
        else:
            self._progress = replace(old, spent=old.spent + done)
            self._sweeps, self._starts = None, self._starts + 1

    @property
    def _over(self) -> bool:
        """Whether the tolerance is reached, or the iterations or the time are spent."""
        spent = self.iterations >= self.limit or time.monotonic() > self.deadline
        return self.error <= self.tolerance or spent

    def _advance(self, member: Member) -> int:
        """Give a method its turn."""
        first, due = member.steps, member.allowed
        # it has not begun, or another method has come much nearer (0131: a slightly better point is not a reason)
        if np.isinf(member.level) or (member.takes_start and self.error <= GAINED * member.level):
            member.begin(self.best)
            member.level = self.error
        before = member.factorizations
        while member.spent < due and not member.over and not self._over:
            steps = member.steps
            member.advance(self.limit - self.iterations, self.deadline, self.tolerance)
            self._made(member.counter, member.steps - steps)
            r = member.r
            error = self._contacts.rows.judged_error(r)
            member.level = min(member.level, error)
            self._seen(r, error)
        member.turns += 1
        self.counters["factorizations"] += member.factorizations - before
        return member.steps - first

    def _sweep(self) -> int:
        if self._sweeps is None:
            self._sweeps = self._started()
        sweeps = self._sweeps
        before, end = sweeps.done, self.tolerance
        until = before + min(self._count, self.limit - self.iterations)
        self._count = 2 * self._count

        earlier = self.counters["sweeps"] - before

        def look() -> None:
            self._made("sweeps", sweeps.done - (self.counters["sweeps"] - earlier))
            self._seen(sweeps.best, sweeps.error)

        while sweeps.done < until and not sweeps.error <= end and time.monotonic() < self.deadline:
            finite = sweeps.sweep(min(until - sweeps.done, PIECE), end, None if self._record is None else look)
            look()
            if not finite:
                break
        return sweeps.done - before

    def _started(self) -> AcceleratedSweeps:
        """Start from the best point; after a failure unaccelerated, after the next from nothing in a drawn order."""
        rows, times = self._contacts.rows, self._starts
        begun = 1.0 if times and times % 2 == 0 else self.error
        self._progress = replace(self._progress, sweeps=0, begun=begun, error=begun)
        if times == 0:
            return AcceleratedSweeps(rows, self.best)
        if times % 2 == 1:
            return AcceleratedSweeps(rows, self.best, rows.plain)
        order = np.random.default_rng(self._seed + times).permutation(rows.problem.nc)
        return AcceleratedSweeps(rows, None, rows.sweeping(order))

    def _made(self, name: str, count: int) -> None:
        self.iterations += count
        self.counters["iterations"] = self.iterations
        self.counters[name] += count

    def _seen(self, r: Vector, error: float) -> None:
        if error < self.error:
            self.error = error
            # `best`, since the record may ask for the point when self.best is another
            self.best = best = r.copy()
            if self._record is not None:
                self._record(self.iterations, error, lambda: FCPoint(best))
