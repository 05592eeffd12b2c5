"""Methods that the automatic choice on frictional contact advances in turns, each on its own way, their work counted.

A method goes on from where it was: a new beginning from a slightly better point loses the way that was gone. Only where
another has come much nearer it begins again from there, if it takes a start at all.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Any, ClassVar

import numpy as np

from cpbench.foundation.matrices import Vector
from cpbench.solvers.base import Budget
from cpbench_solvers.contact.admm import ADMMContactOptions, ContactSplitting
from cpbench_solvers.contact.interior_point import ContactInteriorPoint, ContactInteriorPointOptions
from cpbench_solvers.contact.newton_equation import ContactFunction
from cpbench_solvers.contact.policy import SweepProgress, iteration_work, point_work, step_work, sweep_work
from cpbench_solvers.contact.proximal_newton import ProximalNewtonOptions, ProximalSteps
from cpbench_solvers.contact.semismooth_newton import ContactNewtonOptions, NewtonPhase
from cpbench_solvers.contact.sweeps import AcceleratedSweeps, ScaledContacts, Sweeps

PIECE = 2_000
"""Sweeps between two looks at the clock."""
SOONER = 0.5
"""Interior points and proximal points end in a few dozen steps where they succeed, whatever sweeps have gained before:
they are asked when others have had half of that work."""


class Member(ABC):
    """One method, in steps.

    Attributes
    ----------
    unit, counter : of its steps, for messages and among the counters. expected : steps that it is expected to need.
    cost : of a step [ns]. spent : counted work since `turns` was 0 [ns]. turns : how often it has had its turn in vain.
    level : the least error that it began at or has seen. over : it cannot go on. steps, factorizations : so far.
    weight : of its work where turns are given. A subclass keeps the iterates in `_run` from `begin` on.
    """

    unit: ClassVar[str]
    counter: ClassVar[str]
    expected: ClassVar[int]
    takes_start: ClassVar[bool] = False
    weight: ClassVar[float] = 1.0
    _run: Any

    def __init__(self, contacts: ScaledContacts, cost: float) -> None:
        self._contacts, self.cost = contacts, cost
        self.spent, self.turns, self.level, self.over = 0.0, 0, math.inf, False
        self.steps = self.factorizations = 0

    @property
    def allowed(self) -> float:
        """Work that it will have had after its next turn [ns]: twice as much every time."""
        return math.inf if self.over else self.expected * self.cost * 2.0**self.turns

    def due(self, tolerance: float) -> float:
        """Return that work, or less where it is expected to be done sooner, times its weight [ns]."""
        return self.weight * self.allowed

    @property
    def r(self) -> Vector:
        """Present reactions, shape (nc·d,)."""
        return self._run.r

    @abstractmethod
    def begin(self, r: Vector) -> None:
        """Begin at r, or wherever it begins."""

    @abstractmethod
    def advance(self, most: int, deadline: float, tolerance: float) -> None:
        """Make a step, or a few that belong together, at most `most`."""


class NewtonMember(Member):
    """Newton's method on one function after a few plain sweeps; twice as many wherever it stands still."""

    unit, counter, expected = "Newton steps", "newton_steps", 20

    def __init__(self, contacts: ScaledContacts, start: Vector, function: ContactFunction) -> None:
        super().__init__(contacts, step_work(contacts.rows.problem.W))
        self._sweep, self._start, self._function = sweep_work(contacts.rows), start, function
        self._count = ContactNewtonOptions().sweeps

    def begin(self, r: Vector) -> None:
        self._run = NewtonPhase(self._contacts, ContactNewtonOptions(), self._function)
        self._sweeps = Sweeps(self._contacts.rows)
        self._from(self._start.copy())

    def advance(self, most: int, deadline: float, tolerance: float) -> None:
        before = self._run.factorizations
        if self._run.step():
            self.steps += 1
        else:
            self._from(self._run.r)
        count = self._run.factorizations - before
        self.factorizations += count
        # one at least: a turn that cost nothing would never end
        self.spent += max(count, 1) * self.cost

    def _from(self, r: Vector) -> None:
        """Begin after sweeps from r, which is changed."""
        self._sweeps.sweep(r, self._count, 0.0)
        self.spent += self._count * self._sweep
        self._count *= 2
        self._run.begin(r)


