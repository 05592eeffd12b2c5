"""Reduced problems in one form, which programs in other languages check: Kx + k beside a box, and friction cones."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from cpbench.formulations.base import Problem
from cpbench.foundation.cones import Cone
from cpbench.foundation.matrices import Dense, Vector, dense
from cpbench.registry import NodeTable


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


def _form(names: Mapping[str, int], *rows: tuple[list[Any], Vector, Any, Any], **more: Any) -> Form:
    """Return a form from its rows, part by part: blocks of K by columns, k, lo and hi, the last two numbers or (m,)."""
    k, lo, hi = (np.concatenate([np.broadcast_to(row[i], row[1].shape) for row in rows]) for i in (1, 2, 3))
    return Form(np.block([[dense(B) for B in row[0]] for row in rows]), k, lo, hi, names=names, **more)


INF = np.inf
FORMS: NodeTable[Callable[[Any], Form | None]] = NodeTable("box and cones", "reduce writes no script in C++ or Julia")
"""Function that returns a problem as a `Form`."""


def form(problem: Problem) -> Form | None:
    """Return a problem in this form; None where it has none: nonlinear maps, cones that are not of friction."""
    make = FORMS.get(problem.node)
    return None if make is None else make(problem)


@FORMS.of("lcp")
def _lcp(P: Any) -> Form:
    return _form({"z": P.q.size}, ([P.M], P.q, 0.0, INF))


@FORMS.of("relay")
def _relay(P: Any) -> Form:
    return _form({"z": P.q.size}, ([P.M], P.q, P.lb, P.ub))


@FORMS.of("mlcp")
def _mlcp(P: Any) -> Form:
    sizes = {"u": P.a.size, "v": P.b.size}
    return _form(sizes, ([P.A, P.C], P.a, -INF, INF), ([P.D, P.B], P.b, 0.0, INF))


@FORMS.of("qp", "avi")
def _program(P: Any) -> Form:
    M, q = (P.Q, P.p) if P.node == "qp" else (P.M, P.q)
    n, m, k = q.size, P.b.size, P.d.size
    A, C = dense(P.A), dense(P.C)
    return _form(
        {"z": n, "lam": m, "mu": k},
        ([M, -A.T, -C.T], q, P.lb, P.ub),
        ([A, np.zeros((m, m)), np.zeros((m, k))], -P.b, 0.0, INF),
        ([C, np.zeros((k, m)), np.zeros((k, k))], -P.d, -INF, INF),
    )


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
    return _form({"r": P.q.size}, ([P.W], P.q, -INF, INF), **_contacts(P, 0))


@FORMS.of("fcm")
def _joined(P: Any) -> Form:
    rows = ([P.W, P.V], P.q, -INF, INF), ([dense(P.V).T, P.R], P.s, -INF, INF)
    return _form({"r": P.q.size, "lam": P.s.size}, *rows, **_contacts(P, 0))


@FORMS.of("gfc", "grfc")
def _global(P: Any) -> Form:
    n, m, p = P.f.size, P.w.size, P.b.size
    H, G = dense(P.H), dense(P.G)
    return _form(
        {"v": n, "r": m, "lam": p},
        ([P.M, -H, -G], -P.f, -INF, INF),
        ([H.T, np.zeros((m, m)), np.zeros((m, p))], P.w, -INF, INF),
        ([G.T, np.zeros((p, m)), np.zeros((p, p))], P.b, -INF, INF),
        **_contacts(P, n),
    )


@FORMS.of("soclcp")
def _conic(P: Any) -> Form | None:
    sets = _sets(P, 0, dual=False)
    if sets is None:
        return None
    lo, hi, blocks = sets
    return _form({"x": P.q.size}, ([P.M], P.q, lo, hi), blocks=blocks)


@FORMS.of("coneqp")
def _cone_program(P: Any) -> Form | None:
    n, m = P.p.size, P.b.size
    sets = _sets(P, n, dual=True)
    if sets is None:
        return None
    lo, hi, blocks = sets
    A = dense(P.A)
    rows = ([P.Q, -A.T], P.p, -INF, INF), ([A, np.zeros((m, m))], P.b, lo, hi)
    return _form({"x": n, "y": m}, *rows, blocks=blocks)


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
