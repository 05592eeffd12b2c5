"""Masses that contacts move, from the operator W of a scene; and the nearest scene in which they are even.

Contacts with the same neighbours in W are between the same two bodies. In coordinates in which the block of each such
pair is the identity on its range, the geometry of the contacts of a pair has no share in the eigenvalues of W. They are
1 for a pair by itself, and about one over a ratio of masses where a pair carries others. The eigenvalues λ below the
widest gap are raised to the one above it, by δ; those that are 0 stay so. With V the vectors of the raised ones in the
coordinates of W:

    fc, rfc     W' = W + V diag(δ) Vᵀ
    gfc, grfc   W = HᵀM⁻¹H; M'⁻¹ = M⁻¹ + X diag(δ) Xᵀ with HᵀX = V, so that HᵀM'⁻¹H = W'; f' = M'M⁻¹f, so that the
                motion without contacts stays what it is
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.base import Problem
from cpbench.formulations.contact import LocalContact
from cpbench.formulations.global_contact import GlobalContact
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Dense, Vector

RANGE = 1e-10
"""Share of the largest eigenvalue of a pair of bodies below which one counts as 0: W was rounded, and often printed."""
ROUNDING = 1e-13
"""The same for W in those coordinates, times its rows; or its asymmetry, where that is larger: data that were printed
with few digits say so by it."""
LARGEST = 1500
"""Rows of the largest W, or M, that is looked at: they are dense here, and eigenvalues take their cube."""


@dataclass(frozen=True, eq=False)
class EvenMasses:
    """A scene with even masses. `ratio` : of masses before. `heavy`, `of` : modes of motion that were heavier, and all
    of them."""

    problem: Problem
    ratio: float
    heavy: int
    of: int


def even_masses(problem: Any) -> EvenMasses | None:
    """Return the nearest scene with even masses; None where it has fewer than two modes of motion, is no scene of those
    above, is too large, or has joints or a singular M."""
    P = problem
    planar = (P.node in ("gfc", "fc") and P.dimension == 2) or (P.node in ("rfc", "grfc") and P.dimension == 3)
    if isinstance(P, LocalContact) and 0 < P.q.size <= LARGEST:
        modes = _modes(matrices.dense(P.W), P.dimension, planar)
        if modes is None:
            return None
        W = matrices.dense(P.W) + (modes.vectors * modes.raised) @ modes.vectors.T
        return EvenMasses(replace(P, W=_like(P.W, W)), modes.ratio, modes.raised.size, modes.of)
    if isinstance(P, GlobalContact) and 0 < P.w.size <= LARGEST and P.f.size <= LARGEST:
        if P.b.size or P.factorization.singular:
            return None
        modes = _modes(matrices.dense(P.H).T @ P.responses, P.dimension, planar)
        if modes is None:
            return None
        MX = matrices.dense(P.H) @ modes.impulses
        X = np.asarray(P.factorization.solve(MX))
        less = MX @ np.linalg.solve(np.diag(1.0 / modes.raised) + X.T @ MX, MX.T)
        M = matrices.dense(P.M) - (less + less.T) / 2.0
        changed = replace(P, M=_like(P.M, M), f=M @ np.asarray(P.factorization.solve(P.f)))
        return EvenMasses(changed, modes.ratio, modes.raised.size, modes.of)
    return None


@dataclass(frozen=True, eq=False)
class _Modes:
    """The modes below the widest gap. `vectors` : V, (m, k); `impulses` : Y with WY = V; `raised` : δ, (k,).
    `ratio` : of the eigenvalues on both sides of the gap. `of` : all modes whose eigenvalue is not 0."""

    vectors: Dense
    impulses: Dense
    raised: Vector
    ratio: float
    of: int


def _modes(W: Dense, d: int, planar: bool) -> _Modes | None:
    back, forth = _by_pairs(W, d, planar)
    K = forth.T @ W @ forth
    if not K.size:
        return None
    values, vectors = np.linalg.eigh((K + K.T) / 2.0)
    noise = max(ROUNDING * len(K) * float(values[-1]), matrices.max_abs(K - K.T))
    first = int(np.searchsorted(values, noise, side="right"))
    moving = values[first:]
    if moving.size < 2:
        return None
    gaps = moving[1:] / moving[:-1]
    k = int(gaps.argmax()) + 1
    own = vectors[:, first : first + k]
    raised = moving[k] - moving[:k]
    return _Modes(back @ own, forth @ (own / moving[:k]), raised, float(gaps[k - 1]), moving.size)


def _by_pairs(W: Dense, d: int, planar: bool) -> tuple[Dense, Dense]:
    """Return L, R with RᵀL = I and LLᵀ the blocks of W between the same two bodies, without their null space."""
    left, right = list[Dense](), list[Dense]()
    for contacts in _pairs(W, d, planar):
        rows = (d * np.array(contacts)[:, None] + np.arange(d)).ravel()
        values, vectors = _range(W, rows)
        root: Vector = np.sqrt(values)
        for columns, into in ((vectors * root, left), (vectors / root, right)):
            placed = np.zeros((len(W), columns.shape[1]))
            placed[rows] = columns
            into.append(placed)
    return np.hstack(left), np.hstack(right)


def _pairs(W: Dense, d: int, planar: bool) -> list[list[int]]:
    """Return the contacts of each pair of bodies: those with the same neighbours in W.

    Two bodies alone on the ground have one set of neighbours, but more freedoms than a pair has: 3 in the plane, 6 in
    space, 5 at two points in space, about whose line they turn freely. Contacts that have more are taken one by one.
    """
    nc = len(W) // d
    touching = np.abs(W.reshape(nc, d, nc, d)).max(axis=(1, 3)) > 0
    alike: dict[bytes, list[int]] = {}
    for c in range(nc):
        alike.setdefault(touching[c].tobytes(), []).append(c)
    result = list[list[int]]()
    for contacts in alike.values():
        rows = (d * np.array(contacts)[:, None] + np.arange(d)).ravel()
        freedoms = 3 if planar else 5 if (d, len(contacts)) == (3, 2) else 6
        one = len(contacts) == 1 or _range(W, rows)[0].size <= freedoms
        result += [contacts] if one else [[c] for c in contacts]
    return result


def _range(W: Dense, rows: Any) -> tuple[Vector, Dense]:
    """Return the eigenvalues of a block of W that are not 0, and their vectors."""
    block = W[np.ix_(rows, rows)]
    values, vectors = np.linalg.eigh((block + block.T) / 2.0)
    kept = values > RANGE * max(float(values[-1]), 0.0)
    return values[kept], vectors[:, kept]


def _like(matrix: Any, values: Any) -> Any:
    """Return values as sparse or dense as a matrix is."""
    return sp.csr_array(values) if matrices.is_sparse(matrix) else matrices.dense(values)
