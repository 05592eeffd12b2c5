"""Semismooth Newton on the function of Alart and Curnier: the law as fixed points of two projections."""

from __future__ import annotations

import math
import time
from collections import deque
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp

from cpbench.errors import ProblemError
from cpbench.factorization import Factorization
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.fc import FrictionContact
from cpbench.matrices import Dense, Matrix, Vector, norm
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register
from cpbench.solvers.native.contact_sweeps import ScaledContacts, Sweeps, conclude, scaled_contacts
from cpbench.solvers.options import fixed, searched

DESCENT, HALVINGS = 1e-4, 8
SHARE = (1e-2, 1e-8, 1e4)
"""Regularization relative to ‖Φ‖: at first, at least, at most. A full step divides it by EASE, a failure times HARD."""
EASE, HARD = 10.0, 100.0
LARGEST = 1.0
PATIENCE = 12
"""Newton steps without halving ‖Φ‖ after which sweeps are better."""
DENSE_FROM = 0.25
"""Share of entries from which a sparse W is factorized as a dense one."""


@dataclass(frozen=True)
class AlartCurnierOptions:
    """`sweeps` : of Gauss–Seidel in the beginning, twice as many every time that Newton fails. `memory` : merits of
    earlier steps, the largest of which a new one must be below. `max_iterations` : steps and sweeps together."""

    sweeps: int = searched(30, low=5, high=500, log=True)
    memory: int = searched(4, low=1, high=10)
    max_iterations: int = fixed(50_000)


class AlartCurnier:
    """Φ(x) = x − P(y), y = x − ϱ(W′x + q′): P on [0, ∞) for N, on the disk of radius μ max(y_N, 0) for T.

    ϱ is 1/W′_NN for the normal rows and 1 over the mean of W′_TT's diagonal for the tangential ones. A zero of Φ
    solves the problem, whatever ϱ > 0.
    """

    def __init__(self, contacts: ScaledContacts) -> None:
        problem, W = contacts.rows.problem, contacts.W
        self._mu, self._q, self._W = problem.mu, contacts.q, W
        d, nc = problem.dimension, problem.nc
        self._shape = (nc, d)
        mobility = problem.mobility * (contacts.s**2).reshape(self._shape)
        mean = np.stack([mobility[:, 0], *(d - 1) * [mobility[:, 1:].mean(axis=1)]], axis=1)
        self._rho = np.where(mean > 0, 1.0 / np.where(mean > 0, mean, 1.0), 1.0).ravel()
        self._dense = not sp.issparse(W) or W.nnz > DENSE_FROM * W.shape[0] ** 2
        if self._dense:
            whole = W.toarray() if sp.issparse(W) else W
            self._scaled = (self._rho[:, None] * whole).reshape(nc, d, nc * d)
        else:
            self._blocks = sp.bsr_array(sp.diags_array(self._rho) @ W, blocksize=(d, d))
            self._row = np.repeat(np.arange(nc), np.diff(self._blocks.indptr))

    def at(self, x: Vector) -> tuple[Vector, Dense]:
        """Φ(x), and y by contacts."""
        y = (x - self._rho * (self._W @ x + self._q)).reshape(self._shape)
        normal, length = np.maximum(y[:, 0], 0.0), np.linalg.norm(y[:, 1:], axis=1)
        P = y.copy()
        P[:, 0] = normal
        P[:, 1:] *= _ratio(self._mu * normal, length)[:, None]
        return x - P.ravel(), y

    def jacobian(self, y: Dense, tau: float) -> Matrix:
        """An element of ∂Φ, of W′ + τϱ⁻¹ in place of W′."""
        C = self._projection(y)
        diagonal = np.eye(self._shape[1]) - (1.0 - tau) * C
        c = np.arange(self._shape[0])
        if self._dense:
            J = np.matmul(C, self._scaled).reshape(*self._shape, *self._shape)
            J[c, :, c, :] += diagonal
            return J.reshape(y.size, y.size)
        W = self._blocks
        product = sp.bsr_array((C[self._row] @ W.data, W.indices, W.indptr), shape=W.shape)
        J = sp.csr_array(product + sp.bsr_array((diagonal, c, np.arange(c.size + 1)), shape=W.shape))
        J.eliminate_zeros()  # the rows of open contacts
        return J

    def _projection(self, y: Dense) -> Dense:
        """∂P/∂y, shape (nc, d, d)."""
        nc, d = self._shape
        C = np.zeros((nc, d, d))
        closed, length = y[:, 0] > 0, np.linalg.norm(y[:, 1:], axis=1)
        radius = self._mu * np.maximum(y[:, 0], 0.0)
        slides = closed & (length > radius)
        e = np.where(slides, 1.0 / np.where(length > 0, length, 1.0), 0.0)[:, None] * y[:, 1:]
        C[:, 0, 0] = closed
        C[:, 1:, 0] = self._mu[:, None] * e
        sphere = np.eye(d - 1) - e[:, :, None] * e[:, None, :]
        C[:, 1:, 1:] = (closed * _ratio(radius, length))[:, None, None] * sphere
        return C


