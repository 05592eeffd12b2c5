"""Semismooth Newton on frictional contact, for the law as two projections (Alart and Curnier) or as K*_μ ∋ û ⟂ r ∈ K_μ
by De Saxcé's change of variable (the natural map).

J = A + BW with A, B block diagonal is singular where contacts are hyperstatic (W singular). W is regularized by τϱ⁻¹
therefore; τ falls with ‖Φ‖ and rises where no step descends.
"""

from __future__ import annotations

import math
import time
from collections import deque
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.contact import FCPoint
from cpbench.foundation.matrices import Vector
from cpbench.solvers.base import Budget, Claim, Record, SolverOutput, SolverSpec, register
from cpbench.solvers.shared.progress import Progress
from cpbench_solvers.contact.by_parts import SolverByParts, contact_spec
from cpbench_solvers.contact.newton_equation import ContactEquation, ContactFunction, NewtonPoint
from cpbench_solvers.contact.sweeps import ScaledContacts, Sweeps, conclude

DESCENT, HALVINGS = 1e-4, 8
SHARE = (1e-2, 1e-8, 1e4)
"""Regularization relative to ‖Φ‖: at first, at least, at most. A full step divides it by EASE, a failure times HARD."""
EASE, HARD = 10.0, 100.0
LARGEST = 1.0
PATIENCE = 12
"""Newton steps without halving ‖Φ‖ after which sweeps are better."""
STALL = 5_000
"""Steps and sweeps without gain after which it gives up."""


@dataclass(frozen=True)
class ContactNewtonOptions:
    """Options of the methods of this module. `sweeps` : of Gauss–Seidel in the beginning, twice as many every time
    that Newton fails; with 0 there are none at all. `memory` : merits that the line search looks back at: a step has
    to fall below the largest. `max_iterations` : steps and sweeps together."""

    sweeps: int = 30
    memory: int = 4
    max_iterations: int = 50_000


class NewtonPhase:
    """Newton steps from a point as long as they gain; the regularization is remembered.

    Attributes
    ----------
    equation : whose zero is sought, from the next `begin` on. factorizations, damped : how many systems were solved,
    and for how many steps τ had to be raised. tau : the last τ.
    """

    def __init__(
        self,
        contacts: ScaledContacts,
        options: ContactNewtonOptions,
        function: ContactFunction = ContactFunction.ALART_CURNIER,
    ) -> None:
        self._s, self._options = contacts.s, options
        self.equation = ContactEquation(contacts, function)
        self._share = SHARE[0]
        self.factorizations = self.damped = 0
        self.tau = 0.0

    def begin(self, r: Vector) -> None:
        self._at = self.equation.at(r / self._s)
        self._recent = deque([self._at.size], maxlen=self._options.memory)
        self._level, self._idle = self._at.size, 0
        self._share = min(self._share, 1.0)

    @property
    def r(self) -> Vector:
        return self._s * self._at.x

    @property
    def size(self) -> float:
        """‖Φ‖ of the present point."""
        return self._at.size

    def step(self) -> bool:
        """Take one step; False when there is none that descends, or when they gain too little."""
        size = self._at.size
        self._idle += 1
        if size < 0.5 * self._level:
            self._level, self._idle = size, 0
        if self._idle > PATIENCE or not math.isfinite(size) or size == 0.0:
            return False
        raised = 0
        while self._share <= SHARE[2]:
            self.factorizations += 1
            self.tau = min(self._share * size, LARGEST)
            d = self.equation.direction(self._at, self.tau)
            if d is not None:
                shortened = self._shortened(d)
                if shortened is not None:
                    length, self._at = shortened
                    self._recent.append(self._at.size)
                    if length >= 1.0:
                        self._share = max(self._share / EASE, SHARE[1])
                    self.damped += raised
                    return True
            self._share *= HARD
            raised = 1
        return False

    def _shortened(self, d: Vector) -> tuple[float, NewtonPoint] | None:
        """Return a step along d, and its length, after which ‖Φ‖ is below the largest of the last ones."""
        for halving in range(HALVINGS + 1):
            t = 0.5**halving
            trial = self.equation.at(self._at.x + t * d)
            if trial.size <= (1.0 - DESCENT * t) * max(self._recent):
                return t, trial
        return None


