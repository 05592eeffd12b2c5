"""The phases of the automatic choice on contact: sweeps, Newton steps, proximal points, ADMM, interior points.

Accelerated sweeps begin at the best point so far, the other methods (`members`) go their own ways; each goes on until
the work of its turn is done. `policy` says which is next.
"""

from __future__ import annotations

import time

import numpy as np

from cpbench.formulations.contact import FCPoint
from cpbench.foundation.matrices import EPS, Vector
from cpbench.solvers.base import Budget, Record
from cpbench.solvers.shared.progress import reduced
from cpbench_solvers.contact import members
from cpbench_solvers.contact.by_parts import SURE
from cpbench_solvers.contact.newton_equation import ContactFunction
from cpbench_solvers.contact.parts import MeasuredParts
from cpbench_solvers.contact.policy import TurnProgress, factor_entries, sweep_work
from cpbench_solvers.contact.sweeps import AcceleratedSweeps, ScaledContacts

LULL = 800
"""Sweeps in which the error may stand still before it falls fast."""
NEARER = 0.1
"""From a point with this share of the error, methods that take a start begin again; what came to it goes on."""


def counters(sweeps: int) -> dict[str, int]:
    """Return the counters after so many sweeps and nothing else."""
    none = {"newton_steps": 0, "admm_iterations": 0, "gradient_steps": 0, "interior_steps": 0, "factorizations": 0}
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
        self._sweeps: AcceleratedSweeps | None = sweeps
        self._cost, self._first, self._starts = sweep_work(contacts.rows), max(sweeps.done, 1), 0
        self._progress = self._afresh()
        self._progress.note(self._cost * self._first, self.error)
        self._progress.rest()
        self._ahead: str | None = None
        self._priced = False
        self._members: dict[str, members.Member] = {
            "interior": members.InteriorMember(contacts),
            "newton": members.NewtonMember(contacts, start, ContactFunction.ALART_CURNIER),
            "natural": members.NewtonMember(contacts, start, ContactFunction.NATURAL_MAP),
            "proximal": members.ProximalMember(contacts),
            "admm": members.ADMMMember(contacts),
            "gradients": members.GradientMember(contacts),
            "plain": members.PlainMember(contacts, start),
        }

    def _afresh(self) -> TurnProgress:
        """Return the progress of sweeps that have not begun."""
        work = self._cost * self._first
        return TurnProgress(work, work, lull=LULL * self._cost)

    @property
    def solved(self) -> bool:
        """Whether the best point is within the tolerance by norms and over the free velocities of the part. Where it is
        only by norms, members go on from where they are, sweeps from there, to an error as much smaller."""
        while self.error <= self.tolerance:
            error = float(self._measured.errors(self.best)[0])
            if error <= self._enough or self.tolerance <= EPS:
                return True
            self.tolerance = reduced(self.tolerance, error, self._enough)
            self._sweeps, self._starts, self._progress = None, 0, self._afresh()
        return False

    def take_turn(self) -> None:
        """Give the method whose turn it is its turn: until the problem is solved, or the work of the turn is done.

        A method that has just come much nearer has the next turn too.
        """
        before, name = self.error, self._ahead or self._next()
        if name is not None and not self._priced:
            entries, self._priced = factor_entries(self._contacts.rows), True
            for member in self._members.values():
                member.price(entries)
            name = self._next()
        if name is None:
            done, unit = self._sweep(), "sweeps"
        else:
            done, unit = self._advance(self._members[name]), self._members[name].unit
        self.messages.append(f"{done} {unit} to {self.error:.1e}")
        self._ahead = name if name and self.error <= NEARER * before and not self._members[name].over else None
        gained = name is not None and self.error < before
        if gained and self._sweeps is not None and self.error <= NEARER * self._sweeps.error:
            # sweeps go on from the new point, and accelerated: the reasons to begin otherwise are gone
            self._sweeps, self._starts, self._progress = None, 0, self._afresh()
        for member in self._members.values():
            if member.takes_start and self.error <= NEARER * member.level < np.inf:
                member.level, member.progress = np.inf, member.afresh()

    def _next(self) -> str | None:
        due = {name: member.progress.due(self.tolerance) for name, member in self._members.items() if not member.over}
        due = {None: self._progress.due(self.tolerance), **due}
        return min(due, key=due.__getitem__)

    @property
    def _over(self) -> bool:
        """Whether the tolerance is reached, or the iterations or the time are spent."""
        spent = self.iterations >= self.limit or time.monotonic() > self.deadline
        return self.error <= self.tolerance or spent

    def _advance(self, member: members.Member) -> int:
        """Give a method its turn."""
        first, progress = member.steps, member.progress
        # it has not begun, or another method has come much nearer (0131: a slightly better point is not a reason)
        if np.isinf(member.level):
            member.begin(self.best)
            member.level = self.error
        before = member.factorizations
        while progress.spent < progress.turn and not member.over and not self._over:
            steps, spent = member.steps, member.spent
            member.advance(self.limit - self.iterations, self.deadline, self.tolerance)
            self._made(member.counter, member.steps - steps)
            r = member.r
            error = self._contacts.rows.judged_error(r)
            member.level = min(member.level, error)
            progress.note(member.spent - spent, error)
            self._seen(r, error)
        progress.rest()
        self.counters["factorizations"] += member.factorizations - before
        return member.steps - first

    def _sweep(self) -> int:
        sweeps, begun = (self._sweeps, self._sweeps.error) if self._sweeps else self._started()
        self._sweeps = sweeps
        before, end, progress = sweeps.done, self.tolerance, self._progress
        count = max(round((progress.turn - progress.spent) / self._cost), 1)
        until = before + min(count, self.limit - self.iterations)
        earlier = self.counters["sweeps"] - before

        def look() -> None:
            self._made("sweeps", sweeps.done - (self.counters["sweeps"] - earlier))
            self._seen(sweeps.best, sweeps.error)

        while sweeps.done < until and not sweeps.error <= end and time.monotonic() < self.deadline:
            finite = sweeps.sweep(min(until - sweeps.done, members.PIECE), end, None if self._record is None else look)
            look()
            if not finite:
                break
        progress.note(self._cost * (sweeps.done - before), sweeps.error)
        progress.rest()
        if not sweeps.error < begun:  # those that gained nothing do not go on
            self._sweeps, self._starts = None, self._starts + 1
        return sweeps.done - before

    def _started(self) -> tuple[AcceleratedSweeps, float]:
        """Start from the best point; after a failure unaccelerated, after the next from nothing in a drawn order.
        Return the sweeps, and the error of where they start."""
        rows, times = self._contacts.rows, self._starts
        if times % 2 == 1 or times == 0:
            return AcceleratedSweeps(rows, self.best, rows.plain if times else None), self.error
        order = np.random.default_rng(self._seed + times).permutation(rows.problem.nc)
        return AcceleratedSweeps(rows, None, rows.sweeping(order)), 1.0

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
