"""Primal-dual interior points on frictional contact, scaled as Nesterov and Todd do; with De Saxcé's term, or without.

In units where every W_cc has mean diagonal 1 and the tangential components are divided by μ the cones are Lorentz's L:
x = Ty, T = diag(1, μ, μ), and De Saxcé's term μ‖u_T‖ is ‖w_T‖ of the dual w = Tû itself. Find y, w ∈ int L with

    TWTy + Tq + φ(w) e_N − w = 0,   y ∘ w = σ e → 0,   φ(w) = √(‖w_T‖² + ε²), ε ~ σ (0 for the relaxation)

by Newton's method. With Θy = w, Θ = P(p)⁻¹ at the scaling point p, the second line gives dw = c − Θdy, and

    (TWT + (I − e_N φ′)Θ) dy = −residual + (I − e_N φ′) c,

a matrix as sparse as W, for a predictor (σ = 0) and Mehrotra's corrector. Without φ the problem is a convex cone
program for W ⪰ 0; with it, it is the law, not convex, and convergence is a matter of experience.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp

from cpbench.cones import Coulomb
from cpbench.errors import ProblemError
from cpbench.factorization import Factorization
from cpbench.formulations.base import Kind
from cpbench.formulations.contact import FCPoint, contact_residuals
from cpbench.matrices import Dense, Matrix, Vector, max_abs, scaled_both
from cpbench.solvers.base import Budget, Record, SolverOutput, SolverSpec, register
from cpbench.solvers.native.cone.lorentz import RowScaling, longest
from cpbench.solvers.native.contact.run import ContactMethod, ContactSolver, contact_spec, finish, iterate
from cpbench.solvers.native.contact.sweeps import ScaledContacts
from cpbench.solvers.options import fixed, searched

SHORTEST = 1e-8
"""A step shorter than this means that the iterates are stuck at the boundary."""


@dataclass(frozen=True)
class ContactInteriorPointOptions:
    """Options of interior-point-fc, interior-point-relaxation. `boundary` : share of the way to the boundary that a
    step goes. `smoothing` : ε, in units of max|q|, over yᵀw/nc in those of its square. `max_iterations`."""

    boundary: float = searched(0.7, low=0.5, high=0.99)
    smoothing: float = searched(0.1, low=1e-3, high=1.0, log=True)
    max_iterations: int = fixed(300)
    stall_window: int = fixed(30)


class _InteriorPoint(ContactMethod):
    """Base of the interior-point methods. `shifted` : whether De Saxcé's term is there."""

    shifted: ClassVar[bool] = True

    def __init__(
        self, contacts: ScaledContacts, options: ContactInteriorPointOptions, start: Vector, budget: Budget
    ) -> None:
        problem = contacts.rows.problem
        self._options, self._d, self._nc = options, problem.dimension, problem.nc
        T = np.ones((problem.nc, self._d))
        T[:, 1:] = problem.mu[:, None]
        self._unit, self._start, self._begun = contacts.s * T.ravel(), start, False
        self._W = _with_diagonal(scaled_both(contacts.W, T.ravel()), np.where(T.ravel() == 0.0, 1.0, 0.0))
        self._q = (T * contacts.q.reshape(T.shape)).reshape(T.shape)
        self._size = max_abs(self._q) or 1.0
        self.y, self.w = np.zeros(T.shape), np.zeros(T.shape)
        self.y[:, 0] = self.w[:, 0] = self._size
        self.counters = {"factorizations": 0}

    @property
    def r(self) -> Vector:
        return self._unit * self.y.ravel() if self._begun else self._start

    def step(self, many: int, error: float, seconds: float) -> str | None:
        self._begun = True
        y, w = self.y, self.w
        gap = float(np.einsum("ci,ci->", y, w)) / self._nc
        if not gap > 0.0:
            return "the iterates have left the cones"
        epsilon = self._options.smoothing * gap / self._size
        phi, slope = self._term(w, epsilon)
        residual = (self._W @ y.ravel()).reshape(y.shape) + self._q - w
        residual[:, 0] += phi
        scaling = RowScaling(y, w)
        # (I − e_N φ′)Θ: the first row less a combination of the others
        theta = scaling.theta
        blocks = theta.copy()
        blocks[:, 0, :] -= np.einsum("ci,cij->cj", slope, theta)
        self.counters["factorizations"] += 1
        factors = Factorization(_plus_blocks(self._W, blocks))

        def direction(c: Dense) -> tuple[Dense, Dense]:
            right = c - residual
            right[:, 0] -= np.einsum("ci,ci->c", slope, c)
            dy = np.asarray(factors.solve(right.ravel())).reshape(y.shape)
            return dy, c - np.einsum("cij,cj->ci", theta, dy)

        try:
            dy, dw = direction(scaling.right_hand_side(None, 0.0))
            length = min(longest(y, dy), longest(w, dw), 1.0)
            ahead = float(np.einsum("ci,ci->", y + length * dy, w + length * dw)) / self._nc
            sigma = min(max(ahead / gap, 0.0), 1.0) ** 3
            dy, dw = direction(scaling.right_hand_side((dy, dw), sigma * gap))
        except ProblemError:
            return "the linear system is singular"
        if not (np.isfinite(dy).all() and np.isfinite(dw).all()):
            return "the linear system is singular"
        length = min(self._options.boundary * min(longest(y, dy), longest(w, dw)), 1.0)
        if length < SHORTEST:
            return f"steps of length {length:.0e}"
        self.y, self.w = y + length * dy, w + length * dw
        return None

    def _term(self, w: Dense, epsilon: float) -> tuple[Vector, Dense]:
        """Return φ and φ′, shapes (nc,) and (nc, d)."""
        slope = np.zeros_like(w)
        if not self.shifted:
            return np.zeros(self._nc), slope
        phi = np.sqrt(np.einsum("ci,ci->c", w[:, 1:], w[:, 1:]) + epsilon**2)
        slope[:, 1:] = w[:, 1:] / phi[:, None]
        return phi, slope


