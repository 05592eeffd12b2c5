"""Multipliers, points and rays in rational arithmetic, from approximate ones: rounded, and projected exactly on the
equalities that they meet to rounding."""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.foundation.matrices import Vector
from cpbench.proofs import hints
from cpbench.proofs.exact_linear import Exact, Rationals, rationals, rounded, solve
from cpbench.proofs.polyhedra import Polyhedron

ROUNDING = (1e-9, 1e-12, 1e-6)
"""What is this small among the terms it is made of may be meant to be 0."""
_ZERO = Fraction(0)


def exact_multipliers(known: Polyhedron, vector: Vector, deadline: float) -> Iterator[Rationals]:
    """Yield the vector as it is, rounded, and projected on the components of Gᵀλ + Eᵀμ that are 0 to rounding."""
    m = known.h.size
    y = vector.copy()
    y[:m] = np.where(np.isneginf(known.h), 0.0, np.maximum(y[:m], 0.0))
    if not y.any():
        return
    y = y / np.ldexp(1.0, math.frexp(float(np.abs(y).max()))[1])
    yield rationals(y)
    rows: Any = sp.vstack([sp.csr_array(known.G), sp.csr_array(known.E)], format="csr")
    sizes = np.asarray(abs(rows).max(axis=1).toarray()).ravel() if rows.nnz else np.ones(y.size)
    for rounding in ROUNDING:
        large = np.abs(y) * sizes > rounding * float((np.abs(y) * sizes).max(initial=0.0))
        support = np.flatnonzero(large | (np.arange(y.size) >= m) & (y != 0.0))
        kept = np.zeros_like(y)
        kept[support] = y[support]
        yield rounded(kept)
        nu, terms = rows.T @ kept, abs(rows).T @ np.abs(kept)
        boxed = np.isfinite(known.lb) & np.isfinite(known.ub)
        level = np.isneginf(known.lb) & np.isposinf(known.ub)
        tight = np.flatnonzero((terms > 0.0) & ~boxed & (level | (np.abs(nu) <= rounding * terms)))
        block = sp.csr_array(rows[support][:, tight].T)
        part = solve(block, [_ZERO] * tight.size, kept[support], deadline)
        if part is not None:
            whole = [_ZERO] * y.size
            for place, value in zip(support.tolist(), part, strict=True):
                whole[place] = value
            yield whole


def exact_point(known: Polyhedron, deadline: float) -> Rationals | None:
    """Return a point that meets all conditions exactly."""
    x = hints.interior_point(known, deadline)
    if x is None:
        return None
    G: Any = sp.csr_array(known.G)
    for rounding in (0.0, *ROUNDING):
        size = np.maximum(np.abs(x), max(float(np.abs(x).max(initial=0.0)), 1.0) * rounding)
        low = (known.lb == known.ub) | (x - known.lb <= rounding * size)
        high = ~low & (known.ub - x <= rounding * size)
        near = np.where(low, known.lb, np.where(high, known.ub, x))
        finite = np.isfinite(known.h)
        terms = abs(G) @ np.abs(near) + np.abs(np.where(finite, known.h, 0.0))
        active = np.flatnonzero(finite & (G @ near - known.h <= rounding * terms) & (rounding > 0.0))
        right = rationals(np.concatenate([known.f, known.h[active]]))
        point = _solved(known, active, right, near, low | high, deadline)
        if point is not None and known.contains(point):
            return point
    return None


def exact_rays(known: Polyhedron, direction: Vector, deadline: float) -> Iterator[Rationals]:
    """Yield the direction projected on the equalities that it meets to rounding."""
    G: Any = sp.csr_array(known.G)
    d = direction / np.ldexp(1.0, math.frexp(float(np.abs(direction).max()))[1])
    for rounding in ROUNDING:
        zero = np.abs(d) <= rounding
        near = np.where(zero, 0.0, d)
        active = np.flatnonzero(np.isfinite(known.h) & (G @ near <= rounding * (abs(G) @ np.abs(near))))
        ray = _solved(known, active, [_ZERO] * (known.f.size + active.size), near, zero, deadline)
        if ray is not None:
            yield ray


def _solved(
    known: Polyhedron, active: Any, right: Rationals, near: Vector, fixed: Any, deadline: float
) -> Rationals | None:
    """Return an exact x near `near` with Ex and the active rows of Gx equal to `right`.

    Where `fixed`, x is what `near` is.
    """
    rows: Any = sp.vstack([sp.csr_array(known.E), sp.csr_array(known.G)[active]], format="csr")
    kept, free = np.flatnonzero(fixed), np.flatnonzero(~fixed)
    held = rationals(near)
    if kept.size:
        there = Exact.of(rows[:, kept]).times([held[j] for j in kept.tolist()])
        right = [b - a for a, b in zip(there, right, strict=True)]
    part = solve(rows[:, free], right, near[free], deadline)
    if part is None:
        return None
    for place, value in zip(free.tolist(), part, strict=True):
        held[place] = value
    return held
