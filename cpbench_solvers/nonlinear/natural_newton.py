"""Semismooth Newton on the natural map of the conditions of Karush, Kuhn and Tucker, for every set a VI or QVI has.

With x = (z, λ, μ, ν) and the field E(x) = (G, Az − b, Cz − d, g), G = F − Aᵀλ − Cᵀμ − ∇gᵀν, the conditions are an
inequality over S × ℝ₊ᵐ × ℝᵏ × ℝ₊ᵖ, whose natural map Φ(x) = x − P(x − E(x)) is what is judged. Where S moves with z,
S(z) is what is projected on.

Newton      (I − J(I − E′) − ∂P/∂S) d = −Φ, J an element of ∂P at x − E(x), ∂P/∂S what the moving set adds: slopes of
            the bounds that are met, μ t̂ of a disk that is left. Everything is exact, nothing is differenced. Where no
            length cuts ‖Φ‖, E′ is regularized by εI, ε → 0 with ‖Φ‖; then Levenberg–Marquardt.
Otherwise   steps of the extragradient method on the same inequality, which converge where it is monotone; Newton is
            tried again after a while, each time a longer one, and must beat the least ‖Φ‖ it was accepted at.
Elsewhere   where neither gains for long (no inequality need be monotone), from random points, drawn with the budget's
            seed; when these are used up, from the best of all.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.variational import QVI, VI, QVIPoint, VIPoint
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.foundation.factorization import Factorization
from cpbench.foundation.matrices import Sparse, Vector, norm
from cpbench.solvers.shared.jacobians import box_jacobian, projection_jacobian
from cpbench_solvers.nonlinear.projection_run import Field, ProjectionMethod, VIProjectionOptions
from cpbench_solvers.nonlinear.vi_extragradient import Extragradient, ExtragradientOptions

DESCENT = 1e-4
LENGTHS = tuple(0.5**k for k in range(8))
EPSILON = ((0.0, 0.0), (1e-3, 1.0), (0.03, 0.5), (0.3, 0.5))
"""ε = c‖Φ‖^k for (c, k), at most 1, one after the other until one descends."""
DAMPING = (1e-8, 1e-5, 1e-2, 1.0)
"""Of Levenberg–Marquardt, relative to the largest entry of VᵀV."""
FIRST_PHASE = 10
"""Extragradient steps before Newton is tried again the first time."""
PATIENCE = 100
"""Steps without gain of a tenth of ‖Φ‖ after which another start is tried."""
SPREAD = (-1.0, 1.0)
"""Random starts scatter by a power of 10 drawn from here, times max(1, |z|) of the first start."""
DRAWS = 30


@dataclass(frozen=True)
class NaturalNewtonOptions(VIProjectionOptions):
    """Options of newton-vi, newton-qvi, newton-equation. `max_iterations` : steps of either kind. `restarts` : other
    starts that are tried where steps gain nothing."""

    max_iterations: int = 20_000
    restarts: int = 5


class VIConditions(Field):
    """E and S × ℝ₊ᵐ × ℝᵏ × ℝ₊ᵖ of a problem, with their derivatives."""

    def __init__(self, problem: VI | QVI) -> None:
        super().__init__(problem)
        self.counters |= {"jacobians": 0, "factorizations": 0}
        self.n = problem.start.size
        m, k = (problem.b.size, problem.d.size) if isinstance(problem, VI) else (0, 0)
        self._fixed = m + k
        self._signed = np.repeat([True, False, True], [m, k, problem.g.rows])
        """Rows with a multiplier ≥ 0."""
        if isinstance(problem, VI):
            self._A: Sparse = sp.csr_array(sp.vstack([sp.csr_array(problem.A), sp.csr_array(problem.C)]))
            self._b = np.concatenate([problem.b, problem.d])
        else:
            self._A, self._b = sp.csr_array((0, self.n)), np.zeros(0)

    @property
    def size(self) -> int:
        return self.n + self._signed.size

    def point(self, x: Vector) -> Any:
        z, multipliers = x[: self.n], x[self.n :]
        if isinstance(self.problem, QVI):
            return QVIPoint(z, multipliers)
        m = self.problem.b.size
        return VIPoint(z, multipliers[:m], multipliers[m : self._fixed], multipliers[self._fixed :])

    def F(self, x: Vector) -> Vector:
        z, multipliers = x[: self.n], x[self.n :]
        G = super().F(z)
        if not multipliers.size:
            return G
        with np.errstate(all="ignore"):
            return np.concatenate([G - self._slopes(z)[0].T @ multipliers, self._A @ z - self._b, self._g(z)])

    def project(self, x: Vector, at: Vector) -> Vector:
        below = x[self.n :]
        kept = np.where(self._signed, np.maximum(below, 0.0), below)
        return np.concatenate([super().project(x[: self.n], at[: self.n]), kept])

    def defect(self, x: Vector, F: Vector) -> Vector:
        rows, multipliers = F[self.n :], x[self.n :]
        kept = np.where(self._signed, np.minimum(multipliers, rows), rows)
        return np.concatenate([super().defect(x[: self.n], F[: self.n]), kept])

    def bounds(self, x: Vector) -> tuple[Vector, Vector, ProductCone | None]:
        lb, ub, K = super().bounds(x[: self.n])
        count = self._signed.size
        if K is not None and count:
            more = (Cone.FREE, count, 0.0, 0.0)
            K = ProductCone(
                *(np.append(own, last) for own, last in zip((K.kind, K.size, K.mu, K.mu_r), more, strict=True))
            )
        return np.append(lb, np.where(self._signed, 0.0, -np.inf)), np.append(ub, np.full(count, np.inf)), K

    def _g(self, z: Vector) -> Vector:
        if isinstance(self.problem, QVI):
            return self.problem.row_values(z)
        return self.problem.g(z) if self.problem.g.rows else np.zeros(0)

    def _slopes(self, z: Vector) -> tuple[Sparse, Sparse]:
        """Return derivatives of all rows: along which forces act (by y, where g has y and z), and the whole ones."""
        g = self.problem.g
        if not g.rows:
            return self._A, self._A
        if not isinstance(self.problem, QVI):
            both = sp.csr_array(sp.vstack([self._A, g.jacobian(z)]))
            return both, both
        J = g.jacobian(np.concatenate([z, z]))
        return sp.csr_array(J[:, : self.n]), sp.csr_array(J[:, : self.n] + J[:, self.n :])

    def _curvature(self, z: Vector, nu: Vector) -> Sparse:
        """Return d/dz of ∇_y gᵀν."""
        g = self.problem.g
        if not isinstance(self.problem, QVI):
            return g.hessian(z, nu)
        H = sp.csr_array(g.hessian(np.concatenate([z, z]), nu))
        return sp.csr_array(H[: self.n, : self.n] + H[: self.n, self.n :])

    def derivative(self, x: Vector) -> Sparse | None:
        """Return E′(x); None where an entry is not a number."""
        self.counters["jacobians"] += 1
        z = x[: self.n]
        with np.errstate(all="ignore"):
            top = self.problem.F.jacobian(z)
            if not self._signed.size:
                return top if np.isfinite(top.data).all() else None
            if self.problem.g.rows:
                top = top - self._curvature(z, x[self.n + self._fixed :])
            pushing, whole = self._slopes(z)
            E: Sparse = sp.csr_array(sp.block_array([[top, -pushing.T], [whole, None]]))
        return E if np.isfinite(E.data).all() else None

    def projection(self, x: Vector, at: Vector) -> tuple[Sparse, Sparse]:
        """Return J ∈ ∂P(x) of the projection on the set at `at`, and its derivative by `at`; 0 for a fixed set."""
        n, problem = self.n, self.problem
        y = x[:n]
        if isinstance(problem, QVI):
            K, lb, ub = problem.set_at(at[:n])
            moving = _motion(problem, y, at[:n], lb, ub)
        else:
            K, lb, ub = problem.K, problem.lb, problem.ub
            moving = sp.csr_array((n, n))
        J = projection_jacobian(K, y)
        bounded = np.isfinite(lb) | np.isfinite(ub)
        if bounded.any():
            J = sp.csr_array(
                box_jacobian(np.where(bounded, y, 0.0), np.where(bounded, lb, -1.0), np.where(bounded, ub, 1.0)) @ J
            )
        below = sp.diags_array(np.where(self._signed, x[n:] > 0, True).astype(float))
        rest = sp.csr_array((self._signed.size, self._signed.size))
        return sp.csr_array(sp.block_diag([J, below])), sp.csr_array(sp.block_diag([moving, rest]))


def _motion(problem: QVI, x: Vector, z: Vector, lb: Vector, ub: Vector) -> Sparse:
    """Return d/dz of P_S(z)(x) at a constant x."""
    n = z.size
    result: Sparse = sp.csr_array((n, n))
    for bound, level, met in ((problem.lower, lb, x <= lb), (problem.upper, ub, x >= ub)):
        if bound.rows:
            with np.errstate(all="ignore"):
                own = met & (level == bound(z))  # not where a bound that stays is the nearer one
                result = result + sp.diags_array(own.astype(float)) @ bound.jacobian(z)
    for kind, rows, mu, _ in problem.K.groups:
        if kind == Cone.CYLINDER:
            part, normal = x[rows[:, 1:]], z[rows[:, 0]]
            length = np.linalg.norm(part, axis=1)
            left = (length > mu * np.maximum(normal, 0.0)) & (normal > 0)
            slope = np.where(left, mu / np.where(left, length, 1.0), 0.0)[:, None] * part
            columns = np.repeat(rows[:, :1], part.shape[1], axis=1)
            entries = (rows[:, 1:].ravel(), columns.ravel())
            result = result + sp.csr_array((slope.ravel(), entries), shape=(n, n))
    return sp.csr_array(result)


class NaturalNewton(ProjectionMethod):
    """Newton while it descends, extragradient steps in between."""

    aim = 1e-4
    field: VIConditions
    options: NaturalNewtonOptions

    def __init__(self, field: VIConditions, options: NaturalNewtonOptions, seed: int) -> None:
        super().__init__(field, options)
        self._rng = np.random.default_rng(seed)
        field.counters |= {"restarts": 0}

    def begin(self, z: Vector, F: Vector) -> None:
        self._first = z
        self._best = z, F, math.inf
        self._stand(z, F)

    def _stand(self, z: Vector, F: Vector) -> None:
        """Go on from a point as if nothing had been before."""
        self.z, self.F = z, F
        self._accepted, self._waiting, self._phase = math.inf, 0, FIRST_PHASE
        self._slow: Extragradient | None = None
        self._level, self._idle = math.inf, 0

    def step(self) -> bool:
        phi = self.field.defect(self.z, self.F)
        size = norm(phi)
        if size < self._best[2]:
            self._best = self.z, self.F, size
        self._idle += 1
        if size < 0.9 * self._level:
            self._level, self._idle = size, 0
        if self._idle > PATIENCE and self.elsewhere():
            return True
        if self._waiting == 0:
            moved = self._newton(phi, min(self._accepted, size))
            if moved is not None:
                self.z, self.F, self._accepted = moved
                self._slow = None
                return True
            self._waiting, self._phase = self._phase, 2 * self._phase
        self._waiting -= 1
        if self._slow is None:
            self._slow = Extragradient(self.field, ExtragradientOptions())
            self._slow.begin(self.z, self.F)
        if not self._slow.step():
            return self.elsewhere()
        self.z, self.F = self._slow.z, self._slow.F
        return True

    def elsewhere(self) -> bool:
        """Stand at another start, at the best point when there were enough of them; False when that was done too."""
        done = self.field.counters["restarts"]
        if done > self.options.restarts:
            return False
        self.field.counters["restarts"] = done + 1
        start = self._drawn() if done < self.options.restarts else None
        self._stand(*(start or self._best[:2]))
        return True

    def _drawn(self) -> tuple[Vector, Vector] | None:
        """Return a point where F is finite, multipliers 0, and F there; around the first start and around 0 in turn."""
        first = np.where(np.arange(self._first.size) < self.field.n, self._first, 0.0)
        size = np.where(np.arange(first.size) < self.field.n, np.maximum(1.0, np.abs(first)), 0.0)
        for draw in range(DRAWS):
            shift = 10.0 ** self._rng.uniform(*SPREAD) * size * self._rng.standard_normal(first.size)
            centre = first if draw % 2 else np.zeros(first.size)
            z = self.field.project(centre + shift, first)
            F = self.field.F(z)
            if np.isfinite(F).all():
                return z, F
        return None

    def _newton(self, phi: Vector, goal: float) -> tuple[Vector, Vector, float] | None:
        """Return the next x, E there and ‖Φ‖, which is below `goal`; None when no step does it."""
        derivative = self.field.derivative(self.z)
        if derivative is None:
            return None
        for d in self._directions(derivative, phi):
            for t in LENGTHS:
                x = self.z + t * d
                E = self.field.F(x)
                size = norm(self.field.defect(x, E))
                if size <= (1.0 - DESCENT * t) * goal:
                    return x, E, size
        return None

    def _directions(self, derivative: Sparse, phi: Vector) -> Iterator[Vector]:
        size = norm(phi)
        J, moving = self.field.projection(self.z - self.F, self.z)
        eye = sp.eye_array(self.z.size, format="csr")
        V = eye - J @ (eye - derivative) - moving
        for share, power in EPSILON:
            d = self._solved(sp.csr_array(V + min(share * size**power, 1.0) * J if share else V), -phi)
            if d is not None:
                yield d
        V = sp.csr_array(V)
        normal, right = sp.csr_array(V.T @ V), -(V.T @ phi)
        top = float(np.abs(normal.data).max(initial=0.0))
        for damping in DAMPING:
            d = self._solved(sp.csr_array(normal + damping * top * eye), right)
            if d is not None:
                yield d

    def _solved(self, A: Sparse, b: Any) -> Vector | None:
        """Return A⁻¹b, None where A is singular, be it to rounding: its kernel would make multipliers of any size."""
        self.field.counters["factorizations"] += 1
        with np.errstate(all="ignore"):
            factors = Factorization(A)
            if factors.singular:
                return None
            d = factors.solve(b)
        return d if np.isfinite(d).all() else None
