"""Semismooth Newton methods on frictional contact, which differ in the equation alone: line searches, phases, solver.

J = A + BW with A, B block diagonal is singular where contacts are hyperstatic (W singular). Then W is regularized by
τϱ⁻¹, or the step is that of Levenberg and Marquardt with ν = τ²; τ falls with ‖Φ‖ and rises where no step descends.
"""

from __future__ import annotations

import math
import time
from collections import deque
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.contact import FCPoint
from cpbench.foundation.kernel_cache import load_all
from cpbench.foundation.matrices import Vector
from cpbench.solvers.base import Budget, Claim, Record, SolverOutput
from cpbench.solvers.shared.progress import Progress
from cpbench_solvers.contact.by_parts import SolverByParts, contact_spec
from cpbench_solvers.contact.newton_equation import ContactEquation, ContactFunction, NewtonPoint
from cpbench_solvers.contact.parts import single_contacts
from cpbench_solvers.contact.sweeps import ScaledContacts, Sweeps, conclude

DESCENT, HALVINGS = 1e-4, 8
FLATTEST, STEEPEST, TRIALS = 0.1, 0.9, 12
"""Shares of the slope between which Goldstein and Price want the mean one of a step, and how many lengths are tried."""
SHARE = (1e-2, 1e-8, 1e4)
"""Regularization relative to ‖Φ‖: at first, at least, at most. A full step divides it by EASE, a failure times HARD."""
EASE, HARD = 10.0, 100.0
LARGEST = 1.0
PATIENCE = 12
"""Newton steps without halving ‖Φ‖ after which sweeps are better."""
STALL = 5_000
"""Steps and sweeps without gain after which it gives up."""


class LineSearch(StrEnum):
    """Demand on a step, for ‖Φ‖: fall (Armijo), fall below the largest of the last ones (Grippo, Lampariello and
    Lucidi), or fall neither too little nor by a step too short (Goldstein and Price)."""

    NON_MONOTONE = "non-monotone"
    ARMIJO = "armijo"
    GOLDSTEIN_PRICE = "goldstein-price"


class Regularization(StrEnum):
    """Remedy for a singular W: τϱ⁻¹ added to it, or least squares with a damping."""

    PROXIMAL = "proximal"
    LEAST_SQUARES = "least-squares"


@dataclass(frozen=True)
class ContactNewtonOptions:
    """Options of the methods of this module. `sweeps` : of Gauss–Seidel in the beginning, twice as many every time
    that Newton fails; with 0 there are none at all. `search`, `memory` : of the line search, and how many merits the
    non-monotone one looks back at. `max_iterations` : steps and sweeps together."""

    sweeps: int = 30
    search: LineSearch = LineSearch.NON_MONOTONE
    memory: int = 4
    regularization: Regularization = Regularization.PROXIMAL
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
        memory = self._options.memory if self._options.search is LineSearch.NON_MONOTONE else 1
        self._recent = deque([self._at.size], maxlen=memory)
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
        least_squares = self._options.regularization is Regularization.LEAST_SQUARES
        while self._share <= SHARE[2]:
            self.factorizations += 1
            self.tau = min(self._share * size, LARGEST)
            d = self.equation.direction(self._at, self.tau, damped=least_squares)
            if d is not None:
                exact = self._options.search is LineSearch.GOLDSTEIN_PRICE
                found = self._goldstein_price(d) if exact else self._armijo(d)
                if found is not None:
                    length, self._at = found
                    self._recent.append(self._at.size)
                    if length >= 1.0:
                        self._share = max(self._share / EASE, SHARE[1])
                    self.damped += raised
                    return True
            self._share *= HARD
            raised = 1
        return False

    def _armijo(self, d: Vector) -> tuple[float, NewtonPoint] | None:
        for halving in range(HALVINGS + 1):
            t = 0.5**halving
            trial = self.equation.at(self._at.x + t * d)
            if trial.size <= (1.0 - DESCENT * t) * max(self._recent):
                return t, trial
        return None

    def _goldstein_price(self, d: Vector) -> tuple[float, NewtonPoint] | None:
        merit, slope = 0.5 * self._at.size**2, self.equation.slope(self._at, d)
        if not slope < 0.0:
            return None
        low, high, t = 0.0, math.inf, 1.0
        enough: tuple[float, NewtonPoint] | None = None
        for _ in range(TRIALS):
            trial = self.equation.at(self._at.x + t * d)
            change = 0.5 * trial.size**2 - merit
            if not change <= FLATTEST * t * slope:
                high = t
            else:
                enough = t, trial
                if change >= STEEPEST * t * slope:
                    break
                low = t
            t = 0.5 * (low + high) if math.isfinite(high) else 2.0 * t
        return enough


newton_spec = partial(contact_spec, method="semismooth Newton", options=ContactNewtonOptions)
"""The spec of a `ContactNewton`, with what all of them share."""


class ContactNewton(SolverByParts):
    """Sweeps of Gauss–Seidel to come near, then Newton steps with line search; sweeps again where these fail."""

    function: ClassVar[ContactFunction]

    def warmup(self) -> None:
        load_all("cpbench_solvers.kernels", ("gauss_seidel", "block_layout", "contact_newton"))
        for problem in single_contacts(self.spec.node):
            self.run(problem, options=ContactNewtonOptions(sweeps=0))
        super().warmup()

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
