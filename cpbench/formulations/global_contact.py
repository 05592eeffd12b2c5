"""Base of the global contact nodes: dynamics, bilateral constraints, and how their answers are measured."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import scipy.sparse.linalg as spla

from cpbench.formulations.base import Point, Residuals, Term, scaled, squared
from cpbench.formulations.contact import ContactProblem
from cpbench.formulations.sizes import least_squares
from cpbench.foundation import matrices
from cpbench.foundation.factorization import DENSE_LIMIT, Factorization
from cpbench.foundation.matrices import Dense, Matrix, Vector, norm

BUNDLE = 512
"""Columns of H that are solved for at once."""


@dataclass(frozen=True, eq=False)
class GFCPoint(Point):
    """v, shape (n,): velocities of the bodies; r, shape (nc·d,): reactions; lam, shape (p,): joint reactions λ."""

    v: Vector
    r: Vector
    lam: Vector = field(default_factory=lambda: np.zeros(0))


class _HasDynamics:
    M: Matrix
    H: Matrix
    G: Matrix
    f: Vector
    w: Vector
    b: Vector


@dataclass(frozen=True, eq=False, kw_only=True)
class GlobalContact(_HasDynamics, ContactProblem):
    """Mv = Hr + Gλ + f, Gᵀv + b = 0, u = Hᵀv + w and a contact law.

    Measured: `dynamics` = ‖d‖/max(‖Mv‖, ‖Hr‖, ‖Gλ‖, ‖f‖, ‖f₀‖), d = Mv − Hr − Gλ − f; `constraint` = ‖e‖/max(‖|Gᵀ||v|‖,
    ‖b‖, ‖|Gᵀ|v₀‖), e = Gᵀv + b, where there is a G; `imbalance` = (‖d‖/max(‖f‖, ‖f₀‖))² and `drift` =
    (‖e‖/max(‖b‖, ‖|Gᵀ|v₀‖))², whose scales no answer can stretch; and the contact errors with u := Hᵀv + w and
    ρ_c = d/tr(H_cᵀM⁻¹H_c), by the inverse of `saddle` where M is singular. v₀ are the velocities that the loads f, b
    and the contacts give (b alone is 0 for joints that only hold, and Gᵀv then too), f₀ the impulses. All absolute when
    f, w and b are 0.
    """

    rows_of: ClassVar[str] = "w"
    terms: ClassVar[tuple[Term, ...]] = (
        ("f", -1, "M", "v"),
        ("f", 1, "H", "r"),
        ("f", 1, "G", "lam"),
        ("w", 1, "Hᵀ", "v"),
        ("b", 1, "Gᵀ", "v"),
    )

    @property
    def point_sizes(self) -> dict[str, int]:
        return {"v": self.f.size, "r": self.w.size, "lam": self.b.size}

    @property
    def small(self) -> bool:
        """Whether dense arrays of it are small, too."""
        return max(self.f.size + self.b.size, self.w.size) <= DENSE_LIMIT

    @cached_property
    def at_hand(self) -> tuple[Matrix, Matrix, Matrix]:
        """M, H and G to multiply with: dense where they are small, for SciPy takes ten times as long to look at a
        sparse matrix as NumPy to multiply with a small one."""
        M, H, G = self.M, self.H, self.G
        return (matrices.dense(M), matrices.dense(H), matrices.dense(G)) if self.small else (M, H, G)

    @cached_property
    def factorization(self) -> Factorization:
        """LU of M."""
        return Factorization(self.M)

    @cached_property
    def saddle(self) -> Factorization:
        """LU of K = [[M, −G], [Gᵀ, 0]], the equations of v and λ for given r; that of M where G is empty."""
        if not self.b.size:
            return self.factorization
        M, _, G = self.at_hand
        K = matrices.block([[M, -G], [matrices.transpose(G), matrices.zeros(self.b.size, self.b.size, G)]])
        some_sparse = matrices.is_sparse(self.M) or matrices.is_sparse(self.G)
        return Factorization(matrices.sparse(K) if some_sparse else K)  # what comes in sparse stays so

    @cached_property
    def mobility(self) -> Dense:
        """Diagonal of HᵀM⁻¹H, shape (nc, d); where M is singular of [Hᵀ 0]K⁻¹[H; 0], and 0 where K is too."""
        H, M = self.at_hand[1], self.factorization
        if M.singular and self.saddle.singular:
            return matrices.freeze(np.zeros((self.nc, self.dimension)))
        if matrices.is_sparse(H) and self.w.size > BUNDLE and M.block_diagonal and not M.singular:
            product: Any = M.sparse_inverse @ H
            diagonal = np.asarray(product.multiply(H).sum(axis=0), dtype=np.float64)
        elif self.small:
            diagonal = np.einsum("ij,ij->j", matrices.dense(H), self.responses)
        else:
            diagonal = np.empty(self.w.size)
            columns: Any = matrices.sparse(H).tocsc() if matrices.is_sparse(H) else H
            for start in range(0, self.w.size, BUNDLE):  # bounded memory: M⁻¹H is dense
                chunk = matrices.dense(columns[:, start : start + BUNDLE])
                diagonal[start : start + BUNDLE] = np.einsum("ij,ij->j", chunk, self._moved(chunk))
        return matrices.freeze(diagonal.reshape(self.nc, self.dimension))

    @cached_property
    def responses(self) -> Dense:
        """M⁻¹H, how the reactions move the bodies; where M is singular the velocities of K⁻¹(H, 0)."""
        return matrices.freeze(np.asarray(self._moved(matrices.dense(self.at_hand[1]))))

    def _moved(self, force: Vector | Dense) -> Vector | Dense:
        """Return M⁻¹ force, shape (n,) or (n, k); where M is singular the velocities of K⁻¹(force, 0)."""
        if not self.factorization.singular:
            return self.factorization.solve(force)
        return self.saddle.solve(np.concatenate([force, np.zeros((self.b.size, *force.shape[1:]))]))[: self.f.size]

    @cached_property
    def free_motion(self) -> Vector:
        """v for r = 0: K⁻¹(f, −b); where K is singular, λ is the shortest that keeps the constraints; 0 with M."""
        n, M, G = self.f.size, self.factorization, self.G
        if not self.saddle.singular:
            return matrices.freeze(np.asarray(self.saddle.solve(np.concatenate([self.f, -self.b]))[:n]))
        if M.singular:
            return matrices.freeze(np.zeros(n))
        p = self.b.size
        R = spla.LinearOperator(
            (p, p),
            matvec=lambda x: G.T @ M.solve(G @ np.ravel(x)),
            rmatvec=lambda x: G.T @ M.solve(G @ np.ravel(x), transpose=True),
            dtype=np.float64,
        )
        lam = least_squares(R, -self.b - G.T @ M.solve(self.f))
        return matrices.freeze(np.asarray(M.solve(self.f + G @ lam)))

    @cached_property
    def free_velocity(self) -> Vector:
        """u for r = 0, which is q of the local form: the scale of the contact errors."""
        return matrices.freeze(self.at_hand[1].T @ self.free_motion + self.w)

    @cached_property
    def units(self) -> tuple[float, float]:
        """‖f₀‖ and ‖|Gᵀ|v₀‖: the sizes of impulses and of constraint velocities that belong to the problem.

        The contacts' part is what the impulses ρq, q the free velocities of the contacts, do to the bodies.
        """
        M, H, G = self.at_hand
        push = abs(H) @ (self.effective_mass * np.abs(self.free_velocity))
        velocity = np.abs(self.free_motion)
        if not (self.factorization.singular and self.saddle.singular):
            velocity = velocity + np.abs(self._moved(push))
        return max(norm(push), norm(M @ self.free_motion)), norm(abs(G).T @ velocity)

    def slacks(self, point: GFCPoint) -> dict[str, Vector]:
        return {"u": self.H.T @ point.v + self.w}

    def residuals(self, point: GFCPoint, tolerance: float = 1e-6) -> Residuals:
        self.check_point(point)
        with np.errstate(all="ignore"):
            Mv, Hr, Gl = self.M @ point.v, self.H @ point.r, self.G @ point.lam
            dynamics, constraint = norm(Mv - Hr - Gl - self.f), norm(self.G.T @ point.v + self.b)
            absolute = not (self.f.any() or self.w.any() or self.b.any())
            measured, parts, flags = self.contact_residuals(
                point.r, self.H.T @ point.v + self.w, self.free_velocity, tolerance, absolute=absolute
            )
            impulse, velocity = (0.0, 0.0) if absolute else self.units
            impulse, velocity = max(impulse, norm(self.f)), max(velocity, norm(self.b))
            measured["dynamics"] = dynamics if impulse == 0 else scaled(dynamics, *map(norm, (Mv, Hr, Gl)), impulse)
            measured["imbalance"] = squared(scaled(dynamics, impulse))
            parts["dynamics_absolute [N s]"] = dynamics
            if self.b.size:
                Gv = norm(abs(self.G).T @ np.abs(point.v))
                measured["constraint"] = constraint if velocity == 0 else scaled(constraint, Gv, velocity)
                measured["drift"] = squared(scaled(constraint, velocity))
                parts["constraint_absolute [m/s]"] = constraint
            return Residuals(measured, parts, flags)
