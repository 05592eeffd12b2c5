"""Copositive and copositive-plus matrices, for which Lemke's method ends in a solution or a proof that there is none.

M is copositive when xᵀMx ≥ 0 for all x ≥ 0, strictly when > 0 for x ≠ 0, copositive-plus when also
(x ≥ 0, xᵀMx = 0) ⇒ (M + Mᵀ)x = 0. Cottle, Pang, Stone, The Linear Complementarity Problem (1992), 3.8 and 4.4.

Small: the least value of xᵀMx on the simplex {x ≥ 0, eᵀx = 1}, over all its faces. On a face where the bordered
matrix [[S, e], [eᵀ, 0]] is singular the form is constant along a line that leads to a smaller face, so the faces with
a single stationary point suffice; and every zero of a copositive form is a sum of zeros of such faces.
"""

from __future__ import annotations

from itertools import combinations
from typing import Any, cast

import numpy as np

from cpbench.foundation import matrices
from cpbench.foundation.matrices import PSD_TOLERANCE, Dense, Matrix, Vector, unit_diagonal
from cpbench_lab.facts.fact import Fact, How, undecided
from cpbench_lab.facts.spectrum import SCALED, definiteness

FACES_LIMIT = 12
"""Largest matrix whose 2ⁿ − 1 faces are all looked at (a quarter of a second)."""


