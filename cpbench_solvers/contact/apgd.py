"""Accelerated projected gradients on frictional contact, De Saxcé's term following the iterates.

Of the second-order cone program min ½rᵀWr + (q + s e_N)ᵀr over the friction cones a few iterations are made (Nesterov's
method with adaptive step and restart, see the kernel), then s = μ‖u_T‖ is set anew and the momentum is kept. With
s = 0 this is the convex relaxation of Mazhar et al.; where s settles, r solves the whole law.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from cpbench.foundation.matrices import Vector
from cpbench.solvers.base import Budget, SolverSpec, register
from cpbench_solvers.contact.by_parts import contact_spec
from cpbench_solvers.contact.frozen_law import block_csr
from cpbench_solvers.contact.run import ContactMethod, ContactSolver, MethodOptions
from cpbench_solvers.contact.sweeps import ScaledContacts
from cpbench_solvers.kernels import frozen_contact

GAIN, LONGER, LONGEST = 0.9, 2, 500
"""De Saxcé's term is held so much longer where the least error has not fallen below GAIN times its old value within
PATIENCE iterations, or that share of all of them."""
PATIENCE, PART = 500, 0.25


@dataclass(frozen=True)
class APGDContactOptions(MethodOptions):
    """Options of apgd-fc. `hold` : iterations that De Saxcé's term is kept at first; more where errors do not fall."""

    hold: int = 3
    max_iterations: int = 500_000
    stall_window: int = 50_000


class AcceleratedGradients(ContactMethod):
    """The iterates of one run."""

    pieces: ClassVar[bool] = True

    def __init__(self, contacts: ScaledContacts, options: APGDContactOptions, start: Vector, budget: Budget) -> None:
        problem = contacts.rows.problem
        self._s, self._q, self._mu, self._d = contacts.s, contacts.q, problem.mu, problem.dimension
        self._hold, self._done, self._since, self._least = options.hold, 0, 0, np.inf
        self._kernel = frozen_contact
        self._matrix = block_csr(contacts)
        self._x, self._Wx = start / contacts.s, np.zeros_like(start)
        self._kernel.product(*self._matrix, self._d, self._x, self._Wx)
        self._z, self._Wz = self._x.copy(), self._Wx.copy()
        self._state, self._radius = np.array([1.0, 1.0]), np.zeros(problem.nc)
        self.counters = {"matrix_vector_products": 1}

    @property
    def r(self) -> Vector:
        return self._s * self._x

    def step(self, many: int, error: float, seconds: float) -> str | None:
        if error <= GAIN * self._least:
            self._least, self._since = error, self._done
        if self._done - self._since > max(PATIENCE, PART * self._done):
            self._hold, self._since = min(LONGER * self._hold, LONGEST), self._done
        self._done += many
        while many > 0:
            count = min(many, self._hold)
            many -= count
            p = self._q.copy()
            slip = (self._Wx + self._q).reshape(-1, self._d)[:, 1:]
            p[:: self._d] += self._mu * np.linalg.norm(slip, axis=1)
            law = (self._kernel.CONE, p, self._mu, self._radius, self._d)
            moved = (self._x, self._Wx, self._z, self._Wz, self._state)
            self.counters["matrix_vector_products"] += int(self._kernel.accelerate(*self._matrix, *law, *moved, count))
        return None


@register
class APGDContact(ContactSolver):
    """Nesterov's method over the friction cones, the load q + μ‖u_T‖e_N set anew every few iterations."""

    spec: ClassVar[SolverSpec] = contact_spec(
        name="apgd-fc",
        summary="accelerated projected gradient descent with restart, De Saxcé's term following",
        method="first order",
        citation="Mazhar, Heyn, Negrut and Tasora 2015, ACM Trans. Graph. 34:32; De Saxcé and Feng 1998; "
        "O'Donoghue and Candès 2015",
        options=APGDContactOptions,
    )
    method: ClassVar[Any] = AcceleratedGradients