newton_spec = partial(contact_spec, method="semismooth Newton", options=ContactNewtonOptions)
"""The spec of a `ContactNewton`, with what all of them share."""


class ContactNewton(SolverByParts):
    """Sweeps of Gauss–Seidel to come near, then Newton steps with line search; sweeps again where these fail."""

    function: ClassVar[ContactFunction]

    def solve_part(
        self, prepared: ScaledContacts, budget: Budget, options: ContactNewtonOptions, start: Any, record: Record | None
    ) -> SolverOutput:
        rows = prepared.rows
        deadline = time.monotonic() + budget.seconds
        limit = budget.iterations or options.max_iterations
        best = np.zeros(prepared.q.size) if start is None else np.array(start.r)
        least, steps, count = rows.judged_error(best), 0, options.sweeps
        if record is not None:
            record(0, least, lambda: FCPoint(best))
        claim, message = Claim.MAX_ITER, f"{limit} steps and sweeps"
        # no contact, or solved by its start: nothing is compiled, loaded or factorized
        sweeps = newton = None
        progress = Progress(STALL)
        while not least <= budget.tolerance:
            if sweeps is None or newton is None:
                sweeps, newton = Sweeps(rows), NewtonPhase(prepared, options, self.function)
            r = best.copy()
            room = limit - steps - sweeps.done
            if room <= 0:
                break
            if count > 0:
                error = sweeps.sweep(r, min(count, room), budget.tolerance)
                if record is not None and error < least:
                    record(steps + sweeps.done, error, lambda now=r: FCPoint(now))
                if error < least:
                    best, least = r, error
            newton.begin(r)
            count *= 2
            while not least <= budget.tolerance and steps + sweeps.done < limit and time.monotonic() < deadline:
                if not newton.step():
                    break
                steps += 1
                r = newton.r
                error = rows.judged_error(r)
                if error < least:
                    best, least = r, error
                    if record is not None:
                        record(steps + sweeps.done, error, lambda now=r: FCPoint(now))
            if least <= budget.tolerance:
                break
            why = progress.trouble(steps + sweeps.done, least)
            if time.monotonic() > deadline:
                why = f"out of time after {steps} steps and {sweeps.done} sweeps"
            elif count == 0 and steps < limit:
                why = f"no step descends after {steps} steps"
            if why is not None:
                claim, message = Claim.FAILED, why
                break
        done = 0 if sweeps is None else sweeps.done
        counters = {
            "iterations": steps + done,
            "newton_steps": steps,
            "sweeps": done,
            "factorizations": 0 if newton is None else newton.factorizations,
            "damped_steps": 0 if newton is None else newton.damped,
        }
        output = conclude(rows.problem, best, least, budget, claim, message, counters)
        if newton is None or newton.factorizations == 0:
            return output
        note = f"regularized by τ = {newton.tau:.0e} in the last Newton step"
        return replace(output, message="; ".join(part for part in (output.message, note) if part))


@register
class AlartCurnierNewton(ContactNewton):
    """Sweeps of Gauss–Seidel to come near, then Newton steps with line search; sweeps again where these fail.

    W is regularized by τ, which falls with ‖Φ‖, so that hyperstatic contacts (W singular) have a Newton step. Contacts
    that are open in the present iterate leave the linear system.
    """

    function = ContactFunction.ALART_CURNIER
    spec: ClassVar[SolverSpec] = newton_spec(
        name="newton-alart-curnier",
        summary="semismooth Newton on the Alart-Curnier function, from a start by Gauss-Seidel",
        citation="Alart and Curnier 1991, CMAME 92:353; Acary, Brémond and Huber 2018, Springer LNACM 92:205",
    )


@register
class NaturalMapContact(ContactNewton):
    """The method of newton-alart-curnier, on r − P_K(r − ϱû): û has a kink where a contact begins to slide, the
    derivative there is that without the shift."""

    function = ContactFunction.NATURAL_MAP
    spec: ClassVar[SolverSpec] = newton_spec(
        name="newton-natural-map",
        summary="semismooth Newton on the natural map of the friction cone, from a start by Gauss-Seidel",
        citation="De Saxcé and Feng 1998, Math. Comput. Modelling 28:225; Acary, Brémond and Huber 2018, LNACM 92:205",
        by_default=False,
    )
