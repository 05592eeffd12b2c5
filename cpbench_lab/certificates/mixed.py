"""Polyhedral problems as one: Kx + c beside lo ≤ x ≤ hi, with data copied from the problem and never computed.

xᵢ = loᵢ < hiᵢ says (Kx + c)ᵢ ≥ 0, xᵢ = hiᵢ > loᵢ says ≤ 0, in between it is 0, and where loᵢ = hiᵢ it is free. Every
number of K and c is one of the problem, perhaps with its sign changed: a proof for one is a proof for the other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cpbench.formulations.base import Problem
from cpbench.foundation.matrices import Sparse, Vector
from cpbench.registry import NodeTable
from cpbench.verification.sets import INFINITE


@dataclass(frozen=True, eq=False)
class Mixed:
    """A mixed complementarity problem with affine map, and what its unknowns mean.

    Attributes
    ----------
    K : (N, N). c, lo, hi : (N,). answer : (k, N) of 0 and ±1, takes x to the unknowns of the problem that are compared.
    parts : first and last of those, of each vector among them that has its own size.
    """

    K: Sparse
    c: Vector
    lo: Vector
    hi: Vector
    answer: Sparse
    parts: tuple[tuple[int, int], ...]


AsMixed: TypeAlias = Callable[[Any, Any], tuple[Mixed, Vector]]
POLYHEDRAL: NodeTable[AsMixed] = NodeTable("polyhedral form")
"""Function that returns a problem and a point in this form."""
CONTACTS = ("fc", "fcm", "gfc")
"""Nodes whose solutions are enclosed in a box contact by contact."""
MAPS = ("ncp", "micp", "equation")
"""Nodes F(z) beside bounds whose solutions are enclosed in a box."""


def provable(node: str) -> bool:
    """Return whether a proof of a solution of this formulation is known."""
    return node in POLYHEDRAL or node in CONTACTS or node in MAPS


def mixed(problem: Problem, point: Any) -> tuple[Mixed, Vector] | None:
    """Return the problem in this form, with the point as x; None where it is not polyhedral.

    Sides and bounds from 1e19 on are taken for infinite, as the verdict takes them.
    """
    make = POLYHEDRAL.get(problem.node)
    if make is not None:
        return make(problem, point)
    if problem.node not in CONTACTS:
        return None
    law: Any = problem
    return _contact(law, point) if law.dimension == 2 or not law.mu.any() else None


def point_of_mixed(problem: Any, x: Vector) -> Any:
    """Return x of this form as a point of the problem, none of a contact problem; multipliers of bounds of a program
    are what is left of its gradient."""
    if problem.node != "qp":
        return problem.point_from_vector(x)
    n, m = problem.p.size, problem.b.size
    z, lam, mu = x[:n], x[n : n + m], x[n + m :]
    nu = problem.Q @ z + problem.p - problem.A.T @ lam - problem.C.T @ mu
    return problem.point_type(z=z, lam=lam, mu=mu, nu=nu)


@POLYHEDRAL.of("lcp")
def _lcp(problem: Any, point: Any) -> tuple[Mixed, Vector]:
    n = problem.q.size
    return _plain(problem.M, problem.q, np.zeros(n), np.full(n, np.inf), n), point.z


@POLYHEDRAL.of("relay")
def _relay(problem: Any, point: Any) -> tuple[Mixed, Vector]:
    return _plain(problem.M, problem.q, problem.lb, problem.ub, problem.q.size), point.z


@POLYHEDRAL.of("mlcp")
def _mlcp(problem: Any, point: Any) -> tuple[Mixed, Vector]:
    free, signed = problem.a.size, problem.b.size
    K = _block([[problem.A, problem.C], [problem.D, problem.B]], free + signed)
    lo = np.concatenate([np.full(free, -np.inf), np.zeros(signed)])
    c = np.concatenate([problem.a, problem.b])
    form = _plain(K, c, lo, np.full(c.size, np.inf), c.size)
    return replace(form, parts=((0, free), (free, c.size))), np.concatenate([point.u, point.v])


@POLYHEDRAL.of("avi")
def _avi(problem: Any, point: Any) -> tuple[Mixed, Vector]:
    return _with_rows(problem, problem.M, problem.q, point)


@POLYHEDRAL.of("qp")
def _qp(problem: Any, point: Any) -> tuple[Mixed, Vector]:
    return _with_rows(problem, problem.Q, problem.p, point)


def _with_rows(P: Any, M: Any, q: Vector, point: Any) -> tuple[Mixed, Vector]:
    """Return (z, λ, μ) beside Mz + q − Aᵀλ − Cᵀμ, Az − b, Cz − d; a row with an infinite side has λ = 0."""
    A, C = sp.csr_array(P.A), sp.csr_array(P.C)
    n, m, k = q.size, P.b.size, P.d.size
    there = P.b > -INFINITE
    K = _block([[M, -A.T, -C.T], [A, None, None], [C, None, None]], n + m + k)
    c = np.concatenate([q, np.where(there, -P.b, 0.0), -P.d])
    lo = np.concatenate([P.lb, np.zeros(m), np.full(k, -np.inf)])
    hi = np.concatenate([P.ub, np.where(there, np.inf, 0.0), np.full(k, np.inf)])
    return _plain(K, c, lo, hi, n), np.concatenate([point.z, np.where(there, point.lam, 0.0), point.mu])


def _contact(P: Any, point: Any) -> tuple[Mixed, Vector]:
    """Contacts in the plane, or without friction.

    With friction a contact has r_N, r_T = β₁ − β₂ and ξ: 0 ≤ r_N ⟂ u_N ≥ 0, 0 ≤ β₁ ⟂ ξ + u_T ≥ 0,
    0 ≤ β₂ ⟂ ξ − u_T ≥ 0, 0 ≤ ξ ⟂ μr_N − β₁ − β₂ ≥ 0. Without, r_T = 0. Before them stand the unknowns of the linear
    equations, all free: (v, λ) of the global form, λ of the mixed one.
    """
    place, sign, law = _columns(P)
    free, r, u_free, u_r, u_c, own = linear_part(P, point)
    n, k = u_c.size, place.size
    E = sp.csr_array((sign, (np.maximum(place, 0), np.arange(k))), shape=(n, k))
    E.eliminate_zeros()
    equations, forces, constants = own
    K = _block([[equations, forces @ E], [E.T @ u_free, E.T @ u_r @ E + law]], free.size + k)
    c = np.concatenate([constants, E.T @ u_c])
    lo, hi = np.zeros(k), np.full(k, np.inf)
    if P.dimension == 3:
        hi[np.arange(k) % 3 > 0] = 0.0
    lo, hi = np.concatenate([np.full(free.size, -np.inf), lo]), np.concatenate([np.full(free.size, np.inf), hi])
    answer = _csr(sp.hstack([sp.csr_array((n, free.size)), E]))
    x = E.T @ r
    x = np.maximum(x, 0.0) if P.dimension == 2 else x
    if P.dimension == 2:
        u_T = (u_free @ free + u_r @ r + u_c)[1::2]
        x[3::4] = np.abs(u_T) * (np.abs(r[1::2]) > (1 - 1e-6) * P.mu * r[::2])
    return Mixed(K, c, lo, hi, answer, ((0, n),)), np.concatenate([free, x])


def _columns(P: Any) -> tuple[NDArray[np.int64], Vector, Sparse]:
    """Return the component of r that each unknown adds to, with its sign, 0 for ξ; and the rows of the law."""
    d, nc = P.dimension, P.nc
    if d == 3:
        return np.arange(3 * nc), np.ones(3 * nc), sp.csr_array((3 * nc, 3 * nc))
    first = 4 * np.arange(nc)
    place = (2 * np.arange(nc)[:, None] + np.array([0, 1, 1, 0])).ravel()
    one = np.ones(nc)
    entries = [(1, 3, one), (2, 3, one), (3, 0, P.mu), (3, 1, -one), (3, 2, -one)]
    rows = np.concatenate([first + row for row, _, _ in entries])
    columns = np.concatenate([first + column for _, column, _ in entries])
    law = sp.csr_array((np.concatenate([v for _, _, v in entries]), (rows, columns)), shape=(4 * nc, 4 * nc))
    return place, np.tile([1.0, 1.0, -1.0, 0.0], nc), law


def linear_part(P: Any, point: Any) -> tuple[Any, ...]:
    """Free unknowns y and r; u = Uy + Wr + q as (U, W, q); and the equations Ay + Br + a = 0 as (A, B, a)."""
    r = point.r
    if P.node == "gfc":
        n, p = P.f.size, P.b.size
        G, H = sp.csr_array(P.G), sp.csr_array(P.H)
        U = _csr(sp.hstack([H.T, sp.csr_array((P.w.size, p))]))
        A = _block([[P.M, -G], [G.T, None]], n + p)
        B = _csr(sp.vstack([-H, sp.csr_array((p, P.w.size))]))
        free = np.concatenate([point.v, point.lam])
        return free, r, U, sp.csr_array((P.w.size, P.w.size)), P.w, (A, B, np.concatenate([-P.f, P.b]))
    if P.node == "fcm":
        V = sp.csr_array(P.V)
        return point.lam, r, V, sp.csr_array(P.W), P.q, (sp.csr_array(P.R), sp.csr_array(V.T), P.s)
    n = P.q.size
    nothing = sp.csr_array((0, 0)), sp.csr_array((0, n)), np.zeros(0)
    return np.zeros(0), r, sp.csr_array((n, 0)), sp.csr_array(P.W), P.q, nothing


def _plain(K: Any, c: Vector, lo: Vector, hi: Vector, compared: int) -> Mixed:
    lo = np.where(lo <= -INFINITE, -np.inf, lo)
    hi = np.where(hi >= INFINITE, np.inf, hi)
    return Mixed(_csr(K), c, lo, hi, sp.csr_array(sp.eye_array(compared, c.size)), ((0, compared),))


def _block(blocks: list[list[Any]], size: int) -> Sparse:
    """Return the square matrix of these blocks, None being zero."""
    if size == 0:
        return sp.csr_array((0, 0))
    return _csr(sp.block_array([[None if B is None else sp.csr_array(B) for B in row] for row in blocks]))


def _csr(matrix: Any) -> Sparse:
    """Compressed rows with sorted columns and without stored zeros."""
    csr: Any = sp.csr_array(matrix, dtype=np.float64, copy=True)
    csr.sum_duplicates()
    csr.eliminate_zeros()
    return csr
