"""Reduced problems in one form, which programs in other languages check: Kx + k beside a box, and friction cones."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cpbench.formulations.base import Problem
from cpbench.formulations.node_table import NodeTable
from cpbench.foundation.matrices import Dense, Vector, dense
from cpbench.foundation.product_cones import Cone


@dataclass(frozen=True)
class ConeBlock:
    """A cone over consecutive unknowns: normal, then `slides` and `rolls` tangential ones, with their coefficients.

    ‖x_T‖ ≤ μ x_N, ‖x_M‖ ≤ μ_r x_N, F̂ in the dual cone and x·F̂ = 0.
    """

    start: int
    slides: int
    rolls: int
    mu: float
    mu_r: float


@dataclass(frozen=True, eq=False)
class Form:
    """F = Kx + k: x = P(x − F) over the box lo ≤ x ≤ hi in the rows outside the blocks, and the cones in these.

    Attributes
    ----------
    K : (N, N). k, lo, hi : (N,). friction : whether F̂ is F + (μ‖F_T‖ + μ_r‖F_M‖)e_N in the blocks, else F.
    names : part of an answer -> its number of unknowns, in their order in x.
    """

    K: Dense
    k: Vector
    lo: Vector
    hi: Vector
    names: Mapping[str, int]
    blocks: tuple[ConeBlock, ...] = ()
    friction: bool = False

    def vector(self, point: Any) -> Vector:
        """Return x of a point of the problem."""
        return np.concatenate([np.zeros(0), *(getattr(point, name) for name in self.names)])


@dataclass
class _Rows:
    """Rows of a form, collected part by part: `data` are K in blocks of columns."""

    data: list[list[Any]] = field(default_factory=list)
    k: list[Vector] = field(default_factory=list)
    lo: list[Vector] = field(default_factory=list)
    hi: list[Vector] = field(default_factory=list)

    def add(self, blocks: list[Any], k: Vector, lo: Any, hi: Any) -> None:
        self.data.append([dense(B) for B in blocks])
        self.k.append(np.asarray(k))
        self.lo.append(np.broadcast_to(lo, k.shape))
        self.hi.append(np.broadcast_to(hi, k.shape))

    def form(self, names: Mapping[str, int], **more: Any) -> Form:
        parts = (np.concatenate(part) for part in (self.k, self.lo, self.hi))
        return Form(np.block(self.data), *parts, names=names, **more)


INF = np.inf
FORMS: NodeTable[Callable[[Any], Form | None]] = NodeTable("box and cones", "reduce writes no script in C++ or Julia")
"""Function that returns a problem as a `Form`."""


def form(problem: Problem) -> Form | None:
    """Return a problem in this form; None where it has none: nonlinear maps, cones that are not of friction."""
    make = FORMS.get(problem.node)
    return None if make is None else make(problem)


@FORMS.of("lcp")
def _lcp(P: Any) -> Form:
    rows = _Rows()
    rows.add([P.M], P.q, 0.0, INF)
    return rows.form({"z": P.q.size})


@FORMS.of("relay")
def _relay(P: Any) -> Form:
    rows = _Rows()
    rows.add([P.M], P.q, P.lb, P.ub)
    return rows.form({"z": P.q.size})


@FORMS.of("mlcp")
def _mlcp(P: Any) -> Form:
    rows = _Rows()
    rows.add([P.A, P.C], P.a, -INF, INF)
    rows.add([P.D, P.B], P.b, 0.0, INF)
    return rows.form({"u": P.a.size, "v": P.b.size})


@FORMS.of("qp", "avi")
def _program(P: Any) -> Form:
    M, q = (P.Q, P.p) if P.node == "qp" else (P.M, P.q)
    n, m, k = q.size, P.b.size, P.d.size
    A, C, rows = dense(P.A), dense(P.C), _Rows()
    rows.add([M, -A.T, -C.T], q, P.lb, P.ub)
    rows.add([A, np.zeros((m, m)), np.zeros((m, k))], -P.b, 0.0, INF)
    rows.add([C, np.zeros((k, m)), np.zeros((k, k))], -P.d, -INF, INF)
    return rows.form({"z": n, "lam": m, "mu": k})


def _contacts(P: Any, start: int) -> dict[str, Any]:
    """Return the cones of the contacts of a problem; `start` : the place of the first reaction in x."""
    d, rolling = P.dimension, hasattr(P, "mu_r")
    slides = (d - 1) // 2 if rolling else d - 1
    blocks = tuple(
        ConeBlock(start + d * c, slides, d - 1 - slides, float(P.mu[c]), float(P.mu_r[c]) if rolling else 0.0)
        for c in range(P.nc)
    )
    return {"blocks": blocks, "friction": True}


@FORMS.of("fc", "rfc")
def _local(P: Any) -> Form:
    rows = _Rows()
    rows.add([P.W], P.q, -INF, INF)
    return rows.form({"r": P.q.size}, **_contacts(P, 0))


@FORMS.of("fcm")
def _joined(P: Any) -> Form:
    rows = _Rows()
    rows.add([P.W, P.V], P.q, -INF, INF)
    rows.add([dense(P.V).T, P.R], P.s, -INF, INF)
    return rows.form({"r": P.q.size, "lam": P.s.size}, **_contacts(P, 0))


@FORMS.of("gfc", "grfc")
def _global(P: Any) -> Form:
    n, m, p = P.f.size, P.w.size, P.b.size
    H, G, rows = dense(P.H), dense(P.G), _Rows()
    rows.add([P.M, -H, -G], -P.f, -INF, INF)
    rows.add([H.T, np.zeros((m, m)), np.zeros((m, p))], P.w, -INF, INF)
    rows.add([G.T, np.zeros((p, m)), np.zeros((p, p))], P.b, -INF, INF)
    return rows.form({"v": n, "r": m, "lam": p}, **_contacts(P, n))


@FORMS.of("soclcp")
def _conic(P: Any) -> Form | None:
    sets = _sets(P, 0, dual=False)
    if sets is None:
        return None
    lo, hi, blocks = sets
    rows = _Rows()
    rows.add([P.M], P.q, lo, hi)
    return rows.form({"x": P.q.size}, blocks=blocks)


@FORMS.of("coneqp")
def _cone_program(P: Any) -> Form | None:
    n, m = P.p.size, P.b.size
    sets = _sets(P, n, dual=True)
    if sets is None:
        return None
    lo, hi, blocks = sets
    A, rows = dense(P.A), _Rows()
    rows.add([P.Q, -A.T], P.p, -INF, INF)
    rows.add([A, np.zeros((m, m))], P.b, lo, hi)
    return rows.form({"x": n, "y": m}, blocks=blocks)


def _sets(P: Any, start: int, *, dual: bool) -> tuple[Vector, Vector, tuple[ConeBlock, ...]] | None:
    """Return the box and the blocks of the unknowns that are in K, or in K* where s = Ax + b is in K."""
    boxes = {Cone.FREE: (-INF, INF), Cone.ZERO: (0.0, 0.0), Cone.NONNEGATIVE: (0.0, INF)}
    if dual:
        boxes |= {Cone.FREE: (0.0, 0.0), Cone.ZERO: (-INF, INF)}
    sides: list[tuple[float, float]] = []
    blocks: list[ConeBlock] = []
    for kind, size, mu in zip(P.cone_kind, P.cone_size.astype(int), P.cone_mu, strict=True):
        if kind in boxes:
            sides += [boxes[kind]] * size
        elif kind == Cone.SECOND_ORDER and 0 < mu < INF:
            blocks.append(ConeBlock(start + len(sides), size - 1, 0, float(1 / mu if dual else mu), 0.0))
            sides += [(-INF, INF)] * size
        else:
            return None
    lo, hi = np.array(sides).reshape(-1, 2).T
    return lo, hi, tuple(blocks)
