"""Methods that the automatic choice on frictional contact advances in turns, each on its own way, their work counted.

A method goes on from where it was: a new beginning from a slightly better point loses the way that was gone. Only where
another has come much nearer it begins again from there, if it takes a start at all.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from cpbench.foundation.matrices import Vector
from cpbench.solvers.base import Budget
from cpbench.solvers.shared.progress import SHARE
from cpbench_solvers.contact import policy
from cpbench_solvers.contact.admm import ADMMContactOptions, ContactSplitting
from cpbench_solvers.contact.apgd import AcceleratedGradients, APGDContactOptions
from cpbench_solvers.contact.interior_point import ContactInteriorPoint, ContactInteriorPointOptions
from cpbench_solvers.contact.newton_equation import ContactFunction
from cpbench_solvers.contact.proximal_newton import ProximalNewtonOptions, ProximalSteps
from cpbench_solvers.contact.run import ContactMethod
from cpbench_solvers.contact.semismooth_newton import ContactNewtonOptions, NewtonPhase
from cpbench_solvers.contact.sweeps import AcceleratedSweeps, BlockRows, ScaledContacts, Sweeps

PIECE = 2_000
"""Sweeps between two looks at the clock."""
SOONER, LATER = 0.25, 0.5
"""Interior points and proximal points end in a few dozen steps where they succeed, whatever sweeps have gained before:
they are first asked when others have had that share of this work."""
PROBE = 0.25
"""Share of the expected steps after which the error of a first-order method tells how many there will be."""


class Member(ABC):
    """One method, in steps.

    Attributes
    ----------
    unit, counter : of its steps, for messages and among the counters. expected : steps that it is expected to need.
    weight : of these for its first turn. first : share of them in that turn. work : nanoseconds of a step, by the rows
    and the entries of the factors of W. cost : the same of this problem. spent : counted work [ns]. level : the least
    error that it began at or has seen. over : it cannot go on. progress : of its turns. patience : see there. steps,
    factorizations : so far. A subclass keeps its iterates in `_run`.
    """

    unit: ClassVar[str]
    counter: ClassVar[str]
    expected: ClassVar[int]
    takes_start: ClassVar[bool] = False
    weight: ClassVar[float] = 1.0
    first: ClassVar[float] = 1.0
    patience: ClassVar[float] = policy.PATIENCE
    work: ClassVar[Callable[[BlockRows, int], float]]
    _run: Any

    def __init__(self, contacts: ScaledContacts) -> None:
        self._contacts = contacts
        self.spent, self.level, self.over = 0.0, math.inf, False
        self.steps = self.factorizations = 0
        self.price(policy.likely_entries(contacts.rows))

    def price(self, entries: int) -> None:
        """Take what a step costs where the factors of W have so many entries; before it has begun."""
        self.cost, self._entries = type(self).work(self._contacts.rows, entries), entries
        self.progress = self.afresh()

    def afresh(self) -> policy.TurnProgress:
        """Return the progress of one that has not begun."""
        work = self.expected * self.cost
        return policy.TurnProgress(self.weight * work, self.first * work, self.patience)

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

    unit, counter, expected, work = "Newton steps", "newton_steps", 20, policy.step_work

    def __init__(self, contacts: ScaledContacts, start: Vector, function: ContactFunction) -> None:
        super().__init__(contacts)
        self._sweep, self._start, self._function = policy.sweep_work(contacts.rows), start, function
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
    """Proximal points, over-relaxed, by Newton steps. Their error may fall at the very end only."""

    unit, counter, expected, weight = "Newton steps to proximal points", "newton_steps", 60, LATER
    takes_start, patience, work = True, 1.0, policy.step_work

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
    """Sweeps without acceleration: where contacts keep changing their state, extrapolations only lead astray."""

    unit, counter, expected, first, work = "plain sweeps", "sweeps", 1200, PROBE, policy.sweep_work

    def __init__(self, contacts: ScaledContacts, start: Vector) -> None:
        super().__init__(contacts)
        self._start = start

    @property
    def r(self) -> Vector:
        return self._sweeps.best

    def begin(self, r: Vector) -> None:
        self._sweeps = AcceleratedSweeps(self._contacts.rows, self._start, self._contacts.rows.plain)

    def advance(self, most: int, deadline: float, tolerance: float) -> None:
        count = max(math.ceil((self.progress.turn - self.progress.spent) / self.cost), 1)
        self.over = not self._sweeps.sweep(min(count, most, PIECE), tolerance)
        sweeps, self.steps = self._sweeps.done - self.steps, self._sweeps.done
        self.spent += max(sweeps, 1) * self.cost


class MethodMember(Member):
    """A method in iterations, from nothing: from the best point ADMM was caught for 5,000 where it needs 700 (0287)."""

    method: ClassVar[Callable[..., ContactMethod]]
    options: ClassVar[type]

    def begin(self, r: Vector) -> None:
        self._run = type(self).method(self._contacts, self.options(), np.zeros(r.size), Budget())

    def advance(self, most: int, deadline: float, tolerance: float) -> None:
        run, before = self._run, self._run.counters.get("factorizations", 0)
        count = min(1 + self.steps // SHARE, most) if run.pieces else 1
        with np.errstate(all="ignore"):  # diverging iterates overflow
            self.over = run.step(count, self.progress.error, 0.0) is not None
        self.factorizations += run.counters.get("factorizations", 0) - before
        self.steps += count
        self.spent += count * self.cost


class ADMMMember(MethodMember):
    """ADMM, one factorization for every penalty. Where nothing else solves hyperstatic contacts it may, after it has
    stood still for thousands of iterations: its share is never made smaller."""

    unit, counter, expected, first, patience = "ADMM iterations", "admm_iterations", 600, PROBE, 1.0
    method, options, work = ContactSplitting, ADMMContactOptions, policy.iteration_work

    def advance(self, most: int, deadline: float, tolerance: float) -> None:
        before = self.factorizations
        super().advance(most, deadline, tolerance)
        self.spent += (self.factorizations - before) * policy.step_work(self._contacts.rows, self._entries)


class GradientMember(MethodMember):
    """Accelerated projected gradients: where contacts are hyperstatic, and no Newton step is to be trusted. Their error
    may stand still for a thousand iterations before it falls."""

    unit, counter, expected, first, patience = "projected gradients", "gradient_steps", 600, PROBE, 1.0
    method, options, work = AcceleratedGradients, APGDContactOptions, policy.gradient_work


class InteriorMember(MethodMember):
    """Interior points: a way that no first point and no active set decides, of a few dozen steps where it succeeds."""

    unit, counter, expected, weight = "interior-point steps", "interior_steps", 35, SOONER
    method, options, work = ContactInteriorPoint, ContactInteriorPointOptions, policy.point_work
