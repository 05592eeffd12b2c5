"""Fixed points on frictional contact: something of the law is frozen, a convex problem is solved, and it is set anew.

Tresca  g = μ r_N: cylinders ℝ₊ × D(g)                      (Haslinger 1983; Siconos' TFP)
ACLM    s = μ‖u_T‖: friction cones with the load q + s e_N     (Acary, Cadoux, Lemaréchal and Malick 2011)

A fixed point solves the problem. The first converges for small μ, in practice for most; for the other, existence
of a fixed point is known under a condition on the data that holds when a velocity strictly inside the cones exists.
"""

from __future__ import annotations

import time
from abc import abstractmethod
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import numpy as np

from cpbench.foundation.matrices import Vector
from cpbench.solvers.base import Budget, SolverSpec, register
from cpbench_solvers.contact.by_parts import contact_spec
from cpbench_solvers.contact.frozen_law import FrozenProblem
from cpbench_solvers.contact.run import ContactMethod, ContactSolver, MethodOptions
from cpbench_solvers.contact.sweeps import ScaledContacts
from cpbench_solvers.kernels import frozen_contact

GAIN, PATIENCE = 0.9, 20
"""The least error must fall below this times its old value in so many steps, else the convex problems are solved FINER,
down to FINEST times what is usual, and then the steps made SHORTER, down to SHORTEST."""
FINER, FINEST, SHORTER, SHORTEST = 0.1, 1e-3, 0.7, 0.02


@dataclass(frozen=True)
class FrozenLawOptions(MethodOptions):
    """Options of aclm-fixed-point, tresca-fixed-point. `share` : a convex problem is
    solved to this times the present error. `momentum` : projected gradients with Nesterov's momentum (symmetric W),
    else projected Gauss–Seidel. `inner_iterations` : at most, of a convex problem. `relaxation` : of what is frozen,
    1 sets it wholly anew; reduced where errors do not fall. `max_iterations` : convex problems."""

    share: float = 0.1
    momentum: bool = True
    relaxation: float = 1.0
    inner_iterations: int = 2_000
    max_iterations: int = 20_000
    stall_window: int = 300


class _FixedPoint(ContactMethod):
    """Freeze, solve, set anew."""

    def __init__(self, contacts: ScaledContacts, options: FrozenLawOptions, start: Vector, budget: Budget) -> None:
        self._s, self._options, self._wanted = contacts.s, options, budget.tolerance
        self._frozen = FrozenProblem(contacts, start / contacts.s, momentum=options.momentum)
        self._zero = np.zeros(contacts.rows.problem.nc)
        self._held, self._omega = self._measured(), options.relaxation
        self._least, self._idle, self._finer = np.inf, 0, 1.0
        self.counters = self._frozen.counters

    @property
    def r(self) -> Vector:
        return self._s * self._frozen.x

    def step(self, many: int, error: float, seconds: float) -> str | None:
        self._idle += 1
        if error <= GAIN * self._least:
            self._least, self._idle = error, 0
        if self._idle > PATIENCE:
            # first the convex problems may have been solved too roughly; where that helps not, the steps are too long
            self._idle = 0
            if self._finer > FINEST:
                self._finer *= FINER
            else:
                self._omega = max(SHORTER * self._omega, SHORTEST)
        self._held = self._held + self._omega * (self._measured() - self._held)
        gap = self._finer * self._options.share * max(error, self._wanted)
        self._solve(gap, time.monotonic() + seconds)
        return None

    def _minimize(self, kind: str, shift: Vector, radius: Vector, gap: float, deadline: float) -> None:
        code = getattr(frozen_contact, kind)
        self._frozen.minimize(code, shift, radius, gap, self._options.inner_iterations, deadline)

    def _measured(self) -> Vector:
        """Return friction thresholds μ r_N."""
        return self._frozen.mu * np.maximum(self._frozen.X[:, 0], 0.0)

    @abstractmethod
    def _solve(self, gap: float, deadline: float) -> None:
        """Solve the convex problem, with `_held` frozen, to that gap."""


class _Tresca(_FixedPoint):
    def _solve(self, gap: float, deadline: float) -> None:
        self._minimize("CYLINDER", self._zero, self._held, gap, deadline)


class _ACLM(_FixedPoint):
    def _measured(self) -> Vector:
        """Return μ‖u_T‖."""
        return self._frozen.mu * np.linalg.norm(self._frozen.u[:, 1:], axis=1)

    def _solve(self, gap: float, deadline: float) -> None:
        self._minimize("CONE", self._held, self._zero, gap, deadline)


_spec = partial(contact_spec, method="fixed point", options=FrozenLawOptions)


@register
class TrescaFixedPoint(ContactSolver):
    """Friction thresholds g = μ r_N frozen: min ½rᵀWr + qᵀr over ℝ₊ × D(g), again and again."""

    spec: ClassVar[SolverSpec] = _spec(
        name="tresca-fixed-point",
        summary="friction thresholds frozen, convex problems on cylinders",
        citation="Haslinger 1983, Math. Methods Appl. Sci. 5:422; Acary, Brémond and Huber 2018, Springer LNACM 92:205",
        by_default=False,
    )
    method: ClassVar[Any] = _Tresca


@register
class ACLMFixedPoint(ContactSolver):
    """De Saxcé's term s = μ‖u_T‖ frozen: min ½rᵀWr + (q + s e_N)ᵀr over the friction cones, again and again."""

    spec: ClassVar[SolverSpec] = _spec(
        name="aclm-fixed-point",
        summary="De Saxcé's term frozen, second-order cone programs",
        citation="Acary, Cadoux, Lemaréchal and Malick 2011, ZAMM 91:155",
    )
    method: ClassVar[Any] = _ACLM
