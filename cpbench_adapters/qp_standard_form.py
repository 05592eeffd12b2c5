"""A QP as the backends write it, and their multipliers as we write them.

qpsolvers writes a QP as min ½xᵀPx + qᵀx subject to Gx ≤ h, Ax = b, lb ≤ x ≤ ub, with multipliers z ≥ 0, y and
z_box (positive at an upper bound) such that Px + q + Gᵀz + Aᵀy + z_box = 0. Ours is Az ≥ b, Cz = d and
Qz + p − Aᵀλ − Cᵀμ − ν = 0. So P = Q, q = p, G = −A, h = −b, and back λ = z, μ = −y, ν = −z_box.

Backends that know no bounds get the finite ones as rows of G, and a variable with lb = ub as a row of A (two
opposite inequalities have no interior, which interior-point methods need); ν is read from those rows.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.programs import QP, QPPoint
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Vector


@dataclass(frozen=True)
class StandardForm:
    """A QP as qpsolvers writes it, in the storage of one backend, and which rows stand for bounds."""

    P: Any
    q: Vector
    G: Any | None
    h: Vector | None
    A: Any | None
    b: Vector | None
    lb: Vector | None
    ub: Vector | None
    m: int
    k: int
    lower: Any = field(default_factory=lambda: np.zeros(0, dtype=int))
    upper: Any = field(default_factory=lambda: np.zeros(0, dtype=int))
    fixed: Any = field(default_factory=lambda: np.zeros(0, dtype=int))

    @cached_property
    def guest(self) -> Any:
        """The same as a qpsolvers.Problem."""
        import qpsolvers

        return qpsolvers.Problem(self.P, self.q, self.G, self.h, self.A, self.b, self.lb, self.ub)

    def point(self, x: Any, z: Any, y: Any, z_box: Any) -> QPPoint:
        """Return our point from a backend's answer and multipliers."""
        n, m, k = self.q.size, self.m, self.k
        nu = np.zeros(n)
        if self.lb is not None or self.ub is not None:
            nu -= np.asarray(z_box)
        if self.lower.size or self.upper.size:
            rows = np.asarray(z)[m:]
            nu[self.lower] += rows[: self.lower.size]
            nu[self.upper] -= rows[self.lower.size : self.lower.size + self.upper.size]
        if self.fixed.size:
            nu[self.fixed] = -np.asarray(y)[k:]
        lam = np.asarray(z)[:m] if m else np.zeros(0)
        mu = -np.asarray(y)[:k] if k else np.zeros(0)
        return QPPoint(z=np.asarray(x), lam=lam, mu=mu, nu=nu)


def standard_form(problem: QP, *, sparse: bool, bounds_as_rows: bool, needs_inequality: bool = False) -> StandardForm:
    """Convert `problem` for a backend: csc or dense writable copies, bounds apart or as rows.

    `needs_inequality` gives a problem without inequalities the void row 0ᵀx ≤ 1.
    """
    n, m, k = problem.p.size, problem.b.size, problem.d.size
    lower, upper, fixed = (np.zeros(0, dtype=int) for _ in range(3))
    lb = ub = None
    if bounds_as_rows:
        equal = problem.lb == problem.ub
        lower = np.flatnonzero(np.isfinite(problem.lb) & ~equal)
        upper = np.flatnonzero(np.isfinite(problem.ub) & ~equal)
        fixed = np.flatnonzero(equal)
    elif problem.has_bounds:
        lb, ub = problem.lb.copy(), problem.ub.copy()

    def unit(rows: Any, sign: float) -> Any:
        chosen = sp.csr_array((np.full(rows.size, sign), (np.arange(rows.size), rows)), shape=(rows.size, n))
        return chosen if sparse else chosen.toarray()

    def stack(blocks: list[Any]) -> Any | None:
        present = [_store(block, sparse) for block in blocks if block.shape[0]]
        if not present:
            return None
        return sp.csc_matrix(sp.vstack(present)) if sparse else np.vstack(present)

    G = stack([-problem.A, unit(lower, -1.0), unit(upper, 1.0)])
    h = np.concatenate([-problem.b, -problem.lb[lower], problem.ub[upper]])
    A = stack([problem.C, unit(fixed, 1.0)])
    b = np.concatenate([problem.d, problem.lb[fixed]])
    if needs_inequality and G is None and lb is None:
        G, h = _store(np.zeros((1, n)), sparse), np.ones(1)
    return StandardForm(
        P=_store(problem.Q, sparse),
        q=problem.p.copy(),
        G=G,
        h=None if G is None else h,
        A=A,
        b=None if A is None else b,
        lb=lb,
        ub=ub,
        m=m,
        k=k,
        lower=lower,
        upper=upper,
        fixed=fixed,
    )


def _store(M: Matrix, sparse: bool) -> Any:
    """Return `M` as a writable csc_matrix (qpsolvers looks for that very class) or a writable C-ordered array."""
    if sparse:
        return sp.csc_matrix(M, copy=True)
    return np.array(matrices.dense(M), order="C")
