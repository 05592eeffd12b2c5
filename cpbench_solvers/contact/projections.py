"""Projection methods on frictional contact: De Saxcé's fixed point and the extragradient.

One step length ρ for all contacts, in units where every W_cc has mean diagonal 1, adapts itself to the growth of û
(see the kernel). They need nothing but products with W. F(r) = û is not monotone where contacts slide, so that
convergence is a matter of experience.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import numpy as np

from cpbench.foundation.matrices import Vector
from cpbench.solvers.base import Budget, SolverSpec, register
from cpbench_solvers.contact.by_parts import contact_spec
from cpbench_solvers.contact.frozen_law import block_csr
from cpbench_solvers.contact.run import ContactMethod, ContactSolver, MethodOptions
from cpbench_solvers.contact.sweeps import ScaledContacts
from cpbench_solvers.kernels import contact_projection


@dataclass(frozen=True)
class ContactProjectionOptions(MethodOptions):
    """Options of extragradient-fc, de-saxce-fixed-point. `rho` : the first step. `max_iterations` : trials."""

    rho: float = 1.0
    max_iterations: int = 2_000_000
    stall_window: int = 10_000


class _Projection(ContactMethod):
    """The projection methods. `code` : name of the kernel's method."""

    pieces: ClassVar[bool] = True

    def __init__(
        self, contacts: ScaledContacts, options: ContactProjectionOptions, start: Vector, budget: Budget, code: str
    ) -> None:
        problem = contacts.rows.problem
        self._s, self._x = contacts.s, start / contacts.s
        module = contact_projection
        self._iterate, self._method = module.iterate, getattr(module, code)
        self._data = (*block_csr(contacts), contacts.q, problem.mu, problem.dimension)
        self._rho = np.array([options.rho])
        self.counters = {"projections": 0}

    @property
    def r(self) -> Vector:
        return self._s * self._x

    def step(self, many: int, error: float, seconds: float) -> str | None:
        self.counters["projections"] += int(self._iterate(*self._data, self._method, self._x, self._rho, many))
        return None


_spec = partial(contact_spec, method="projection", options=ContactProjectionOptions, by_default=False)


@register
class DeSaxceFixedPoint(ContactSolver):
    """r ← P_K(r − ρû), De Saxcé and Feng's Uzawa iteration on the bipotential, with a ρ that adapts itself."""

    spec: ClassVar[SolverSpec] = _spec(
        name="de-saxce-fixed-point",
        summary="projection of the augmented reaction (Uzawa), self-adapting step",
        citation="De Saxcé and Feng 1998, Math. Comput. Model. 28:225; Acary, Brémond and Huber 2018, LNACM 92:205",
    )
    method: ClassVar[Any] = partial(_Projection, code="FIXED_POINT")


@register
class ExtragradientContact(ContactSolver):
    """y = P_K(r − ρû(r)), r ← P_K(r − ρû(y))."""

    spec: ClassVar[SolverSpec] = _spec(
        name="extragradient-fc",
        summary="extragradient on the De Saxcé-shifted velocity, self-adapting step",
        citation="Korpelevich 1976; Khobotov 1987; Acary, Brémond and Huber 2018, Springer LNACM 92:205",
    )
    method: ClassVar[Any] = partial(_Projection, code="EXTRAGRADIENT")
