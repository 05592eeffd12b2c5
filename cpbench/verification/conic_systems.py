"""Answers to the conic and nonlinear formulations as systems for `backward_error`.

A nonlinear map is taken as its linearization at the answer, F(x) = F′(z)x + (F(z) − F′(z)z): the terms of a row are
those of F′(z)z and the rest is its constant, however F is written down. Where F has degree 0 (excess demand of prices),
the rest is F(z), 0 at a solution; but 0 does not solve it: such a row has a constant, as large as its terms. Where F
has degree d > 0 (a square), the rest is (1 − d)F(z), as small as the row: such a row has no constant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse as sp

from cpbench.foundation import matrices
from cpbench.foundation.matrices import Vector, transpose
from cpbench.verification.linear import orientation
from cpbench.verification.rows import EPS, ROUNDINGS, ROWS, Frame, System, block_norms, block_sizes, kept, term_sizes
from cpbench.verification.sets import ConeFactors, Flags, Sets, of_product
from cpbench.verification.systems import BOUNDS
from cpbench.verification.vanishing import caps

SimpleSet: TypeAlias = tuple[Any, Any, list[ConeFactors]]
"""Lower and upper sides of the components of z, and what of them is in cones."""


@dataclass(frozen=True, eq=False)
class RowGroup:
    """Rows g(z) ≥ 0, or = 0 where `lower` is −∞, beside their multipliers; `curved` tells which are not linear."""

    slope: Any
    value: Vector
    constant: Vector
    multipliers: Vector
    lower: float = 0.0
    curved: Any = False


@ROWS.of("soclcp")
def soclcp(P: Any, point: Any) -> System:
    """Return x in K beside Mx + q."""

    def frame() -> Frame:
        block, (lb, ub, cones) = P.K.blocks, of_product(P.K)
        simple = Sets.of((P.q.size, lb, ub), cones=cones)
        constants = _norms(P.q, block)
        program = np.full(constants.size, matrices.is_symmetric(P.M))
        return Frame(term_sizes(block_sizes(P.M, block)), constants, simple, P.q, block, ~program, program)

    return System(kept(P, frame), point.x, P.M @ point.x + P.q)


@ROWS.of("coneqp")
def coneqp(P: Any, point: Any) -> System:
    """Return (x, y) beside Qx + p − Aᵀy and Ax + b, which is in K."""
    x, y = point.x, point.y

    def frame() -> Frame:
        n, m = x.size, y.size
        lb, ub, cones = of_product(P.K, rows=True, first=n)
        block = np.concatenate([np.arange(n), n + P.K.blocks])
        last = int(block[-1]) + 1 if block.size else 0
        return Frame(
            terms=term_sizes(block_sizes(sp.block_array([[P.Q, transpose(P.A)], [P.A, None]]), block)),
            constants=_norms(np.concatenate([P.p, P.b]), block),
            sets=Sets.of((n, -np.inf, np.inf), (m, lb, ub), cones=cones),
            signed=np.concatenate([P.p, P.b]),
            block=block,
            multiplier=np.arange(last) >= n,
            program=np.ones(last, dtype=bool),
            certifying=True,
        )

    return System(
        frame=kept(P, frame),
        x=np.concatenate([x, y]),
        f=np.concatenate([P.Q @ x + P.p - P.A.T @ y, P.A @ x + P.b]),
    )


@ROWS.of("ncp", "micp", "equation")
def complementarity(P: Any, point: Any) -> System:
    """Return the rows of ncp, micp and equation: z between bounds beside F(z)."""
    z = point.z
    return _with_rows(P, z, P.F(z), P.F.jacobian(z), (*BOUNDS[P.node](P), []), np.arange(z.size))


@ROWS.of("ge")
def ge(P: Any, point: Any) -> System:
    """Return z in S beside F(z)."""
    z = point.z
    return _with_rows(P, z, P.F(z), P.F.jacobian(z), *_simple(P, P.K, P.lb, P.ub, z.size))


@ROWS.of("vi")
def vi(P: Any, point: Any) -> System:
    """Return (z, λ, μ, ν) beside F(z) − Aᵀλ − Cᵀμ − ∇g ν, Az − b, Cz − d and g(z)."""
    z = point.z
    rows = [RowGroup(P.A, P.A @ z - P.b, -P.b, point.lam), RowGroup(P.C, P.C @ z - P.d, -P.d, point.mu, lower=-np.inf)]
    if P.g.rows:
        slope, g, bent = sp.csr_array(P.g.jacobian(z)), P.g(z), _curved(P.g)
        rows.append(RowGroup(slope, g, np.where(bent, g - slope @ z, P.g.compiled.q), point.nu, curved=bent))
    return _with_rows(P, z, P.F(z), P.F.jacobian(z), *_simple(P, P.K, P.lb, P.ub, z.size), rows)


@ROWS.of("cp")
def cp(P: Any, point: Any) -> System:
    """Return (x, λ) beside F(x) − Aᵀλ and Ax."""
    x = point.x
    rows = [RowGroup(P.A, P.A @ x, np.zeros(P.A.shape[0]), point.lam)]
    return _with_rows(P, x, P.F(x), P.F.jacobian(x), *_simple(P, P.K, -np.inf, np.inf, x.size), rows)


@ROWS.of("qvi")
def qvi(P: Any, point: Any) -> System:
    """Return (z, ν) beside F(z) − ∇_y g ν and g(z, z), z in S(z)."""
    z = point.z
    simple, block = _simple(P, *P.set_at(z), z.size)
    rows = []
    if P.g.rows:
        g = P.row_values(z)
        whole = sp.csr_array(P.g.jacobian(np.concatenate([z, z])))
        constant = g - whole @ np.concatenate([z, z])
        rows.append(RowGroup(sp.csr_array(whole[:, : z.size]), g, constant, point.nu, curved=True))
    return _with_rows(P, z, P.F(z), P.F.jacobian(z), simple, block, rows, fixed=False)


@ROWS.of("nlp")
def nlp(P: Any, point: Any) -> System:
    """Return (z, λ, μ) beside ∇f − ∇g λ − ∇h μ, g(z) and h(z); ν is the first of them."""
    z, lam, mu = point.z, point.lam, point.mu
    g, h, Jg, Jh = P.g(z), P.h(z), sp.csr_array(P.g.jacobian(z)), sp.csr_array(P.h.jacobian(z))
    gradient = P.f.jacobian(z).toarray().ravel()
    hessian, curvature = sp.csr_array(P.f.hessian(z, np.ones(1))), _curvature(P, z, lam, mu)
    # a derivative that vanishes at the answer says nothing of units: the larger one counts, here or at the start
    by, start = [curvature, abs(sp.csr_array(sp.vstack([Jg, Jh])))], P.at_start
    derivatives = [
        _curvature(P, start, lam, mu),
        abs(sp.csr_array(sp.vstack([P.g.jacobian(start), P.h.jacobian(start)]))),
    ]
    by = [here.maximum(far) if np.isfinite(far.data).all() else here for here, far in zip(by, derivatives, strict=True)]
    return _with_rows(
        P, z, gradient, curvature, (P.lb, P.ub, []), np.arange(z.size),
        [RowGroup(Jg, g, g - Jg @ z, lam), RowGroup(Jh, h, h - Jh @ z, mu, lower=-np.inf)],
        nu=point.nu, prices=_prices(P, z, gradient, hessian, gradient - curvature @ z), by=by,
    )  # fmt: skip


def _curvature(P: Any, z: Vector, lam: Vector, mu: Vector) -> Any:
    """Return the sum of the sizes of the Hessians of f, gᵀλ and hᵀμ, as CSR."""
    result = abs(sp.csr_array(P.f.hessian(z, np.ones(1))))
    for F, weights in ((P.g, lam), (P.h, mu)):
        if F.rows:
            result = result + abs(sp.csr_array(F.hessian(z, weights)))
    return sp.csr_array(result)


def _prices(P: Any, z: Vector, gradient: Vector, hessian: Any, otherwise: Vector) -> Vector:
    """Return the constants of the rows of ∇f that are linear, 0 below rounding, and of other rows those given.

    The rows of a quadratic objective have the constants that it has as a QP: where they are 0, what is left of sizes
    of terms, z₂ − z₁ beside z₂ + z₁, is no price.
    """
    change = sp.coo_array(sp.csr_array(P.f.hessian(2.0 * z, np.ones(1))) - hessian)
    sizes = abs(hessian)
    largest = sizes.max(axis=1).toarray().ravel() if sizes.nnz else np.zeros(z.size)
    rows = change.coords[0]
    curved = ~(np.abs(change.data) <= ROUNDINGS * EPS * largest[rows])  # no number is no constant
    linear = np.bincount(rows[curved], minlength=z.size) == 0
    prices = gradient - hessian @ z
    prices[np.abs(prices) <= ROUNDINGS * EPS * (np.abs(gradient) + sizes @ np.abs(z))] = 0.0
    return np.where(linear, prices, otherwise)


def _with_rows(
    P: Any, z: Vector, force: Vector, slope: Any, simple: SimpleSet, block: Any, rows: Sequence[RowGroup] = (), *,
    nu: Vector | None = None, prices: Vector | None = None, fixed: bool = True, by: Any = None,
) -> System:  # fmt: skip
    """Return F(z) less the rows' multipliers beside z, and each row beside its multiplier; `prices` are the constants
    of F where they are known, `fixed` tells whether the sets stay where they are."""
    slope = sp.csr_array(slope)
    first = int(block[-1]) + 1 if len(block) else 0
    columns = zip(*((row.multipliers, row.value, row.constant) for row in rows), strict=True) if rows else [()] * 3
    multipliers, values, constants = (np.concatenate([np.zeros(0), *column]) for column in columns)
    curved = np.concatenate([np.zeros(0, bool), *(np.broadcast_to(row.curved, row.value.shape) for row in rows)])
    n, m = z.size, multipliers.size
    A = sp.csr_array(sp.vstack([sp.csr_array(row.slope) for row in rows])) if rows else sp.csr_array((0, n))
    bent = np.zeros(n, dtype=bool)
    constant, straight = prices, False
    if constant is None:
        bent = _curved(P.F)
        constant = np.where(bent, _of_one_degree(P.F, z, force, slope, force - slope @ z), P.F.compiled.q)
        straight = fixed and not (bent.any() or curved.any())
    beside = np.abs(constants)
    whole = np.concatenate([block, first + np.arange(m)])

    def frame() -> Frame:
        matrix = sp.block_array([[slope, A.T], [A, None]]) if m else slope
        multiplier, program = np.arange(first + m) >= first, np.full(first + m, prices is not None)
        if straight and first == n and not m:
            multiplier, program = orientation(slope)
        elif straight and first == n:
            program[:] = matrices.is_symmetric(slope)
        bare = not straight and P.node in ("ncp", "micp", "equation")
        vanishing_caps, sizes = caps(P.F, z, force, slope) if bare else None, block_sizes(matrix, whole)
        return Frame(
            terms=sizes if vanishing_caps is not None else term_sizes(sizes),  # caps are of all entries
            constants=np.concatenate([_norms(constant, block), beside]),
            sets=Sets.of((n, *simple[:2]), *((row.value.size, row.lower, np.inf) for row in rows), cones=simple[2]),
            signed=np.concatenate([constant, constants]),
            block=whole,
            multiplier=multiplier,
            program=program,
            certifying=prices is not None,
            by=None if by is None else sp.block_array([[by[0], by[1].T], [by[1], None]]) if m else by[0],
            linear=straight or prices is not None,
            caps=vanishing_caps,
        )

    system = kept(P, frame) if straight else frame()
    balance = force - A.T @ multipliers
    return System(
        frame=system,
        x=np.concatenate([z, multipliers]),
        f=np.concatenate([balance, values]),
        also=None if nu is None else (balance - nu, block),
    )


def _curved(F: Any) -> Flags:
    """Return which rows of a map are not linear."""
    return np.diff(F.compiled.C.indptr) > 0


def _of_one_degree(F: Any, z: Vector, value: Vector, slope: Any, constant: Vector) -> Vector:
    """Correct the constants of homogeneous rows: of degree 0 the size of their terms, of other degrees 0."""
    at_0 = F(np.zeros_like(z))
    linear = (constant == 0) & (at_0 != 0)  # no number counts as not 0
    curved = (constant != 0) & (at_0 == 0)
    if not (linear | curved).any():
        return constant
    doubled, terms = F(2.0 * z), abs(slope) @ np.abs(z)
    result = np.where(linear & (np.abs(doubled - value) <= ROUNDINGS * EPS * terms), terms, constant)
    fraction, degree = np.frexp(np.divide(doubled, value, out=np.ones_like(value), where=value != 0))
    result[curved & (((fraction == 0.5) & (degree > 1)) | (doubled == value))] = 0.0  # 2ᵈ without rounding
    return result


def _simple(P: Any, K: Any, lb: Any, ub: Any, n: int) -> tuple[SimpleSet, Any]:
    """S = {z ∈ K : lb ≤ z ≤ ub}, and the blocks of its components."""
    if not P.cone_kind.size:
        return (lb, ub, []), np.arange(n)
    lower, upper, cones = of_product(K)
    if hasattr(P, "in_free_factor"):
        lower, upper = np.where(P.in_free_factor, lb, lower), np.where(P.in_free_factor, ub, upper)
    return (lower, upper, cones), K.blocks


def _norms(x: Vector, block: Any) -> Vector:
    return block_norms(x, block, int(block[-1]) + 1 if len(block) else 0)
