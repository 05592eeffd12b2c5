"""Natural maps x − P_K(x − w) of the factors of a product, without forming x − w where that would lose x or w.

A tiny reaction beside a huge force, or the other way round, is gone in x − w. Each component is therefore written as x
less its part of the projection, or as w plus what is cut off, whichever changes it less; and how far y = x − w is
outside of K is summed from the largest terms on, with ‖y_T‖ = L + ΔL, L the larger of ‖x_T‖ and ‖w_T‖ and
ΔL = (‖y_T‖² − L²)/(‖y_T‖ + L).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cpbench.foundation.matrices import Dense, Vector
from cpbench.foundation.product_cones import Cone, ProductCone

COMPARABLE = 1e-3
"""Parts of x and w of a factor whose sizes differ by less lose no digits that matter; 0 loses none at all."""


def cone_defect(K: ProductCone, x: Vector, w: Vector) -> Vector:
    """Return x − P_K(x − w), shape (rows,)."""
    result = x - K.project(x - w)
    for kind, rows, mu, mu_r in K.groups:
        a, b = x[rows], w[rows]
        if kind in (Cone.ZERO, Cone.FREE, Cone.NONNEGATIVE):
            result[rows] = _factor(kind, a, b, mu, mu_r)
            continue
        sizes = np.abs(a).max(axis=1, initial=0.0), np.abs(b).max(axis=1, initial=0.0)
        least = np.minimum(*sizes)
        apart = (least < COMPARABLE * np.maximum(*sizes)) & (least > 0)
        if apart.any():
            result[rows[apart]] = _factor(kind, a[apart], b[apart], mu[apart], mu_r[apart])
    return result


def _factor(kind: Cone, x: Dense, w: Dense, mu: Vector, mu_r: Vector) -> Dense:
    """Return x − P(x − w) of the factors of one kind and size, shape (count, size)."""
    match kind:
        case Cone.ZERO:
            return x
        case Cone.FREE:
            return w
        case Cone.NONNEGATIVE:
            return np.minimum(x, w)
        case Cone.SECOND_ORDER:
            half_space = np.isinf(mu)
            result = _clipped(x, w, [(slice(1, None), np.where(half_space, 1.0, mu))])
            result[half_space, 0] = np.minimum(x[half_space, 0], w[half_space, 0])
            result[half_space, 1:] = w[half_space, 1:]
            return result
        case Cone.ROLLING:
            return _clipped(x, w, _moments(x, mu, mu_r))
        case Cone.ROLLING_DUAL:  # Moreau: x − P_K*(x − w) = w − P_K(w − x)
            return _clipped(w, x, _moments(x, mu, mu_r))
        case Cone.CYLINDER:
            return np.column_stack([np.minimum(x[:, 0], w[:, 0]), _disk(x[:, 1:], w[:, 1:], mu)])
        case Cone.BALL:
            return _disk(x, w, mu)


def _moments(x: Dense, mu: Vector, mu_r: Vector) -> list[tuple[slice, Vector]]:
    k = (x.shape[1] - 1) // 2
    return [(slice(1, 1 + k), mu), (slice(1 + k, None), mu_r)]


@dataclass(frozen=True)
class _Part:
    """Columns c of x − w, at most μ r_N long in K: their direction and ‖y_c‖ = L + ΔL, each shape (count,)."""

    columns: slice
    mu: Vector
    direction: Dense
    L: Vector
    gain: Vector

    @classmethod
    def of(cls, x: Dense, w: Dense, columns: slice, mu: Vector) -> _Part:
        a, b = x[:, columns], w[:, columns]
        y = a - b
        sizes = [np.sqrt(np.einsum("ij,ij->i", part, part)) for part in (a, b, y)]
        swap = sizes[1] > sizes[0]
        L, other = np.where(swap, sizes[1], sizes[0]), np.where(swap[:, None], a, b)
        # ‖y‖² − L² = o·(o − 2·the longer), o the shorter one
        change = np.einsum("ij,ij->i", other, other - 2.0 * np.where(swap[:, None], b, a))
        total = sizes[2] + L
        direction = y / np.where(sizes[2] > 0, sizes[2], 1.0)[:, None]
        return cls(columns, mu, direction, L, np.divide(change, total, out=np.zeros_like(L), where=total > 0))

    def defect(self, x: Dense, w: Dense, length: Vector, over: Vector) -> Dense:
        """Return where y_c is longer than `length` by `over`; w where over ≤ 0."""
        cut = w + np.maximum(over, 0.0)[:, None] * self.direction
        return np.where((length < over)[:, None], x - length[:, None] * self.direction, cut)


def _clipped(x: Dense, w: Dense, groups: list[tuple[slice, Vector]]) -> Dense:
    """Return {r : ‖r_c‖ ≤ μ_c r_N for one or two groups c}, as `cones.project_rolling_cone`.

    With e_c = ‖y_c‖ − μ_c y_N the projection raises y_N by g, the root of g = Σ μ_c(e_c − μ_c g)₊.
    """
    parts = [_Part.of(x, w, columns, mu) for columns, mu in groups]
    xn, wn = x[:, 0], w[:, 0]
    e = [_sum(p.L, p.gain, -p.mu * xn, p.mu * wn) for p in parts]
    active = _active([p.mu for p in parts], e)
    mus = [np.where(on, p.mu, 0.0) for p, on in zip(parts, active, strict=True)]
    D = 1.0 + sum(mu**2 for mu in mus)
    raised = sum(mu * e_c for mu, e_c in zip(mus, e, strict=True)) / D
    terms = [term for mu, p in zip(mus, parts, strict=True) for term in (mu * p.L, mu * p.gain)]
    rn = _sum(xn, -wn, *terms) / D
    result = np.empty_like(x)
    result[:, 0] = np.where(rn < raised, xn - rn, wn - raised)
    for c, p in enumerate(parts):
        others = [k for k in range(len(parts)) if k != c]
        over = e[c] * (1.0 + sum(mus[k] ** 2 for k in others)) - p.mu * sum(mus[k] * e[k] for k in others)
        # what is not active may be too long by rounding only
        over = np.where(active[c], over / (1.0 + p.mu**2 + sum(mus[k] ** 2 for k in others)), 0.0)
        result[:, p.columns] = p.defect(x[:, p.columns], w[:, p.columns], p.mu * rn, over)
    return np.where((rn <= 0.0)[:, None], x, result)


def _active(mus: list[Vector], e: list[Vector]) -> list[NDArray[np.bool_]]:
    """Return which groups the projection shortens."""
    if len(mus) == 1:
        return [e[0] > 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        kinks = [np.where(e_c > 0, e_c / mu, -np.inf) for mu, e_c in zip(mus, e, strict=True)]
    both = (mus[0] * e[0] + mus[1] * e[1]) / (1.0 + mus[0] ** 2 + mus[1] ** 2)
    low = np.minimum(*kinks)
    first = kinks[0] >= kinks[1]
    return [(e_c > 0) & ((both <= low) | own) for e_c, own in zip(e, (first, ~first), strict=True)]


def _disk(x: Dense, w: Dense, radius: Vector) -> Dense:
    part = _Part.of(x, w, slice(None), radius)
    return part.defect(x, w, radius, _sum(part.L, part.gain, -radius))


def _sum(*terms: Vector) -> Vector:
    """Sum from the largest term on: what cancels does so before small ones are added."""
    stacked = np.stack(terms)
    order = np.argsort(-np.abs(stacked), axis=0, kind="stable")
    total = np.zeros_like(terms[0])
    for row in np.take_along_axis(stacked, order, axis=0):
        total = total + row
    return total
