"""Methods that go their own way beside the phases of the automatic choice, so that its regret is bounded.

A policy that expects may be wrong, and for ever. Each of these methods begins where its solver would, never starts
again from what others have found (a new beginning from a slightly better point loses the way that was gone), and has a
fixed share of the counted work. Where it alone needs the work w, the automatic choice ends after about w/share,
whatever the policy thinks; where the policy alone needs w, after (1 + 2·share)w. Portfolios of this kind: Huberman,
Lukose and Hogg 1997, Science 275:51; Gomes and Selman 2001, Artif. Intell. 126:43.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from cpbench.matrices import Vector
from cpbench.solvers.native.contact.newton_equation import ContactFunction
from cpbench.solvers.native.contact.policy import STEPS, step_work, sweep_work
from cpbench.solvers.native.contact.proximal_newton import ProximalNewtonOptions, ProximalSteps
from cpbench.solvers.native.contact.semismooth_newton import ContactNewtonOptions, NewtonPhase
from cpbench.solvers.native.contact.sweeps import ScaledContacts, Sweeps

SHARE = 0.3
"""Of the policy's counted work, each."""


class Hedge(ABC):
    """Second method that is advanced in slices beside the first, in case that one fails.

    Attributes
    ----------
    spent : counted work so far [ns]. over : it cannot go on. steps : Newton steps so far. r : (n,), present reactions.
    """

    unit: ClassVar[str]
    spent, over, steps = 0.0, False, 0

    def __init__(self, contacts: ScaledContacts) -> None:
        self._cost = step_work(contacts.rows.problem.W)

    def due(self, work: float) -> bool:
        """Return whether it is its turn after the policy's `work` [ns]: at first as soon as that equals a slice."""
        slice_ = STEPS * self._cost
        return not self.over and (self.spent + slice_ <= SHARE * work or (self.spent == 0.0 and slice_ <= work))

    @property
    @abstractmethod
    def r(self) -> Vector: ...

    @abstractmethod
    def advance(self, deadline: float) -> None:
        """Make a step, or a few that belong together."""


class NewtonHedge(Hedge):
    """Newton's method on the natural map after a few plain sweeps; twice as many wherever it stands still."""

    unit = "Newton steps"

    def __init__(self, contacts: ScaledContacts, start: Vector) -> None:
        super().__init__(contacts)
        self._sweep = sweep_work(contacts.rows)
        self._newton = NewtonPhase(contacts, ContactNewtonOptions(), ContactFunction.NATURAL_MAP)
        self._sweeps = Sweeps(contacts.rows)
        self._count = ContactNewtonOptions().sweeps
        self._begin(start.copy())

    @property
    def r(self) -> Vector:
        return self._newton.r

    def advance(self, deadline: float) -> None:
        before = self._newton.factorizations
        if self._newton.step():
            self.steps += 1
        else:
            self._begin(self._newton.r)
        self.spent += max(self._newton.factorizations - before, 1) * self._cost

    def _begin(self, r: Vector) -> None:
        """Begin after sweeps from r, which is changed."""
        self._sweeps.sweep(r, self._count, 0.0)
        self.spent += self._count * self._sweep
        self._count *= 2
        self._newton.begin(r)


class ProximalHedge(Hedge):
    """Proximal points, over-relaxed, by Newton steps."""

    unit = "proximal Newton steps"

    def __init__(self, contacts: ScaledContacts, swept: Vector) -> None:
        super().__init__(contacts)
        self._points = ProximalSteps(contacts, ProximalNewtonOptions(), swept)

    @property
    def r(self) -> Vector:
        return self._points.r

    def advance(self, deadline: float) -> None:
        before = self._points.newton_steps
        self.over = not self._points.step(deadline=deadline)
        self.steps = self._points.newton_steps
        self.spent += max(self.steps - before, 1) * self._cost
