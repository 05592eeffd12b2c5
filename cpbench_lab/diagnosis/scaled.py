"""The same problem in other units, by powers of two, so that no digit of the data changes; and the way back.

    lcp   z = Ez',          M' = EME, q' = Eq
    mlcp  (u, v) = Ex',     the whole matrix as that of an LCP
    qp    z = Ez', Q' = EQE, p' = Ep, A' = RAE, b' = Rb, C' = SCE, d' = Sd; λ = Rλ', μ = Sμ', ν = E⁻¹ν'
    fc    r_c = e_c r_c',   W' = EWE, q' = Eq, one e_c a contact, so that cones stay what they are

E (and R, S) make the entries of the symmetric matrix of the problem about 1 (`verification.equilibration`); then all
unknowns get one more unit, in which the constants are about 1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.base import Problem
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Vector
from cpbench.registry import NodeTable
from cpbench.verification.equilibration import equilibrate


@dataclass(frozen=True, eq=False)
class Scaled:
    """A problem in other units. `back` : carries its answers. `before`, `after` : decades between rows."""

    problem: Problem
    back: Callable[[Any], Any]
    before: float
    after: float


UNITS: NodeTable[Callable[[Any], Scaled]] = NodeTable("change of units")
"""Function that returns a problem in units in which its entries are alike."""


def scaled(problem: Any) -> Scaled | None:
    """Return the problem in units in which its entries are alike; None for formulations that are not listed above."""
    make = UNITS.get(problem.node)
    return make(problem) if make is not None else None


@UNITS.of("lcp")
def _lcp(P: Any) -> Scaled:
    return _one_matrix(P, "M", "z", _units(_both(P.M)))


@UNITS.of("mlcp")
def _mlcp(P: Any) -> Scaled:
    n = P.a.size
    K = matrices.block([[P.A, P.C], [P.D, P.B]])
    e = _units(_both(K))
    f, g = e[:n], e[n:]
    t = _unit(np.concatenate([f * P.a, g * P.b]))
    blocks = {"A": _times(f, P.A, f), "C": _times(f, P.C, g), "D": _times(g, P.D, f), "B": _times(g, P.B, g)}
    return Scaled(
        replace(P, **blocks, a=f * P.a / t, b=g * P.b / t),
        lambda point: type(point)(u=t * f * point.u, v=t * g * point.v),
        _decades(K),
        _decades(matrices.scaled_both(K, e)),
    )


@UNITS.of("qp")
def _qp(P: Any) -> Scaled:
    n, m = P.p.size, P.b.size
    rows = sp.vstack([sp.csr_array(P.A), sp.csr_array(P.C)], format="csr")
    K = (
        sp.block_array([[sp.csr_array(P.Q), rows.T], [rows, None]], format="csr")
        if rows.shape[0]
        else sp.csr_array(P.Q)
    )
    all_units = _units(_both(K))
    e, r, s = all_units[:n], all_units[n : n + m], all_units[n + m :]
    with np.errstate(invalid="ignore"):
        lb, ub = P.lb / e, P.ub / e
    data = {"Q": matrices.scaled_both(P.Q, e), "A": _times(r, P.A, e), "C": _times(s, P.C, e)}
    return Scaled(
        replace(P, **data, p=e * P.p, b=r * P.b, d=s * P.d, lb=lb, ub=ub),
        lambda point: type(point)(z=e * point.z, lam=r * point.lam, mu=s * point.mu, nu=point.nu / e),
        _decades(K),
        _decades(matrices.scaled_both(K, all_units)),
    )


@UNITS.of("fc")
def _fc(P: Any) -> Scaled:
    d = P.dimension
    W = sp.coo_array(sp.csr_array(P.W))
    blocks = sp.csr_array((np.abs(W.data), (W.row // d, W.col // d)), shape=(P.nc, P.nc))
    return _one_matrix(P, "W", "r", np.repeat(_units(_both(blocks)), d))


def _one_matrix(P: Any, matrix: str, unknown: str, e: Vector) -> Scaled:
    """Scale a problem of one matrix and a vector q, which a complementarity relation holds together, by diag(e)."""
    before: Matrix = getattr(P, matrix)
    after, q = matrices.scaled_both(before, e), e * P.q
    t = _unit(q)
    return Scaled(
        replace(P, **{matrix: after, "q": q / t}),
        lambda point: type(point)(**{unknown: t * e * getattr(point, unknown)}),
        _decades(before),
        _decades(after),
    )


def _both(K: Matrix) -> Any:
    """Return |K| + |K|ᵀ as sorted sparse rows."""
    A: Any = abs(sp.csr_array(K))
    both = sp.csr_array(A + A.T)
    both.eliminate_zeros()
    return both


def _units(K: Any) -> Vector:
    """Return powers of two near the units in which the entries of a symmetric matrix are about 1."""
    return np.exp2(np.rint(np.log2(equilibrate(K)))) if K.nnz else np.ones(K.shape[0])


def _unit(q: Vector) -> float:
    """Return the power of two at the largest constant; 1 without constants."""
    top = matrices.max_abs(q)
    return float(np.exp2(np.rint(np.log2(top)))) if top > 0 else 1.0


def _times(left: Vector, K: Matrix, right: Vector) -> Matrix:
    """Return diag(left) K diag(right), dense or sparse as K is."""
    if matrices.is_sparse(K):
        return sp.csr_array(sp.diags_array(left) @ K @ sp.diags_array(right))
    return left[:, None] * matrices.dense(K) * right[None, :]


def _decades(K: Matrix) -> float:
    """Return log10 of the ratio of the largest entries of the rows, the largest to the smallest that is not 0."""
    A: Any = abs(sp.csr_array(K))
    largest = np.asarray(A.max(axis=1).toarray(), dtype=float).ravel()
    largest = largest[largest > 0]
    return float(np.log10(largest.max() / largest.min())) if largest.size else 0.0
