"""The linear conditions that every solution of a problem meets.

The size of a connected part of a problem: its largest side that 0 does not meet, in units in which rows and columns
have a mean of one.

Sides that 0 meets (limits that are never reached, mostly) count by IDLE. A row or an unknown without entries has no
such unit, and is compared with all sides and bounds as they are written.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from cpbench.formulations.base import Problem
from cpbench.formulations.conic import ConeQP
from cpbench.formulations.linear import AVI, LCP, MLCP
from cpbench.formulations.local_contact import FrictionContact
from cpbench.formulations.programs import QP
from cpbench.foundation import matrices
from cpbench.foundation.cones import Cone
from cpbench.foundation.matrices import Matrix, Vector
from cpbench.verification.equilibration import equilibrate_apart
from cpbench.verification.sets import INFINITE

ROUNDING = 1e-9
"""Share of the terms of a condition by which a point may miss it: the accuracy of linear programs, and no more."""


REACH = 10.0
"""Sizes up to which solutions are excluded of problems near the one asked. Those of 60 of 63 programs by Maros and
Mészáros (1999) are within."""
IDLE = 1e-6
"""Share by which a side counts that 0 meets: a contradiction of 1e-12 of it is one of 1e-6 at most."""


@dataclass(frozen=True, eq=False)
class Sizes:
    """The size of the part of every row (m,) and of every unknown (n,), each in its own unit.

    `reach` (n,) is the |x_j| up to which solutions are excluded: REACH sizes, or what bounds leave when they change.
    """

    rows: Vector
    unknowns: Vector
    reach: Vector

    @classmethod
    def of(cls, rows: Matrix, low: Vector, high: Vector, count: int) -> Sizes:
        """Measure low ≤ (rows·x, x) ≤ high, (m + n,), where sides may be infinite; the first rows (`count`) are
        conditions, the others set sizes alone.

        A part of which all sides are 0 has the size 1, in units of its own.
        """
        A: Any = abs(sp.csr_array(rows))
        m, n = A.shape
        _, part = connected_components(sp.block_array([[None, A], [A.T, None]]) if m else sp.csr_array((n, n)))
        with np.errstate(all="ignore"):  # beside subnormal numbers units are infinite
            D, C = equilibrate_apart(A)
            unit = np.concatenate([D, 1.0 / C])
            met = np.maximum(*(np.where(np.isfinite(side), np.abs(side), 0.0) for side in (low, high)))
            size = np.maximum(np.maximum(low, -high), IDLE * met)
            largest = np.zeros(m + n)
            np.maximum.at(largest, part, size * unit)
            sizes = np.where(largest > 0.0, largest, 1.0)[part] / unit
        empty = np.concatenate([A.sum(axis=1), A.sum(axis=0)]) == 0.0
        sizes[empty] = np.delete(size, np.arange(count, m)).max(initial=0.0) or 1.0
        sizes = np.nan_to_num(sizes, posinf=1e300)
        ends = np.maximum(np.abs(low[m:]), np.abs(high[m:]))
        return cls(sizes[:count], sizes[m:], np.minimum(REACH * sizes[m:], 2.0 * ends + sizes[m:]))


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
    def sizes(self) -> Sizes:
        """Sizes of (Gx ≥ h, Ex = f) and of x."""
        if self.known_sizes is not None:
            return self.known_sizes
        equal = [(self.E, self.f), *([] if self.further is None else [self.further])]
        rows = sp.vstack([sp.csr_array(matrix) for matrix in (self.G, *(matrix for matrix, _ in equal))], format="csr")
        low = np.concatenate([self.h, *(side for _, side in equal), self.lb])
        high = np.concatenate([np.full(self.h.size, np.inf), *(side for _, side in equal), self.ub])
        return Sizes.of(rows, low, high, self.h.size + self.f.size)

    def contains(self, x: Vector) -> bool:
        """Return whether x meets every condition to rounding (ROUNDING of its terms)."""
        if x.shape != self.lb.shape or not np.isfinite(x).all():
            return False
        with np.errstate(invalid="ignore"):
            over, off = self.G @ x - self.h, np.abs(self.E @ x - self.f)
            small = ROUNDING * np.abs(x)
            return bool(
                (
                    over >= -ROUNDING * (abs(self.G) @ np.abs(x) + np.where(np.isfinite(self.h), np.abs(self.h), 0.0))
                ).all()
                and (off <= ROUNDING * (abs(self.E) @ np.abs(x) + np.abs(self.f))).all()
                and ((x >= self.lb - small) & (x <= self.ub + small)).all()
            )

    @property
    def recession(self) -> Polyhedron:
        """The directions that, from any point within, never leave: every finite side and bound is 0."""
        sides = (np.where(np.isfinite(side), 0.0, side) for side in (self.h, self.f, self.lb, self.ub))
        h, f, lb, ub = sides
        return replace(self, h=h, f=f, lb=lb, ub=ub, further=None)


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
        polyhedron = _over(problem.A, problem.b, problem.C, problem.d, problem.lb, problem.ub)
        return replace(polyhedron, further=(problem.Q, problem.p))
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
    polyhedron = conditions(problem)
    if polyhedron is None or certificate is None or certificate.size != polyhedron.h.size + polyhedron.f.size:
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
    position = np.arange(n)
    normal, tangent = position[::d], position[position % d > 0]
    contact, count = tangent // d, np.arange(tangent.size)
    shape = (tangent.size, n)
    friction = sp.csr_array((problem.mu[contact], (count, contact * d)), shape=shape)
    force = sp.csr_array((np.ones(tangent.size), (count, tangent)), shape=shape)
    W = matrices.sparse(problem.W)
    rows: Matrix = sp.csr_array(sp.vstack([W[normal], friction - force, friction + force], format="csr"))
    sides = np.concatenate([-problem.q[normal], np.zeros(2 * tangent.size)])
    lb = np.where(position % d == 0, 0.0, -np.inf)
    polyhedron = _over(rows, sides, None, None, lb, np.full(n, np.inf), "r")
    return replace(polyhedron, further=(W[tangent], problem.q[tangent]))


def _coneqp(problem: ConeQP) -> Polyhedron | None:
    """Ax + b ∈ K where K is a polyhedron: {0}, ℝ, ℝ₊."""
    if not np.isin(problem.cone_kind, (Cone.ZERO, Cone.FREE, Cone.NONNEGATIVE)).all():
        return None
    kind = np.repeat(problem.cone_kind, problem.cone_size.astype(np.int64))
    signed, level = np.flatnonzero(kind == Cone.NONNEGATIVE), np.flatnonzero(kind == Cone.ZERO)
    n, A, b = problem.p.size, problem.A, problem.b
    free = np.full(n, np.inf)
    polyhedron = _over(A[signed], -b[signed], A[level], -b[level], -free, free, "x")
    return replace(polyhedron, further=(problem.Q, problem.p))
