"""ADMM on cone programs, and as Douglas–Rachford splitting on monotone cone complementarity problems.

    (M + σI + AᵀRA) x = σx − p + AᵀR(s − b − ξ),  v = α(Ax + b) + (1 − α)s + ξ,  s ← P_K(v),  ξ ← v − s,

R = ρ·diag(weights), constant on every factor; at rest s = Ax + b and y = −Rξ. One factorization for each ρ.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np
import scipy.sparse as sp

from cpbench.errors import ProblemError
from cpbench.foundation import matrices
from cpbench.foundation.cones import Cone
from cpbench.foundation.factorization import Factorization
from cpbench.foundation.matrices import Vector, dense, norm, transpose
from cpbench.solvers.base import SolverSpec, register
from cpbench_solvers.cone.penalty import TINY, StepPenalty
from cpbench_solvers.cone.run import ConicSolver, Iterates
from cpbench_solvers.cone.scaled_form import ConicForm
from cpbench_solvers.traits import ITERATIVE

SIGMA = 1e-9
"""Keeps the system regular where M and A leave some x alone."""
EQUALITY = 1e3
"""How much heavier rows in {0} weigh, as in OSQP."""
RHO, LONGER = (1e-7, 1e7), 1.3
"""Bounds of ρ, and by how much longer each new ρ must stay than the one before."""


@dataclass(frozen=True)
class ADMMOptions:
    """Options of admm-coneqp, admm-soclcp. `rho` : the first penalty, for data of size one. `alpha` :
    over-relaxation, in [1, 2[. `balance` : adapt ρ to the residuals."""

    rho: float = 0.3
    alpha: float = 1.6
    balance: bool = True
    max_iterations: int = 20_000


class ConeSplitting:
    """The iterates of one run."""

    def __init__(self, form: ConicForm, start: tuple[Vector, Vector] | None, options: ADMMOptions) -> None:
        self._form, self._options = form, options
        self.counters = {"iterations": 0, "factorizations": 0, "projections": 0}
        zero = np.repeat(form.K.kind == Cone.ZERO, form.K.size.astype(int))
        self._weight = np.where(zero, EQUALITY, 1.0)
        self._penalty = StepPenalty(options.rho, *RHO, LONGER, options.balance)
        self._factors: Factorization | None = None
        self.x, self.y = start if start is not None else (np.zeros(form.p.size), np.zeros(form.b.size))
        self.s = form.K.project(form.A @ self.x + form.b)
        self._xi = -self.y / (options.rho * self._weight)

    def step(self) -> str | None:
        form, options = self._form, self._options
        R = self._penalty.rho * self._weight
        right = SIGMA * self.x - form.p + form.A.T @ (R * (self.s - form.b - self._xi))
        x = self._solve(right, R)
        if x is None:
            return f"the linear system is singular for ρ = {self._penalty.rho:.1e}"
        reached = form.A @ x + form.b
        v = options.alpha * reached + (1.0 - options.alpha) * self.s + self._xi
        s = form.K.project(v)
        before, self._xi = self.s, v - s
        self.x, self.s, self.y = x, s, -R * self._xi
        self.counters["projections"] += 1
        if self._penalty.due():
            primal = norm(reached - s) / max(norm(reached), norm(s), TINY)
            dual = norm(form.A.T @ (R * (s - before))) / max(norm(form.A.T @ (R * self._xi)), norm(form.p), TINY)
            change = self._penalty.follow(primal, dual)
            if change != 1.0:
                self._xi *= change
                self._factors = None
        return None

    def _solve(self, right: Vector, R: Vector) -> Vector | None:
        form = self._form
        n, m = form.p.size, form.b.size
        thin = sp.issparse(form.M) or sp.issparse(form.A)
        if self._factors is None:
            self.counters["factorizations"] += 1
            if thin:  # AᵀRA may be dense where M and A are sparse
                lower = sp.csr_array(sp.diags_array(-1.0 / R, shape=(m, m)))
                upper = sp.csr_array(form.M + SIGMA * sp.eye_array(n))
                self._factors = Factorization(matrices.block([[upper, transpose(form.A)], [form.A, lower]]))
            else:
                A = dense(form.A)
                self._factors = Factorization(dense(form.M) + (A.T * R) @ A + SIGMA * np.eye(n))
        try:
            if not thin:
                return np.asarray(self._factors.solve(right))
            return np.asarray(self._factors.solve(np.concatenate([right, np.zeros(m)])))[:n]
        except ProblemError:  # exactly singular
            return None


class _ADMM(ConicSolver):
    """Base of the solvers of the two nodes: everything but the node."""

    def begin(self, form: ConicForm, start: tuple[Vector, Vector] | None, options: ADMMOptions) -> Iterates:
        return ConeSplitting(form, start, options)


_spec = partial(SolverSpec, method="operator splitting", traits=ITERATIVE, options=ADMMOptions)


@register
class ADMMCone(_ADMM):
    """A method that converges for every Q ⪰ 0, with any A and K; linearly in the end at a nondegenerate solution."""

    spec: ClassVar[SolverSpec] = _spec(
        name="admm-coneqp",
        node="coneqp",
        summary="ADMM, one factorization for each of few penalties, over-relaxed",
        citation="Boyd et al. 2011, Found. Trends Mach. Learn. 3:1; Stellato et al. 2020, Math. Prog. Comp. 12:637",
    )


@register
class ADMMSOCLCP(_ADMM):
    """A method that converges for monotone M, symmetric or not; other M are tried."""

    spec: ClassVar[SolverSpec] = _spec(
        name="admm-soclcp",
        node="soclcp",
        summary="Douglas-Rachford splitting: resolvents of the map and projections on the cone",
        citation="Lions and Mercier 1979, SIAM J. Numer. Anal. 16:964; Eckstein and Bertsekas 1992, Math. Prog. 55:293",
    )
