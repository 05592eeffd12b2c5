"""Contact with the dynamics of the bodies: Acary's P_LM with Coulomb's friction or rolling, and P, whose dynamics are
nonlinear."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import scipy.sparse.linalg as spla

from cpbench.formulations.base import (
    Point,
    Residuals,
    Term,
    formulations,
    map_field,
    matrix_field,
    point_field,
    scaled,
    squared,
    vector_field,
)
from cpbench.formulations.contact import ContactProblem
from cpbench.formulations.expressions import Map
from cpbench.formulations.sizes import least_squares
from cpbench.foundation import matrices
from cpbench.foundation.factorization import DENSE_LIMIT, Factorization
from cpbench.foundation.matrices import Dense, Matrix, Vector, norm

BUNDLE = 512
"""Columns of H that are solved for at once."""


@dataclass(frozen=True, eq=False)
class GFCPoint(Point):
    """v, shape (n,): velocities of the bodies; r, shape (nc·d,): reactions; lam, shape (p,): joint reactions λ."""

    v: Vector = point_field("n")
    r: Vector = point_field("m")
    lam: Vector = point_field("p", optional=True)


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

    def measure(self, point: GFCPoint, tolerance: float) -> Residuals:
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


@formulations.register("gfc")
@dataclass(frozen=True, eq=False, kw_only=True)
class GlobalFrictionContact(GlobalContact):
    """Mv = Hr + Gλ + f, Gᵀv + b = 0, u = Hᵀv + w, K*_μ ∋ û ⟂ r ∈ K_μ at every contact.

    G and b are bilateral constraints (joints), empty by default; w is 0 by default. M need not be symmetric.
    """

    node: ClassVar[str] = "gfc"
    core: ClassVar[bool] = True
    title: ClassVar[str] = "frictional contact, global"
    equation: ClassVar[str] = "P_LM"
    relations: ClassVar[tuple[str, ...]] = (
        "Mv = Hr + Gλ + f",
        "Gᵀv + b = 0",
        "u = Hᵀv + w",
        "û = u + μ‖u_T‖e_N",
        "K*_μ ∋ û ⟂ r ∈ K_μ",
    )
    point_type: ClassVar[type[Point]] = GFCPoint
    no_slip: ClassVar[str] = (
        "with T its tangential rows, set mu = 0 there and append H[:, T] to G and w[T] to b, so that lam has its r_T"
    )

    M: Matrix = matrix_field("n", "n")
    H: Matrix = matrix_field("n", "m")
    G: Matrix = matrix_field("n", "p", optional=True)
    f: Vector = vector_field("n")
    w: Vector = vector_field("m", fill=0.0)
    b: Vector = vector_field("p", fill=0.0)
    mu: Vector = vector_field("nc")


@formulations.register("grfc")
@dataclass(frozen=True, eq=False, kw_only=True)
class GlobalRollingFrictionContact(GlobalContact):
    """Mv = Hr + Gλ + f, Gᵀv + b = 0, u = Hᵀv + w, K* ∋ û ⟂ r ∈ K with the rolling cone of `rfc`.

    Rows of a contact: (N, T1, T2, M1, M2) for dimension 5, (N, T, M) for dimension 3.
    """

    node: ClassVar[str] = "grfc"
    title: ClassVar[str] = "rolling frictional contact, global"
    equation: ClassVar[str] = "P_LM, rolling"
    relations: ClassVar[tuple[str, ...]] = (
        "Mv = Hr + Gλ + f",
        "Gᵀv + b = 0",
        "u = Hᵀv + w",
        "û = u + (μ‖u_T‖ + μ_r‖ω‖)e_N",
        "K* ∋ û ⟂ r ∈ K = {‖r_T‖ ≤ μ r_N, ‖m‖ ≤ μ_r r_N}",
    )
    point_type: ClassVar[type[Point]] = GFCPoint
    dimensions: ClassVar[tuple[int, ...]] = (3, 5)

    M: Matrix = matrix_field("n", "n")
    H: Matrix = matrix_field("n", "m")
    G: Matrix = matrix_field("n", "p", optional=True)
    f: Vector = vector_field("n")
    w: Vector = vector_field("m")
    b: Vector = vector_field("p", fill=0.0)
    mu: Vector = vector_field("nc")
    mu_r: Vector = vector_field("nc")
    dimension: int = 5


FREE_STEPS = 50
"""Newton steps to the motion without contact; the start is taken where they do not get there."""


@dataclass(frozen=True, eq=False)
class NFCPoint(Point):
    """v, shape (n,): velocities of the bodies; r, shape (nc·d,): reactions."""

    v: Vector = point_field("n")
    r: Vector = point_field("m")


@formulations.register("nfc")
@dataclass(frozen=True, eq=False, kw_only=True)
class NonlinearFrictionContact(ContactProblem):
    """F(v) = Hr, u = Hᵀv + w, K*_μ ∋ û ⟂ r ∈ K_μ at every contact.

    Measured as `gfc`: `dynamics` = ‖F(v) − Hr‖/max(‖Hr‖, f₀), `imbalance` = (‖F(v) − Hr‖/f₀)², and the contact errors
    with u := Hᵀv + w. Their scales are those of the problem linearized at the motion v₀ without contact, F(v₀) = 0.
    """

    node: ClassVar[str] = "nfc"
    title: ClassVar[str] = "frictional contact, nonlinear dynamics"
    equation: ClassVar[str] = "P"
    relations: ClassVar[tuple[str, ...]] = (
        "F(v) = Hr",
        "u = Hᵀv + w",
        "û = u + μ‖u_T‖e_N",
        "K*_μ ∋ û ⟂ r ∈ K_μ",
    )
    point_type: ClassVar[type[Point]] = NFCPoint
    rows_of: ClassVar[str] = "w"

    F: Map = map_field("n", "n")
    H: Matrix = matrix_field("n", "m")
    w: Vector = vector_field("m")
    mu: Vector = vector_field("nc")
    start: Vector = vector_field("n", fill=0.0)

    def linearized(self, v: Vector) -> GlobalFrictionContact:
        """Linearize at the velocities v, shape (n,): F(v) + F′(v)(x − v) = Hr in place of F(x) = Hr: M = F′(v), f = Mv
        − F(v)."""
        M = self.F.jacobian(v)
        return GlobalFrictionContact(
            M=M, H=self.H, f=M @ v - self.F(v), w=self.w, mu=self.mu, dimension=self.dimension,
            sequence=self.sequence, contacts=self.contacts,
        )  # fmt: skip

    @cached_property
    def free_motion(self) -> Vector:
        """v₀."""
        v = self.start
        with np.errstate(all="ignore"):
            for _ in range(FREE_STEPS):
                force = self.F(v)
                jacobian = self.F.jacobian(v)
                if not np.isfinite(force).all() or not np.isfinite(jacobian.data).all():
                    return self.start
                factors = Factorization(jacobian)
                if factors.singular:
                    return self.start
                step = np.asarray(factors.solve(force))
                v = v - step
                if norm(step) <= 1e-12 * max(norm(v), 1e-300):
                    return v
        return self.start

    @cached_property
    def reference(self) -> GlobalFrictionContact:
        """The problem linearized at v₀, whose sizes are the scales."""
        return self.linearized(self.free_motion)

    @cached_property
    def mobility(self) -> Dense:
        return self.reference.mobility

    def slacks(self, point: NFCPoint) -> dict[str, Vector]:
        return {"u": self.H.T @ point.v + self.w}

    def measure(self, point: NFCPoint, tolerance: float) -> Residuals:
        Hr = self.H @ point.r
        dynamics = norm(self.F(point.v) - Hr) if point.finite else np.inf
        impulse, _ = self.reference.units
        impulse = max(impulse, norm(self.reference.f))
        free = self.reference.free_velocity
        absolute = not (impulse or free.any())
        measured, parts, flags = self.contact_residuals(
            point.r, self.H.T @ point.v + self.w, free, tolerance, absolute=absolute
        )
        measured["dynamics"] = scaled(dynamics, norm(Hr), impulse) if impulse else dynamics
        measured["imbalance"] = squared(scaled(dynamics, impulse))
        parts["dynamics_absolute [N s]"] = dynamics
        return Residuals(measured, parts, flags)
