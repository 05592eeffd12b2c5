"""ADMM on contact laws of any kind, whatever solves the linear system: W itself, or the dynamics without condensation.

In units where every W_cc has mean diagonal 1 (x = r/s, s² the effective masses, moments in lengths of their contact)

    (W + ρI) x = −q − σ(u) + ρ(z − ξ),   z = P_K(αx + (1 − α)z + ξ),   ξ ← ξ + αx + (1 − α)z − z⁺,

with σ(u) = û − u, De Saxcé's term, of the velocities −ρξ of the iterate before. At rest x = z ∈ K and −ρξ = û ∈ K*.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cpbench.errors import ProblemError
from cpbench.foundation.cones import Law
from cpbench.foundation.matrices import Dense, Vector, norm
from cpbench.solvers.base import Budget
from cpbench_solvers.cone.penalty import TINY, StepPenalty
from cpbench_solvers.contact.run import ContactMethod, MethodOptions

RHO, LONGER = (1e-9, 1e6), 1.5
"""Bounds of ρ, and by how much longer each new ρ must stay than the one before."""


@dataclass(frozen=True)
class ConicADMMOptions(MethodOptions):
    """Options of admm-gfc, admm-rfc, admm-grfc. `rho` : the first penalty, in units where every W_cc has mean
    diagonal 1. `alpha` : over-relaxation. `balance` : adapt ρ to the residuals."""

    rho: float = 0.1
    alpha: float = 1.0
    balance: bool = True
    max_iterations: int = 20_000


class Delassus(ABC):
    """W and q in the units above, known by what they do.

    Attributes
    ----------
    law : in these units. s : (nc·d,), x times s are reactions. dimension : d.
    """

    law: Law
    s: Vector
    dimension: int

    @abstractmethod
    def factorize(self, rho: float) -> None:
        """Make ready for `resolvent` with this ρ."""

    @abstractmethod
    def resolvent(self, right: Vector) -> Vector:
        """Return x of (W + ρI) x = right − q. Raises ProblemError where there is none."""

    @abstractmethod
    def velocity(self, x: Vector) -> Vector:
        """Return Wx + q."""


class ConicADMM(ContactMethod):
    """The iterates. counters : factorizations, and projections on all cones."""

    pieces: ClassVar[bool] = True

    def __init__(self, contacts: Delassus, options: ConicADMMOptions, start: Vector, budget: Budget) -> None:
        self._contacts, self._options = contacts, options
        self._shape = (-1, contacts.dimension)
        self._penalty, self._factorized = StepPenalty(options.rho, *RHO, LONGER, options.balance), False
        self._z = start / contacts.s
        self._xi, self._shift = np.zeros_like(start), np.zeros_like(start)
        if start.any():
            hat = contacts.law.shift(self._rows(contacts.velocity(self._z)))
            dual = hat + contacts.law.project(-hat)  # on K*, Moreau
            self._xi = -dual.ravel() / options.rho
            self._shift = self._term(dual)
        self._size = norm(contacts.velocity(np.zeros_like(start)))
        self.counters = {"factorizations": 0, "projections": 0}

    @property
    def r(self) -> Vector:
        return self._contacts.s * self._z

    def step(self, many: int, error: float, seconds: float) -> str | None:
        return next((why for _ in range(many) if (why := self._iteration()) is not None), None)

    def _iteration(self) -> str | None:
        contacts, alpha, rho = self._contacts, self._options.alpha, self._penalty.rho
        if not self._factorized:
            contacts.factorize(rho)
            self._factorized = True
            self.counters["factorizations"] += 1
        try:
            x = contacts.resolvent(rho * (self._z - self._xi) - self._shift)
        except ProblemError:  # exactly singular, for a W that is not monotone
            return f"W + ρI is singular for ρ = {rho:.1e}"
        before = self._z
        y = alpha * x + (1.0 - alpha) * before + self._xi
        self._z = contacts.law.project(self._rows(y)).ravel()
        self._xi = y - self._z
        self._shift = self._term(self._rows(-rho * self._xi))
        self.counters["projections"] += 1
        if self._penalty.due():
            primal = norm(x - self._z) / max(norm(x), TINY)
            dual = norm(self._z - before) / max(norm(self._xi), self._size / rho, TINY)
            change = self._penalty.follow(primal, dual)
            if change != 1.0:
                self._xi *= change
                self._factorized = False
        return None

    def _rows(self, x: Vector) -> Dense:
        return x.reshape(self._shape)

    def _term(self, u: Dense) -> Vector:
        """Return σ(u) = û − u, all of it in the normal rows."""
        return (self._contacts.law.shift(u) - u).ravel()