class _Relaxed(_InteriorPoint):
    shifted: ClassVar[bool] = False


def _with_diagonal(W: Matrix, diagonal: Vector) -> Matrix:
    return sp.csr_array(W + sp.diags_array(diagonal)) if sp.issparse(W) else np.asarray(W + np.diag(diagonal))


def _plus_blocks(W: Matrix, blocks: Dense) -> Matrix:
    nc, d, _ = blocks.shape
    c = np.arange(nc)
    if sp.issparse(W):
        return sp.csr_array(W + sp.csr_array(sp.bsr_array((blocks, c, np.arange(nc + 1)), shape=W.shape)))
    whole = np.array(W).reshape(nc, d, nc, d)
    whole[c, :, c, :] += blocks
    return whole.reshape(W.shape)


class _Associated(Coulomb):
    """The relaxation's law: û = u."""

    def shift(self, u: Dense) -> Dense:
        return u


@register
class InteriorPointContact(ContactSolver):
    """The whole law, De Saxcé's term in every Newton step with its derivative. A start is returned where it is right,
    and otherwise not used: the middle of the cones is a better place to begin."""

    spec: ClassVar[SolverSpec] = contact_spec(
        "interior-point-fc",
        "nonconvex primal-dual interior point with De Saxcé's term",
        "interior point",
        "Acary, Armand, Nguyen and Shpakovych 2024; Nesterov and Todd 1998; Mehrotra 1992",
        ContactInteriorPointOptions,
    )
    method: ClassVar[Any] = _InteriorPoint


@register
class InteriorPointRelaxation(ContactSolver):
    """min ½rᵀWr + qᵀr over the friction cones: sliding contacts open. The claim is about this problem."""

    spec: ClassVar[SolverSpec] = contact_spec(
        "interior-point-relaxation",
        "primal-dual interior point on the convex relaxation",
        "interior point",
        "Anitescu and Tasora 2010, Comput. Optim. Appl. 47:207; Nesterov and Todd 1998; Mehrotra 1992",
        ContactInteriorPointOptions,
        kind=Kind.RELAXATION,
        by_default=False,
    )
    method: ClassVar[Any] = _Relaxed

    def solve(
        self,
        prepared: ScaledContacts,
        budget: Budget,
        options: ContactInteriorPointOptions,
        start: Any | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        problem = prepared.rows.problem
        law = _Associated(problem.mu)

        def judged(r: Vector) -> float:
            """Measure the error as the formulation does, with û = u."""
            with np.errstate(all="ignore"):
                u = problem.W @ r + problem.q
                numbers, _, _ = contact_residuals(
                    r, u, problem.q, law, problem.rho, budget.tolerance, absolute=not problem.q.any()
                )
            return max(numbers.values())

        r = np.zeros(problem.q.size) if start is None else np.array(start.r)
        limit = budget.iterations or options.max_iterations
        method = _Relaxed(prepared, options, r, budget)
        return finish(iterate(method, judged, FCPoint, budget, limit, options.stall_window, record), FCPoint, budget)
