"""Facts of matrices over the rationals: by witnesses in doubles, which are checked."""

from __future__ import annotations

from typing import Any

import numpy as np
from certificate_file import exact, require
from flint import fmpq, fmpq_mat


def unique(fact: str, K: list[dict[int, float]], n: int) -> bool:
    """Return whether the leading block has the fact: by a witness in doubles that is checked over the rationals."""
    M = np.array([[K[i].get(j, 0.0) for j in range(n)] for i in range(n)])
    if fact == "P-matrix":
        M = np.where(np.eye(n) > 0, M, -np.abs(M))
        witness = fmpq_mat([[exact(v)] for v in np.linalg.solve(M, np.diag(M)).tolist()])
        return all(v > 0 for v in (*np.diag(M), *witness.entries(), *(rational(M) * witness).entries()))
    return fact == "positive definite" and definite(M)


def definite(M: Any) -> bool:
    """Return whether M + Mᵀ is positive definite: X(M + Mᵀ)Xᵀ is strictly diagonally dominant for some X."""
    n = len(M)
    scale = np.ldexp(1.0, -(np.frexp(np.diag(M))[1] // 2))
    double = (M * scale).T * scale
    try:
        inverse = np.linalg.inv(np.linalg.cholesky(double + double.T))
    except np.linalg.LinAlgError:
        return False
    X, S = rational(np.round(inverse * 2.0**40)), rational(M) + rational(M.T)
    D = fmpq_mat(n, n, [exact(scale[i]) if i == j else fmpq(0) for i in range(n) for j in range(n)])
    product = (X * D) * S * (X * D).transpose()
    return all(2 * r[i] > sum(map(abs, r)) for i, r in enumerate(product.tolist()))


def convex(Q: list[dict[int, float]]) -> bool:
    """Return whether each connected component of Q is positive semidefinite."""
    left = set(range(len(Q)))
    while left:
        part, waiting = set[int](), [left.pop()]
        while waiting:
            i = waiting.pop()
            part.add(i)
            waiting += (more := set(Q[i]) & left)
            left -= more
        M = np.array([[Q[i].get(j, 0.0) for j in sorted(part)] for i in sorted(part)])
        if not (M[0, 0] >= 0 if len(M) == 1 else definite(M) or semidefinite(M)):
            return False
    return True


def semidefinite(M: Any) -> bool:
    """Return whether M is: rows with the largest pivots make a definite block, and nothing is left of the others."""
    require(bool((M == M.T).all()), "Q is not symmetric")
    some, rest = list[int](), M.copy()
    while (k := int(np.argmax(np.diag(rest)))) not in some and rest[k, k] > 1e-8 * M[k, k]:
        some.append(k)
        rest = rest - np.outer(rest[:, k], rest[k]) / rest[k, k]
    others = [i for i in range(len(M)) if i not in some]
    if not (some and others and definite(M[np.ix_(some, some)])):
        return False
    A, B = rational(M[np.ix_(some, some)]), rational(M[np.ix_(some, others)])
    return B.transpose() * A.solve(B) == rational(M[np.ix_(others, others)])


def rational(M: Any) -> Any:
    """Return a matrix of doubles over the rationals."""
    return fmpq_mat([[exact(v) for v in row] for row in M.tolist()])
