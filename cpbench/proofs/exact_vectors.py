"""Multipliers and points in rational arithmetic, from approximate ones: rounded, and projected exactly on the
equalities that they meet to rounding."""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.foundation.matrices import Vector
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


def exact_point(known: Polyhedron, x: Vector, deadline: float) -> Rationals | None:
    """Return a point near x that meets all conditions exactly; with those that x meets to rounding as equalities."""
    G: Any = sp.csr_array(known.G)
    for rounding in (0.0, *ROUNDING):
        size = np.maximum(np.abs(x), max(float(np.abs(x).max(initial=0.0)), 1.0) * rounding)
        low = (known.lb == known.ub) | (x - known.lb <= rounding * size)
        high = ~low & (known.ub - x <= rounding * size)
        near = np.where(low, known.lb, np.where(high, known.ub, x))
        finite, fixed = np.isfinite(known.h), low | high
        terms = abs(G) @ np.abs(near) + np.abs(np.where(finite, known.h, 0.0))
        active = np.flatnonzero(finite & (G @ near - known.h <= rounding * terms) & (rounding > 0.0))
        rows: Any = sp.vstack([sp.csr_array(known.E), G[active]], format="csr")
        point, free = rationals(near), np.flatnonzero(~fixed)
        held = Exact.of(rows[:, fixed]).times([point[j] for j in np.flatnonzero(fixed).tolist()])
        right = [b - a for a, b in zip(held, rationals(np.concatenate([known.f, known.h[active]])), strict=True)]
        part = solve(rows[:, free], right, near[free], deadline)
        if part is None:
            continue
        for place, value in zip(free.tolist(), part, strict=True):
            point[place] = value
        if known.contains(point):
            return point
    return None
