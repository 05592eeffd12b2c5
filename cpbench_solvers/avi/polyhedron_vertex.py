"""A vertex of {z : Az ≥ b, Cz = d, lb ≤ z ≤ ub} and a basis of its conditions there, whatever the map M.

At a vertex as many independent constraints hold with equality as there are unknowns. With N the unknowns between
their bounds, J the rows of A and E the rows of C that are needed for that, the matrix

    [ M_NN  −A_JNᵀ  −C_ENᵀ ]
    [ A_JN     0       0   ]
    [ C_EN     0       0   ]

is regular because its lower left part is square and regular (Cao and Ferris 1996, section 3). Where the set contains
lines there is no vertex: N has more unknowns than rows, and M must be regular on the lines.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

from cpbench.foundation.matrices import Dense, Vector, max_abs
from cpbench_solvers import linear_program

ACTIVE = 1e-9
"""A constraint holds with equality where it has less room, relative to the size of the vertex."""
RANK = 1e-10
"""Pivots of a QR factorization up to this share of the largest entry are 0."""


@dataclass(frozen=True)
class ScaledPolyhedron:
    """{z : Az ≥ b, Cz = d, lb ≤ z ≤ ub} with lb < ub, dense, rows and unknowns scaled to size one."""

    A: Dense
    b: Vector
    C: Dense
    d: Vector
    lb: Vector
    ub: Vector

    def vertex(self, cost: Vector) -> Vector | None:
        """Return a vertex of least costᵀz, or any where that has no end; None where the simplex method finds none."""
        n = cost.size
        if not n or not (self.b.size or self.d.size):
            return np.clip(np.where(cost < 0, self.ub, self.lb), *_finite(self.lb, self.ub))
        if (corner := self._corner(cost)) is not None:
            return corner
        finite = np.concatenate([self.b, self.d, *(x[np.isfinite(x)] for x in (self.lb, self.ub))])
        unit = max_abs(finite) or 1.0
        for c in (cost / (max_abs(cost) or 1.0), np.zeros(n)):
            program = linear_program.linprog(
                c,
                A_ub=-self.A if self.b.size else None,
                b_ub=-self.b / unit if self.b.size else None,
                A_eq=self.C if self.d.size else None,
                b_eq=self.d / unit if self.d.size else None,
                bounds=np.column_stack([self.lb, self.ub]) / unit,
                method="highs-ds",
                options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
            )
            if program.status == 0:
                return self._purified(np.clip(unit * program.x, self.lb, self.ub))
        return None

    def _corner(self, cost: Vector) -> Vector | None:
        """Return the point of the bounds, and of the rows that are bounds, where costᵀz is least; None where it is at
        infinity or misses another row. It is a vertex of a set around this one."""
        lb, ub = self.lb.copy(), self.ub.copy()
        row = np.flatnonzero(np.count_nonzero(self.A, axis=1) == 1)
        at = np.argmax(self.A[row] != 0.0, axis=1)
        entry = self.A[row, at]
        side, lower = self.b[row] / entry, entry > 0.0
        np.maximum.at(lb, at[lower], side[lower])
        np.minimum.at(ub, at[~lower], side[~lower])
        z = np.where((cost < 0.0) & np.isfinite(ub) | ~np.isfinite(lb), ub, lb)
        if not np.isfinite(z).all() or (z < lb).any() or (z > ub).any():
            return None
        allowed = ACTIVE * (1.0 + max_abs(z))
        inside = (self.A @ z - self.b >= -allowed).all() and (np.abs(self.C @ z - self.d) <= allowed).all()
        return z if inside else None

    def _purified(self, z: Vector) -> Vector:
        """Return a vertex, but for the lines in the set: a basic solution may have unknowns without bounds anywhere."""
        bounded = np.eye(z.size)[np.isfinite(self.lb) | np.isfinite(self.ub)]
        top = max(max_abs(self.A), 1.0)
        for _ in range(z.size):
            N, _, E = self.basis(z)
            active = self.A @ z - self.b <= ACTIVE * (1.0 + max_abs(z))
            N &= (z - self.lb > 0.0) & (self.ub - z > 0.0)
            held = np.vstack([self.C[np.ix_(E, N)], self.A[np.ix_(active, N)]])
            directions = np.eye(z.size)[:, N] @ _null_space(held[_independent(held.T)])
            changes = np.vstack([self.A, bounded]) @ directions
            if max_abs(changes) <= RANK * top:
                return z
            direction = directions @ changes[int(np.abs(changes).max(axis=1).argmax())]
            forth, back = self._room(z, direction), self._room(z, -direction)
            z = np.clip(z + (forth if forth <= back else -back) * direction, self.lb, self.ub)
        return z

    def _room(self, z: Vector, direction: Vector) -> float:
        """Return how far z can go: to the first bound or row, ∞ without one."""
        speed = np.concatenate([direction, -direction, -(self.A @ direction)])
        room = np.concatenate([self.ub - z, z - self.lb, self.A @ z - self.b])
        ahead = speed > RANK * max_abs(direction)
        return float((np.maximum(room[ahead], 0.0) / speed[ahead]).min(initial=np.inf))

    def basis(self, z: Vector) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.bool_]]:
        """Return N (n,), J (m,) and E (k,) at a vertex z."""
        near = ACTIVE * (1.0 + max_abs(z))
        N = (z - self.lb > near) & (self.ub - z > near)
        C = self.C
        if self.d.size:  # unknowns at a bound come in where those between are not enough for the rows of C
            held = np.flatnonzero(~N)
            rest = C[:, held]
            span = _independent(C[:, N])
            if span.size:
                Q = np.linalg.qr(C[:, np.flatnonzero(N)[span]])[0]
                rest = rest - Q @ (Q.T @ rest)
            N[held[_independent(rest, max_abs(C))]] = True
        E = _marked(self.d.size, _independent(C[:, N].T))
        active = np.flatnonzero(self.A @ z - self.b <= near)
        lines = _null_space(C[np.ix_(E, N)])
        J = _marked(self.b.size, active[_independent((self.A[np.ix_(active, N)] @ lines).T)])
        return N, J, E


def _finite(lb: Vector, ub: Vector) -> tuple[Vector, Vector]:
    """Return bounds that keep a point finite: the other bound, or 0, in the place of an infinite one."""
    low = np.where(np.isfinite(lb), lb, np.where(np.isfinite(ub), ub, 0.0))
    return low, np.where(np.isfinite(ub), ub, low)


def _independent(A: Dense, size: float = 0.0) -> NDArray[np.intp]:
    """Return independent columns, as many as there are; `size` of the entries that A is a difference of."""
    if not A.size:
        return np.zeros(0, np.intp)
    R, order = qr(A, mode="r", pivoting=True)
    pivots = np.abs(np.diagonal(R))
    return np.asarray(order[: int((pivots > RANK * max(float(pivots[0]), size)).sum())], np.intp)


def _null_space(A: Dense) -> Dense:
    """Return an orthonormal basis of {v : Av = 0}, A of full row rank, as columns."""
    if not A.shape[0]:
        return np.eye(A.shape[1])
    return np.linalg.qr(A.T, mode="complete")[0][:, A.shape[0] :]


def _marked(size: int, members: NDArray[np.intp]) -> NDArray[np.bool_]:
    result = np.zeros(size, dtype=bool)
    result[members] = True
    return result
