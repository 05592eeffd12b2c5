"""The linear conditions that every solution of a problem meets, and exact sums over them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.base import Problem
from cpbench.formulations.conic import ConeQP
from cpbench.formulations.linear import AVI, LCP, MLCP
from cpbench.formulations.local_contact import FrictionContact
from cpbench.formulations.programs import QP
from cpbench.foundation import matrices
from cpbench.foundation.cones import Cone
from cpbench.foundation.matrices import Matrix, Vector
from cpbench.proofs.exact_linear import Exact, dot, rationals
from cpbench.proofs.part_sizes import Sizes
from cpbench.verification.sets import INFINITE

_ZERO = Fraction(0)


@dataclass(frozen=True, eq=False)
class Polyhedron:
    """Gx ≥ h, Ex = f, lb ≤ x ≤ ub; sides and bounds may be infinite.

    `unknowns` is what x is called. `further` are rows and sides that are no conditions, and yet set the size of
    solutions: Qx + p of a program, the tangential velocities of contacts. `known_sizes` are those of problems that are
    not measured by their own sides.
    """

    G: Matrix
    h: Vector
    E: Matrix
    f: Vector
    lb: Vector
    ub: Vector
    unknowns: str = "z"
    further: tuple[Matrix, Vector] | None = None
    known_sizes: Sizes | None = None

    @cached_property
    def exact(self) -> tuple[Exact, Exact]:
        """G and E as integers."""
        return Exact.of(self.G), Exact.of(self.E)

    @cached_property
    def sizes(self) -> Sizes:
        """Sizes of (Gx ≥ h, Ex = f) and of x."""
        if self.known_sizes is not None:
            return self.known_sizes
        equal = [(self.E, self.f), *([] if self.further is None else [self.further])]
        rows = sp.vstack([sp.csr_array(matrix) for matrix in (self.G, *(matrix for matrix, _ in equal))], format="csr")
        low = np.concatenate([self.h, *(side for _, side in equal), self.lb])
        high = np.concatenate([np.full(self.h.size, np.inf), *(side for _, side in equal), self.ub])
        return Sizes.of(rows, low, high, self.h.size + self.f.size)

    def contains(self, x: Sequence[Fraction]) -> bool:
        """Return whether x meets every condition exactly."""
        rows, equalities = self.exact
        return (
            len(x) == self.lb.size
            and all(a >= b for a, b in zip(rows.times(x), self.h.tolist(), strict=True))
            and all(a == b for a, b in zip(equalities.times(x), self.f.tolist(), strict=True))
            and all(a <= b <= c for a, b, c in zip(self.lb.tolist(), x, self.ub.tolist(), strict=True))
        )

    @property
    def recession(self) -> Polyhedron:
        """The directions that, from any point within, never leave: every finite side and bound is 0."""
        sides = (np.where(np.isfinite(side), 0.0, side) for side in (self.h, self.f, self.lb, self.ub))
        h, f, lb, ub = sides
        return replace(self, h=h, f=f, lb=lb, ub=ub, further=None)

    def combined(self, y: Sequence[Fraction]) -> tuple[Fraction, Fraction, Fraction] | None:
        """Return γ, ε and δ with γ ≤ ε‖x‖∞ for every x within, by the multipliers y = (λ of Gx ≥ h, μ of Ex = f).

        With ν = −Gᵀλ − Eᵀμ, −νᵀx ≥ hᵀλ + fᵀμ; where a bound goes with the sign of ν_j it replaces x_j, which adds up to
        γ, and ε is the sum of the other |ν_j|. By δ·t γ may change in problems within t (`margins`): with b the sides
        and bounds that go with (y, ν), s their sizes and R the reach, δ = Σ|y_i|(|b_i| + s_i) + Σ|ν_j|(|b_j| + s_j) +
        (|λ|ᵀ|G| + |μ|ᵀ|E|)R. None where y is no such vector: λ ≥ 0, and 0 at infinite sides.
        """
        m = self.h.size
        if len(y) != m + self.f.size:
            return None
        if any(v < 0 or (v and b == -math.inf) for v, b in zip(y[:m], self.h.tolist(), strict=True)):
            return None
        parts = list(zip(self.exact, (y[:m], y[m:]), strict=True))
        nu = [-a - b for a, b in zip(*(matrix.transposed_times(part) for matrix, part in parts), strict=True)]
        bounds = [low if v > 0 else high for v, low, high in zip(nu, self.lb.tolist(), self.ub.tolist(), strict=True)]
        gamma = excess = change = _ZERO
        sides, sizes = [*self.h.tolist(), *self.f.tolist(), *bounds], [*self.sizes.rows, *self.sizes.unknowns]
        for v, side, size in zip([*y, *nu], sides, sizes, strict=True):
            if v and math.isinf(side):
                excess += abs(v)
            elif v:
                gamma += v * Fraction(side)
                change += abs(v) * (abs(Fraction(side)) + Fraction(size))
        far = rationals(self.sizes.reach)
        change += sum(dot([abs(v) for v in part], matrix.absolute().times(far)) for matrix, part in parts)
        return gamma, excess, change


@dataclass(frozen=True, eq=False)
class Objective:
    """½xᵀQx + pᵀx."""

    Q: Matrix
    p: Vector


def conditions(problem: Problem) -> Polyhedron | None:
    """Linear conditions that every solution meets, None where no rule is known.

    Those of a program are all its constraints, those of an AVI are in (z, λ, μ), its multipliers, and those of contacts
    are u_N ≥ 0 and |r_T| ≤ μ r_N by components.
    """
    if isinstance(problem, LCP):
        n = problem.q.size
        return _over(problem.M, -problem.q, None, None, np.zeros(n), np.full(n, np.inf))
    if isinstance(problem, MLCP):
        free, signed = problem.a.size, problem.b.size
        lb = np.concatenate([np.full(free, -np.inf), np.zeros(signed)])
        G, E = matrices.block([[problem.D, problem.B]]), matrices.block([[problem.A, problem.C]])
        return _over(G, -problem.b, E, -problem.a, lb, np.full(free + signed, np.inf), "(u, v)")
    if isinstance(problem, QP):
        known = _over(problem.A, problem.b, problem.C, problem.d, problem.lb, problem.ub)
        return replace(known, further=(problem.Q, problem.p))
    if isinstance(problem, AVI):
        return _avi(problem)
    if isinstance(problem, FrictionContact):
        return _contact(problem)
    return _coneqp(problem) if isinstance(problem, ConeQP) else None


def objective(problem: Problem) -> Objective | None:
    """Return what a program minimises over its conditions; None for other problems."""
    return Objective(problem.Q, problem.p) if isinstance(problem, QP | ConeQP) else None


def multipliers(problem: Problem, certificate: Vector | None) -> list[Vector]:
    """Return a solver's vector, in the order of its node, in the order of the conditions; none of another size or with
    numbers that are not finite."""
    known = conditions(problem)
    if known is None or certificate is None or certificate.size != known.h.size + known.f.size:
        return []
    n = problem.a.size if isinstance(problem, MLCP) else 0  # (y of the equalities, z of the rows)
    return [np.roll(certificate, -n)] if np.isfinite(certificate).all() else []


def _over(
    G: Matrix, h: Vector, E: Matrix | None, f: Vector | None, lb: Vector, ub: Vector, unknowns: str = "z"
) -> Polyhedron:
    return Polyhedron(
        G,
        np.where(h <= -INFINITE, -np.inf, h),
        matrices.zeros(0, lb.size, G) if E is None else E,
        np.zeros(0) if f is None else f,
        np.where(lb <= -INFINITE, -np.inf, lb),
        np.where(ub >= INFINITE, np.inf, ub),
        unknowns,
    )


def _avi(problem: AVI) -> Polyhedron:
    """Return z within, λ ≥ 0, and F = Mz + q − Aᵀλ − Cᵀμ: ≥ 0 (≤ 0) where z_j has a lower (upper) bound only, 0
    without."""
    m, k = problem.b.size, problem.d.size
    low, high = problem.lb > -INFINITE, problem.ub < INFINITE
    force = matrices.block([[problem.M, -matrices.transpose(problem.A), -matrices.transpose(problem.C)]])
    above, below, level = (np.flatnonzero(at) for at in (low & ~high, high & ~low, ~low & ~high))
    rows = matrices.block([[problem.A, matrices.zeros(m, m + k, problem.M)]])
    equalities = matrices.block([[problem.C, matrices.zeros(k, m + k, problem.M)]])
    return _over(
        matrices.block([[rows], [force[above]], [-force[below]]]),
        np.concatenate([problem.b, -problem.q[above], problem.q[below]]),
        matrices.block([[equalities], [force[level]]]),
        np.concatenate([problem.d, -problem.q[level]]),
        np.concatenate([problem.lb, np.zeros(m), np.full(k, -np.inf)]),
        np.concatenate([problem.ub, np.full(m + k, np.inf)]),
        "(z, λ, μ)",
    )


def _contact(problem: FrictionContact) -> Polyhedron:
    n, d = problem.q.size, problem.dimension
    place = np.arange(n)
    normal, tangent = place[::d], place[place % d > 0]
    contact, count = tangent // d, np.arange(tangent.size)
    shape = (tangent.size, n)
    friction = sp.csr_array((problem.mu[contact], (count, contact * d)), shape=shape)
    force = sp.csr_array((np.ones(tangent.size), (count, tangent)), shape=shape)
    W = matrices.sparse(problem.W)
    rows: Matrix = sp.csr_array(sp.vstack([W[normal], friction - force, friction + force], format="csr"))
    sides = np.concatenate([-problem.q[normal], np.zeros(2 * tangent.size)])
    lb = np.where(place % d == 0, 0.0, -np.inf)
    known = _over(rows, sides, None, None, lb, np.full(n, np.inf), "r")
    return replace(known, further=(W[tangent], problem.q[tangent]))


def _coneqp(problem: ConeQP) -> Polyhedron | None:
    """Ax + b ∈ K where K is a polyhedron: {0}, ℝ, ℝ₊."""
    if not np.isin(problem.cone_kind, (Cone.ZERO, Cone.FREE, Cone.NONNEGATIVE)).all():
        return None
    kind = np.repeat(problem.cone_kind, problem.cone_size.astype(np.int64))
    signed, level = np.flatnonzero(kind == Cone.NONNEGATIVE), np.flatnonzero(kind == Cone.ZERO)
    n, A, b = problem.p.size, problem.A, problem.b
    free = np.full(n, np.inf)
    known = _over(A[signed], -b[signed], A[level], -b[level], -free, free, "x")
    return replace(known, further=(problem.Q, problem.p))
