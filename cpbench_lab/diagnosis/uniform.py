"""The same problem with objective, rows and unknowns of size one, each by one power of two; and the way back.

    lcp   z = tz',        M' = rtM,  q' = rq            (relay, avi: bounds over t; fc: r_c = tr_c')
    mlcp  (u, v) = tx',   the whole matrix as that of an LCP
    qp    z = tz', Q' = st²Q, p' = stp, A' = atA, b' = ab, C' = ctC, d' = cd, bounds over t;
          λ = aλ'/s, μ = cμ'/s, ν = ν'/(st)

Nothing but the overall magnitude changes: all ratios of entries of one array stay what they are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from cpbench.formulations.base import Problem
from cpbench.foundation import matrices
from cpbench.registry import NodeTable


@dataclass(frozen=True, eq=False)
class Uniform:
    """A problem of size one. `back` : carries its answers. `unknowns` : the size that was taken for them.
    `terms` : the largest term of the objective, or of the rows where there is none, at unknowns of that size."""

    problem: Problem
    back: Callable[[Any], Any]
    unknowns: float
    terms: float


UNIFORM: NodeTable[Callable[[Any, Any], Uniform | None]] = NodeTable("sizes of one")
"""Function that returns a problem with sizes of one, `known` as of `uniform`."""


def uniform(problem: Any, known: Any) -> Uniform | None:
    """Return the problem with sizes of one; None for formulations not listed above, or where nothing has a size.

    `known` : a verified answer, whose largest unknown is their size; None: that of constants over matrix entries.
    """
    make = UNIFORM.get(problem.node)
    return make(problem, known) if make is not None else None


def _linear(P: Any, known: Any, names: str, constants: str, unknowns: str) -> Uniform | None:
    """Return w = Mz + q by matrices, constants and unknowns of one letter each."""
    K, k = ({name: getattr(P, name) for name in some} for some in (names, constants))
    size = _size(known and [getattr(known, name) for name in unknowns], K.values(), k.values())
    terms = max(max(map(_top, K.values())) * size, *map(_top, k.values()))
    if not (size and terms):
        return None
    t, r = _power(size), 1.0 / _power(terms)
    data = {name: r * t * M for name, M in K.items()} | {name: r * v for name, v in k.items()}
    bounds = {name: getattr(P, name) / t for name in ("lb", "ub") if hasattr(P, name)}
    return Uniform(
        replace(P, **data, **bounds),
        lambda point: type(point)(**{name: t * getattr(point, name) for name in unknowns}),
        size,
        terms,
    )


UNIFORM.enter(partial(_linear, names="M", constants="q", unknowns="z"), "lcp", "relay")
UNIFORM.enter(partial(_linear, names="W", constants="q", unknowns="r"), "fc")
UNIFORM.enter(partial(_linear, names="ABCD", constants="ab", unknowns="uv"), "mlcp")


@UNIFORM.of("qp")
def _qp(P: Any, known: Any) -> Uniform | None:
    size = _size(known and [known.z], [P.Q], [P.p]) or _size(None, [P.A, P.C], [P.b, P.d])
    terms = max(_top(P.Q) * size**2, _top(P.p) * size)
    if not (size and terms):
        return None
    t, s = _power(size), 1.0 / _power(terms)
    a, c = (1.0 / (_power(max(_top(K) * t, _top(k))) or 1.0) for K, k in ((P.A, P.b), (P.C, P.d)))
    data = {"Q": s * t * t * P.Q, "p": s * t * P.p, "A": a * t * P.A, "b": a * P.b, "C": c * t * P.C, "d": c * P.d}
    return Uniform(
        replace(P, **data, lb=P.lb / t, ub=P.ub / t),
        lambda point: type(point)(z=t * point.z, lam=a * point.lam / s, mu=c * point.mu / s, nu=point.nu / (s * t)),
        size,
        terms,
    )


def _size(known: Any, over: Any, constants: Any) -> float:
    """Return the size of the unknowns: of a known answer that is not 0, else constants over entries; 0 without."""
    at_answer = max(map(_top, known), default=0.0) if known else 0.0
    entries = max(map(_top, over), default=0.0)
    return at_answer or (max(map(_top, constants), default=0.0) / entries if entries else 0.0)


def _top(values: Any) -> float:
    return float(matrices.max_abs(values)) if min(values.shape) else 0.0


def _power(size: float) -> float:
    """Return the power of two nearest to a size; 0 for 0."""
    return float(np.exp2(np.rint(np.log2(size)))) if size > 0 else 0.0
