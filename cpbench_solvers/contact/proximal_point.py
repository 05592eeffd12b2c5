"""Proximal points on frictional contact: W is made definite, the answer is put into the load, again and again.

r⁺ solves the contact problem of W + αR⁻¹ and q − αR⁻¹r, R = diag(ρ_c): a W that is regular however hyperstatic the
contacts are, so that Gauss–Seidel converges fast. A fixed point solves the problem itself. Inner problems are solved to
a share of the present error; α falls where that was easy and rises where the inner solver failed, or where r⁺ is no
better than r.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any, ClassVar

from cpbench.formulations.contact import FCPoint
from cpbench.formulations.fc import FrictionContact
from cpbench.foundation.matrices import Vector, with_diagonal
from cpbench.solvers.base import Budget, Claim, SolverSpec, register
from cpbench_solvers.contact.by_parts import contact_spec
from cpbench_solvers.contact.run import ContactMethod, ContactSolver, MethodOptions
from cpbench_solvers.contact.sweeps import ScaledContacts
from cpbench_solvers.inner import inner_solver

ALPHA = (1e-10, 1e3)
EASIER, HARDER, FORGET = 0.1, 10.0, 0.5
"""α falls and rises by these; an α that was too small is not tried again until its bound has been forgotten."""
WORSE = 2.0
"""r⁺ may have this times the error of r: what the error does from step to step is not monotone."""
FINEST = 1e-14


@dataclass(frozen=True)
class ProximalNSGSOptions(MethodOptions):
    """Options of proximal-nsgs. `alpha` : the first one, in units where every W_cc has mean diagonal 1. `share` : of
    the present error, to which inner problems are solved. `inner` : solver of node fc. `inner_iterations` : of one
    inner problem, at most; half of them count as hard work. `max_iterations` : inner problems."""

    alpha: float = 0.1
    share: float = 0.1
    inner: str = "nsgs"
    inner_iterations: int = 1000
    max_iterations: int = 10_000
    stall_window: int = 200


class _Proximal(ContactMethod):
    def __init__(self, contacts: ScaledContacts, options: ProximalNSGSOptions, start: Vector, budget: Budget) -> None:
        self._problem, self._options, self._budget = contacts.rows.problem, options, budget
        self._judged = contacts.rows.judged_error
        self._inner = inner_solver(options.inner, ("fc",))
        self._weight = 1.0 / contacts.s**2
        self._r, self._alpha, self._floor = start, options.alpha, ALPHA[0]
        self._regularized: tuple[float, FrictionContact] | None = None
        self.counters = {"inner_iterations": 0, "matrix_vector_products": 0}

    @property
    def r(self) -> Vector:
        return self._r

    def step(self, many: int, error: float, seconds: float) -> str | None:
        budget = Budget(
            tolerance=max(self._options.share * max(error, self._budget.tolerance), FINEST),
            seconds=seconds,
            iterations=self._options.inner_iterations,
            seed=self._budget.seed,
        )
        if not math.isfinite(error):
            return "the error is not a number"
        output = self._inner.run(self._near(), budget, start=FCPoint(self._r))
        done = output.counters.get("iterations", 0)
        self.counters["inner_iterations"] += done
        self.counters["matrix_vector_products"] += 1
        point = output.point
        better = False
        if point is not None and point.finite and self._judged(point.r) <= WORSE * error:
            self._r, better = point.r, True
        if output.claim is Claim.SOLVED and better:
            if done <= self._options.inner_iterations // 2:
                self._alpha = max(EASIER * self._alpha, self._floor)
            self._floor = max(FORGET * self._floor, ALPHA[0])
        elif self._alpha >= ALPHA[1]:
            return f"the inner solver fails for α = {self._alpha:.0e}: {output.message or output.claim}"
        else:
            self._alpha *= HARDER
            self._floor = self._alpha
        return None

    def _near(self) -> FrictionContact:
        """Return the regularized problem around r; its matrix is kept as long as α stays."""
        problem = self._problem
        load = problem.q - self._alpha * self._weight * self._r
        if self._regularized is None or self._regularized[0] != self._alpha:
            W = with_diagonal(problem.W, self._alpha * self._weight)
            self._regularized = self._alpha, dataclasses.replace(problem, W=W, q=load)
        return dataclasses.replace(self._regularized[1], q=load)


@register
class ProximalNSGS(ContactSolver):
    """Proximal points, each by Gauss–Seidel."""

    spec: ClassVar[SolverSpec] = contact_spec(
        name="proximal-nsgs",
        summary="proximal point, inner problems by Gauss-Seidel, self-adapting α",
        method="proximal point",
        citation="Rockafellar 1976, SIAM J. Control Optim. 14:877; Acary, Brémond and Huber 2018, LNACM 92:205",
        options=ProximalNSGSOptions,
    )
    method: ClassVar[Any] = _Proximal