class ProximalMember(Member):
    """Proximal points, over-relaxed, by Newton steps."""

    unit, counter, expected, weight = "Newton steps to proximal points", "newton_steps", 60, SOONER
    takes_start = True

    def __init__(self, contacts: ScaledContacts) -> None:
        super().__init__(contacts, step_work(contacts.rows.problem.W))

    def begin(self, r: Vector) -> None:
        self._run = ProximalSteps(self._contacts, ProximalNewtonOptions(), r)

    def advance(self, most: int, deadline: float, tolerance: float) -> None:
        points = self._run
        steps, before = points.newton_steps, points.factorizations
        self.over = not points.step(most, deadline)
        self.steps += points.newton_steps - steps
        self.factorizations += points.factorizations - before
        self.spent += max(points.factorizations - before, 1) * self.cost


class PlainMember(Member):
    """Sweeps without acceleration: where contacts keep changing their state, extrapolations only lead astray.

    Their error falls at a steady rate, which says when they are done.
    """

    unit, counter, expected = "plain sweeps", "sweeps", 1200

    def __init__(self, contacts: ScaledContacts, start: Vector) -> None:
        super().__init__(contacts, sweep_work(contacts.rows))
        self._start = start

    @property
    def r(self) -> Vector:
        return self._sweeps.best

    def due(self, tolerance: float) -> float:
        if self.over or self.steps == 0:
            return self.allowed
        spent = round(self.spent / self.cost)
        turn = round(self.allowed / self.cost) - spent
        return SweepProgress(self.cost, turn, spent, self.steps, 1.0, self._sweeps.error).due(tolerance)

    def begin(self, r: Vector) -> None:
        self._sweeps = AcceleratedSweeps(self._contacts.rows, self._start, self._contacts.rows.plain)

    def advance(self, most: int, deadline: float, tolerance: float) -> None:
        count = max(math.ceil((self.allowed - self.spent) / self.cost), 1)
        self.over = not self._sweeps.sweep(min(count, most, PIECE), tolerance)
        sweeps, self.steps = self._sweeps.done - self.steps, self._sweeps.done
        self.spent += max(sweeps, 1) * self.cost


class ADMMMember(Member):
    """ADMM, one factorization for every penalty."""

    unit, counter, expected = "ADMM iterations", "admm_iterations", 600

    def __init__(self, contacts: ScaledContacts) -> None:
        super().__init__(contacts, iteration_work(contacts.rows.problem.W, 0))

    def begin(self, r: Vector) -> None:
        # not at r: from the best point it was caught for 5,000 iterations where it needs 700 from nothing (0287)
        self._run = ContactSplitting(self._contacts, ADMMContactOptions(), np.zeros(r.size))

    def advance(self, most: int, deadline: float, tolerance: float) -> None:
        splitting = self._run
        before = splitting.counters["factorizations"]
        self.over = splitting.step() is not None
        if splitting.counters["factorizations"] > before:
            self.factorizations += 1
            self.cost = iteration_work(self._contacts.rows.problem.W, splitting.entries)
        self.steps += 1
        self.spent += self.cost


class InteriorMember(Member):
    """Interior points: a way that no first point and no active set decides, of a few dozen steps where it succeeds."""

    unit, counter, expected, weight = "interior-point steps", "interior_steps", 35, SOONER

    def __init__(self, contacts: ScaledContacts) -> None:
        super().__init__(contacts, point_work(contacts.rows.problem.W))

    def begin(self, r: Vector) -> None:
        nothing = np.zeros(r.size)
        self._run = ContactInteriorPoint(self._contacts, ContactInteriorPointOptions(), nothing, Budget())

    def advance(self, most: int, deadline: float, tolerance: float) -> None:
        self.over = self._run.step(1, 0.0, 0.0) is not None
        self.steps += 1
        self.factorizations += 1
        self.spent += self.cost
