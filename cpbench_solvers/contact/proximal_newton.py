"""Proximal points on frictional contact by semismooth Newton steps, over-relaxed: for hyperstatic contacts, to the end.

Where W is singular the reactions of a solution are not unique, and near one nothing but the proximal term decides along
the null space: the points P_α(c), solutions for W′ + αI and q′ − αc, drift until a contact changes its state. Only then
does the error fall. A small α drifts fast, but Newton's method fails where too many states change at once, so α is
driven to what it can just do; and c⁺ = c + ω(P_α(c) − c) with ω > 1 drifts faster for nothing (Eckstein and Bertsekas):
from errors of 3e-7 and 3e-6 on hyperstatic piles with 463 and 555 contacts, 1e-8 took 132 and 411 Newton steps with
ω = 1.5, 2804 and 812 with ω = 1.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any, ClassVar

from cpbench.foundation.matrices import Vector
from cpbench.solvers.base import Budget, SolverSpec, register
from cpbench_solvers.contact.by_parts import contact_spec
from cpbench_solvers.contact.run import ContactMethod, ContactSolver, MethodOptions
from cpbench_solvers.contact.semismooth_newton import ContactNewtonOptions, NewtonPhase
from cpbench_solvers.contact.sweeps import AcceleratedSweeps, ScaledContacts

ALPHA = (1e-12, 1e3)
EASIER, HARDER, FORGET = 0.1, 10.0, 0.5
"""α falls and rises by these; an α that was too small is not tried again until its bound has been forgotten."""
EASY = 8
"""Newton steps of a proximal point up to which α was easy, and falls."""
WORSE = 2.0
"""The proximal point may have this times the error of the place where it was sought: errors may rise for a while."""


@dataclass(frozen=True)
class ProximalNewtonOptions(MethodOptions):
    """Options of proximal-newton. `alpha` : the first one, in units where every W_cc has mean diagonal 1.
    `relaxation` : ω. `share` : of ‖Φ‖, to which a proximal point is solved. `newton_steps` : of one, at most.
    `sweeps` : of Gauss–Seidel with acceleration before the first. `max_iterations` : proximal points."""

    alpha: float = 1e-3
    relaxation: float = 1.5
    share: float = 0.1
    newton_steps: int = 30
    sweeps: int = 50
    max_iterations: int = 10_000
    stall_window: int = 500


class ProximalSteps:
    """Proximal points, one after the other from r; `step` may be called for as long as one likes.

    Attributes
    ----------
    r : the last proximal point, or as far as Newton's method came. newton_steps, factorizations : so far.
    """

    def __init__(self, contacts: ScaledContacts, options: ProximalNewtonOptions, r: Vector) -> None:
        self._judged, self._s, self._options = contacts.rows.judged_error, contacts.s, options
        self._newton = NewtonPhase(contacts, ContactNewtonOptions())
        self._whole = self._newton.equation
        self._alpha, self._floor = options.alpha, ALPHA[0]
        self._centre, self._error = r / contacts.s, self._judged(r)
        self.r, self.newton_steps = r, 0

    @property
    def factorizations(self) -> int:
        return self._newton.factorizations

    def step(self, most: float = math.inf, deadline: float = math.inf) -> bool:
        """Take one proximal point, or a larger α where it was not found; False where α cannot rise any more.

        Parameters
        ----------
        most : Newton steps, fewer than the options have. deadline : of `time.monotonic`, none is begun after it.
        """
        if self._alpha > ALPHA[1]:
            return False
        newton, centre, options = self._newton, self._centre, self._options
        most = min(most, options.newton_steps)
        target = options.share * self._whole.at(centre).size
        newton.equation = self._whole.near(centre, self._alpha)
        newton.begin(self._s * centre)
        steps = 0
        while newton.size > target and steps < most and time.monotonic() < deadline and newton.step():
            steps += 1
        self.newton_steps += steps
        self.r = newton.r
        error = self._judged(self.r)
        if not (newton.size <= target and error <= WORSE * self._error):
            self._alpha *= HARDER
            self._floor = self._alpha
            return True
        self._centre = centre + options.relaxation * (self.r / self._s - centre)
        self._error = max(error, self._judged(self._s * self._centre))
        if steps <= EASY:
            self._alpha = max(EASIER * self._alpha, self._floor)
        self._floor = max(FORGET * self._floor, ALPHA[0])
        return True


class _ProximalNewton(ContactMethod):
    def __init__(self, contacts: ScaledContacts, options: ProximalNewtonOptions, start: Vector, budget: Budget) -> None:
        self._contacts, self._options, self._tolerance = contacts, options, budget.tolerance
        self._r = start
        self._steps: ProximalSteps | None = None
        self.counters = {"sweeps": 0, "newton_steps": 0, "factorizations": 0}

    @property
    def r(self) -> Vector:
        return self._r

    def step(self, many: int, error: float, seconds: float) -> str | None:
        if self._steps is None:
            sweeps = AcceleratedSweeps(self._contacts.rows, self._r)
            sweeps.sweep(self._options.sweeps, self._tolerance)
            self.counters["sweeps"] = sweeps.done
            self._r = sweeps.best
            self._steps = ProximalSteps(self._contacts, self._options, self._r)
            return None
        if not self._steps.step(deadline=time.monotonic() + seconds):
            return f"Newton's method fails for α = {ALPHA[1]:.0e}"
        self._r = self._steps.r
        self.counters |= {"newton_steps": self._steps.newton_steps, "factorizations": self._steps.factorizations}
        return None


@register
class ProximalNewton(ContactSolver):
    """A few sweeps, then over-relaxed proximal points by Newton's method."""

    spec: ClassVar[SolverSpec] = contact_spec(
        name="proximal-newton",
        summary="proximal point, inner problems by semismooth Newton, self-adapting α",
        method="proximal point",
        citation="Rockafellar 1976, SIAM J. Control Optim. 14:877; Eckstein and Bertsekas 1992, Math. Program. 55:293; "
        "Acary, Brémond and Huber 2018, Springer LNACM 92:205",
        options=ProximalNewtonOptions,
    )
    method: ClassVar[Any] = _ProximalNewton