class NewtonPhase:
    """Newton steps from a point as long as they gain; the regularization is remembered."""

    def __init__(self, contacts: ScaledContacts, memory: int) -> None:
        self._rows, self._s = contacts.rows, contacts.s
        self._function = AlartCurnier(contacts)
        self._memory, self._share = memory, SHARE[0]
        self.factorizations = 0

    def begin(self, r: Vector) -> None:
        self._x = r / self._s
        self._phi, self._y = self._function.at(self._x)
        size = norm(self._phi)
        self._recent = deque([size], maxlen=self._memory)
        self._level, self._idle = size, 0
        self._share = min(self._share, 1.0)

    @property
    def r(self) -> Vector:
        return self._s * self._x

    def step(self) -> bool:
        """One step; False when there is none that descends, or when they gain too little."""
        size = norm(self._phi)
        self._idle += 1
        if size < 0.5 * self._level:
            self._level, self._idle = size, 0
        if self._idle > PATIENCE or not math.isfinite(size) or size == 0.0:
            return False
        while self._share <= SHARE[2]:
            d = self._direction(min(self._share * size, LARGEST))
            if d is not None:
                for halving in range(HALVINGS + 1):
                    t = 0.5**halving
                    x = self._x + t * d
                    phi, y = self._function.at(x)
                    if norm(phi) <= (1.0 - DESCENT * t) * max(self._recent):
                        self._x, self._phi, self._y = x, phi, y
                        self._recent.append(norm(phi))
                        if halving == 0:
                            self._share = max(self._share / EASE, SHARE[1])
                        return True
            self._share *= HARD
        return False

    def _direction(self, tau: float) -> Vector | None:
        self.factorizations += 1
        try:
            with np.errstate(all="ignore"):
                d = np.asarray(Factorization(self._function.jacobian(self._y, tau)).solve(-self._phi))
        except ProblemError:  # exactly singular
            return None
        return d if np.isfinite(d).all() else None


@register
class AlartCurnierNewton(Solver):
    """Sweeps of Gauss–Seidel to come near, then Newton steps with line search; sweeps again where these fail.

    W is regularized by τ, which falls with ‖Φ‖, so that hyperstatic contacts (W singular) have a Newton step.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="alart-curnier-newton",
        node="fc",
        summary="semismooth Newton on the Alart-Curnier function, from a start by Gauss-Seidel",
        method="semismooth Newton",
        citation="Alart and Curnier 1991, CMAME 92:353; Acary, Brémond and Huber 2018, Springer LNACM 92:205",
        traits=frozenset({Trait.SPARSE, Trait.WARM_START, Trait.HISTORY, Trait.DETERMINISTIC}),
        options=AlartCurnierOptions,
    )

    def setup(self, problem: FrictionContact, budget: Budget, options: AlartCurnierOptions) -> ScaledContacts:
        return scaled_contacts(problem)

    def warmup(self) -> None:
        for d in (2, 3):
            q = np.zeros(d)
            q[0] = -1.0
            self.run(FrictionContact(W=np.eye(d), q=q, mu=np.array([0.5]), dimension=d))

    def solve(
        self,
        prepared: ScaledContacts,
        budget: Budget,
        options: AlartCurnierOptions,
        start: Any | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        rows = prepared.rows
        deadline = time.monotonic() + budget.seconds
        limit = budget.iterations or options.max_iterations
        best = np.zeros(prepared.q.size) if start is None else np.array(start.r)
        least, steps, count = rows.judged(best), 0, options.sweeps
        if record is not None:
            record(0, least, lambda: FCPoint(best))
        claim, message = Claim.MAX_ITER, f"{limit} steps and sweeps"
        # no contact, or solved by its start: nothing is compiled, loaded or factorized
        sweeps = newton = None
        while not least <= budget.tolerance:
            if sweeps is None or newton is None:
                sweeps, newton = Sweeps(rows), NewtonPhase(prepared, options.memory)
            r = best.copy()
            room = limit - steps - sweeps.done
            if room <= 0:
                break
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
                error = rows.judged(r)
                if error < least:
                    best, least = r, error
                    if record is not None:
                        record(steps + sweeps.done, error, lambda now=r: FCPoint(now))
            if time.monotonic() > deadline:
                claim, message = Claim.FAILED, f"out of time after {steps} steps and {sweeps.done} sweeps"
                break
        done = 0 if sweeps is None else sweeps.done
        counters = {
            "iterations": steps + done,
            "newton_steps": steps,
            "sweeps": done,
            "factorizations": 0 if newton is None else newton.factorizations,
        }
        return conclude(rows.problem, best, least, budget, claim, message, counters)


def _ratio(radius: Vector, length: Vector) -> Vector:
    """What a vector of that length is shortened by to lie in the disk."""
    outside = length > radius
    return np.where(outside, radius / np.where(outside, length, 1.0), 1.0)