def copositivity(M: Matrix, name: str, known: Fact) -> tuple[Fact, Fact]:
    """Decide the facts `copositive` and `copositive-plus` of a square M whose definiteness is `known`.

    Units of the unknowns change neither, so that M is taken as S = `unit_diagonal(M)`. The number is the least value
    of xᵀSx found on the simplex, held against PSD_TOLERANCE.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        S = unit_diagonal(M)
    if not np.isfinite(matrices.max_abs(S)):
        why = f"entries overflow {SCALED}"
        return undecided("copositive", name, why), undecided("copositive-plus", name, why)
    small = M.shape[0] <= FACES_LIMIT and matrices.max_abs(S) > 0.0
    minima = simplex_minima(matrices.dense(S)) if small else None
    copositive = _copositive(S, name, known, minima)
    return copositive, _plus(S, name, known, copositive, minima)


def simplex_minima(S: Dense) -> tuple[Dense, Vector]:
    """Find points X (k, n) of the simplex and their values xᵀSx, among them every isolated minimum of a face."""
    n = S.shape[0]
    points: list[Dense] = []
    for size in range(1, n + 1):
        faces = np.array(list(combinations(range(n), size)))
        bordered = np.ones((len(faces), size + 1, size + 1))
        bordered[:, :-1, :-1] = S[faces[:, :, None], faces[:, None, :]]
        bordered[:, -1, -1] = 0.0
        x = np.linalg.pinv(bordered, rcond=1e-13, hermitian=True)[:, :-1, -1]
        inside = (x >= -1e-10).all(axis=1) & (x.sum(axis=1) > 0.5)
        whole = np.zeros((int(inside.sum()), n))
        np.put_along_axis(whole, faces[inside], np.maximum(x[inside], 0.0), axis=1)
        points.append(whole / whole.sum(axis=1, keepdims=True))
    X = np.concatenate(points)
    return X, np.einsum("ki,ij,kj->k", X, S, X)


def _copositive(S: Matrix, name: str, known: Fact, minima: tuple[Dense, Vector] | None) -> Fact:
    label, tolerance = "copositive", PSD_TOLERANCE
    if minima is not None:
        least = float(minima[1].min())
        word = "strictly; " if least > tolerance else ""
        evidence = f"{word}least xᵀMx on the simplex {SCALED}"
        return Fact(label, name, least >= -tolerance, How.EXACT, least, tolerance, evidence)
    if matrices.max_abs(S) == 0.0:
        return Fact(label, name, True, How.EXACT, evidence="no nonzero entry")
    if known.value in ("positive definite", "positive semidefinite"):
        return Fact(label, name, True, known.how, evidence=str(known.value))
    diagonal = np.asarray(S.diagonal())
    i = int(diagonal.argmin())
    if diagonal[i] < -tolerance:
        return Fact(label, name, False, How.EXACT, float(diagonal[i]), tolerance, f"diagonal entry {i + 1} {SCALED} is")
    i, j, value = _worst_edge(S, diagonal)
    if value < -tolerance:
        evidence = f"on the edge of rows {i + 1}, {j + 1} {SCALED} xᵀMx is"
        return Fact(label, name, False, How.EXACT, value, tolerance, evidence)
    kept = _without_nonnegative_rows(S)
    if kept.size == 0:
        return Fact(label, name, True, How.EXACT, evidence="no entry of the symmetric part that matters is negative")
    part: Any = matrices.sparse(S)[kept][:, kept] if matrices.is_sparse(S) else S[np.ix_(kept, kept)]
    without = f"{S.shape[0] - kept.size} nonnegative rows of the symmetric part left out"
    if kept.size <= FACES_LIMIT:
        least = float(simplex_minima(matrices.dense(part))[1].min())
        evidence = f"{without}, least xᵀMx on the simplex {SCALED}"
        return Fact(label, name, least >= -tolerance, How.EXACT, least, tolerance, evidence)
    rest = definiteness(part, name) if kept.size < S.shape[0] else known
    if rest.value in ("positive definite", "positive semidefinite"):
        evidence = f"{without}, the rest is {rest.value}, least eigenvalue {SCALED}"
        return Fact(label, name, True, rest.how, rest.number, rest.tolerance, evidence)
    return undecided(
        label, name, f"{kept.size} rows with negative entries, all faces are looked at up to {FACES_LIMIT}; not PSD"
    )


def _plus(S: Matrix, name: str, known: Fact, copositive: Fact, minima: tuple[Dense, Vector] | None) -> Fact:
    label, tolerance = "copositive-plus", PSD_TOLERANCE
    if copositive.value is False:
        return Fact(label, name, False, copositive.how, evidence="not copositive")
    if matrices.max_abs(S) == 0.0 or known.value in ("positive definite", "positive semidefinite"):
        return Fact(label, name, True, known.how, evidence=str(known.value))
    if copositive.value is None:
        return undecided(label, name, "whether it is copositive is not decided")
    diagonal = np.asarray(S.diagonal())
    for i in np.flatnonzero(diagonal <= 0.0)[:100]:
        row = matrices.max_abs(cast(Any, S)[[int(i)], :])
        if row > tolerance:  # x = e_i is a zero of the form
            evidence = f"diagonal entry {i + 1} is 0, but its row of the symmetric part has an entry of size"
            return Fact(label, name, False, copositive.how, row, tolerance, evidence)
    if minima is None:
        return undecided(
            label, name, f"copositive, neither PSD nor small enough ({FACES_LIMIT} rows) to look at all faces"
        )
    X, values = minima
    zeros = X[np.abs(values) <= tolerance]
    if not len(zeros):
        return Fact(label, name, True, How.EXACT, evidence="strictly copositive")
    # a value of size ε leaves a gradient of size √ε where the form is semidefinite along the way
    gradient = float(np.abs(zeros @ matrices.dense(S)).max())
    limit = float(np.sqrt(PSD_TOLERANCE))
    evidence = f"largest |(M + Mᵀ)x|/2 over the zeros x of the form on the simplex {SCALED}"
    return Fact(label, name, gradient <= limit, How.EXACT, gradient, limit, evidence)


def _worst_edge(S: Matrix, diagonal: Vector) -> tuple[int, int, float]:
    """Find rows i, j and value of the least xᵀSx on an edge of the simplex with a negative entry s_ij inside it."""
    coo = matrices.sparse(S).tocoo()
    below = (coo.data < 0) & (coo.row < coo.col)
    row, col, off = coo.row[below], coo.col[below], coo.data[below]
    if not off.size:
        return 0, 0, 0.0
    a, b = diagonal[row], diagonal[col]
    value = (a * b - off**2) / (a + b - 2.0 * off)  # at the stationary point of the edge
    inside = (a > off) & (b > off)
    value = np.where(inside, value, np.minimum(a, b))
    k = int(value.argmin())
    return int(row[k]), int(col[k]), float(value[k])


def _without_nonnegative_rows(S: Matrix) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Return the rows left when rows without negative entries are dropped again and again: x ≥ 0 gains nothing from
    them.
    """
    coo = matrices.sparse(S).tocoo()
    negative = coo.data < 0
    row, col = coo.row[negative], coo.col[negative]
    kept = np.zeros(S.shape[0], dtype=bool)
    kept[row] = True
    while row.size:
        inside = kept[row] & kept[col]
        row, col = row[inside], col[inside]
        now = np.zeros_like(kept)
        now[row] = True
        if (now == kept).all():
            break
        kept = now
    return np.flatnonzero(kept)
