"""The same problem in other units, by powers of two, so that no digit of the data changes; and the way back.

With x the units of the unknowns, r of the rows, s of an objective:

    lcp, relay, fc   z = xz', M' = rMx, q' = rq, bounds over x; the rows of a contact have one unit, so that its cone
                     stays what it is
    mlcp             (u, v) = xz', the whole matrix as that of an LCP
    qp               z = xz', Q' = rQx and p' = rp with r = sx; A' = aAx, b' = ab, C' = cCx, d' = cd, bounds over x;
                     λ = aλ'/s, μ = cμ'/s, ν = ν'/r
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.base import Problem
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Vector
from cpbench.registry import NodeTable
from cpbench.verification.equilibration import equilibrate

ROWS: NodeTable[str] = NodeTable("symbols of rows")
"""Symbols of the dimensions of rows."""
ROWS.enter("n", "lcp", "relay")
ROWS.enter("m", "fc")
ROWS.enter("nm", "mlcp")
ROWS.enter("nmk", "qp")
UNKNOWNS = {"z": "n", "u": "n", "v": "m", "r": "m"}
"""Symbols of the parts of an answer."""
Units = Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class InOtherUnits:
    """A problem in other units. `back` : carries its answers. `numbers` : of the sizes that were looked at."""

    problem: Problem
    back: Callable[[Any], Any]
    numbers: Mapping[str, float]


def scaled(P: Any) -> InOtherUnits | None:
    """Return the problem in units in which the entries of its symmetric matrix are about 1, and by one more unit for
    all unknowns the constants; None for a relay, and what is not listed above.

    `before`, `after` : log10 of the ratio of the largest entries of the rows, the largest to the smallest.
    """
    if P.node not in ROWS or P.node == "relay":
        return None
    K, symbols = _whole(P), ROWS[P.node]
    if P.node == "fc":
        entries = K.tocoo()
        row, column = (at // P.dimension for at in entries.coords)
        blocks = sp.csr_array((np.abs(entries.data), (row, column)), shape=(P.nc, P.nc))
        e = np.repeat(_alike(blocks), P.dimension)
    else:
        e = _alike(K)
    numbers = {"before": _decades(K), "after": _decades(_times(e, K, e))}
    units = dict(zip(symbols, np.split(e, np.cumsum([P.sizes()[s] for s in symbols])[:-1]), strict=True))
    if P.node == "qp":
        return InOtherUnits(*_changed(P, units, units, 1.0), numbers)
    t = _power(max(_top(units[s] * getattr(P, name)) for name, s in _constants(P))) or 1.0
    x, r = {s: t * unit for s, unit in units.items()}, {s: unit / t for s, unit in units.items()}
    return InOtherUnits(*_changed(P, x, r, 1.0), numbers)


def uniform(P: Any, verified: Any) -> InOtherUnits | None:
    """Return the problem with objective, rows and unknowns of size one, by one unit each, so that all ratios of entries
    of one array stay what they are; None for what is not listed above, or where nothing has a size.

    verified : an answer, whose largest unknown is the size of `unknowns`; None: that of constants over matrix entries.
    `terms` : the largest term of the objective, or of the rows where there is none, at unknowns of that size.
    """
    if P.node not in ROWS:
        return None
    answer = [] if verified is None else [getattr(verified, name) for name in P.point_sizes if name in UNKNOWNS]
    of = {name: shape[0] for name, shape in P.shapes().items() if len(shape) == 2}
    tops, constants = (
        {s: max((_top(getattr(P, name)) for name, row in named if row == s), default=0.0) for s in ROWS[P.node]}
        for named in (list(of.items()), list(_constants(P)))
    )
    if P.node == "qp":
        rows = max(tops["m"], tops["k"]), max(constants["m"], constants["k"])
        size = _size(answer, tops["n"], constants["n"]) or _size([], *rows)
        terms = max(tops["n"] * size**2, constants["n"] * size)
    else:
        size = _size(answer, max(tops.values()), max(constants.values()))
        terms = max(max(tops.values()) * size, *constants.values())
    if not (size and terms):
        return None
    t, s = _power(size), 1.0 / _power(terms)
    r = dict.fromkeys(ROWS[P.node], s)
    if P.node == "qp":
        r = {k: 1.0 / (_power(max(tops[k] * t, constants[k])) or 1.0) for k in r} | {"n": s * t}
    x, r = ({k: np.full(P.sizes()[k], v) for k, v in units.items()} for units in (dict.fromkeys(r, t), r))
    return InOtherUnits(*_changed(P, x, r, s), {"unknowns": size, "terms": terms})


def _changed(P: Any, x: Units, r: Units, objective: float) -> tuple[Any, Callable[[Any], Any]]:
    """Return the problem in these units, by the symbols of its dimensions, and the way back."""
    data: dict[str, Any] = {}
    for name, (row, *column) in P.shapes().items():
        value = getattr(P, name)
        if name in ("lb", "ub"):
            data[name] = value / x[row]
        elif row in r:
            data[name] = _times(r[row], value, x[column[0]]) if column else r[row] * value

    def back(point: Any) -> Any:
        parts = {name: x[UNKNOWNS[name]] * getattr(point, name) for name in P.point_sizes if name in UNKNOWNS}
        if P.node == "qp":
            parts |= {"lam": r["m"] * point.lam / objective, "mu": r["k"] * point.mu / objective}
            parts |= {"nu": point.nu / r["n"]}
        return type(point)(**parts)

    return replace(P, **data), back


def _constants(P: Any) -> Iterable[tuple[str, str]]:
    """Yield the names of the constants, with the symbol of their rows."""
    for name, shape in P.shapes().items():
        if len(shape) == 1 and shape[0] in ROWS[P.node] and name not in ("lb", "ub"):
            yield name, shape[0]


def _whole(P: Any) -> Any:
    """Return the matrix of all unknowns and multipliers."""
    if P.node == "mlcp":
        return sp.csr_array(matrices.block([[P.A, P.C], [P.D, P.B]]))
    if P.node == "qp":
        A, C = sp.csr_array(P.A), sp.csr_array(P.C)
        return sp.csr_array(sp.block_array([[sp.csr_array(P.Q), A.T, C.T], [A, None, None], [C, None, None]]))
    return sp.csr_array(P.W if P.node == "fc" else P.M)


def _alike(K: Any) -> Vector:
    """Return powers of two near the units in which the entries of |K| + |K|ᵀ are about 1."""
    both = sp.csr_array(abs(K) + abs(K).T)
    both.eliminate_zeros()
    return np.exp2(np.rint(np.log2(equilibrate(both)))) if both.nnz else np.ones(both.shape[0])


def _times(left: Vector, K: Matrix, right: Vector) -> Matrix:
    """Return diag(left) K diag(right), dense or sparse as K is."""
    if matrices.is_sparse(K):
        return sp.csr_array(sp.diags_array(left) @ K @ sp.diags_array(right))
    return left[:, None] * matrices.dense(K) * right[None, :]


def _decades(K: Any) -> float:
    largest = np.asarray(abs(K).max(axis=1).toarray(), dtype=float).ravel()
    largest = largest[largest > 0]
    return float(np.log10(largest.max() / largest.min())) if largest.size else 0.0


def _size(answer: list[Any], entries: float, constants: float) -> float:
    """Return the size of the unknowns: of an answer that is not 0, else constants over entries; 0 without."""
    return max(map(_top, answer), default=0.0) or (constants / entries if entries else 0.0)


def _top(values: Any) -> float:
    return float(matrices.max_abs(values)) if min(values.shape) else 0.0


def _power(size: float) -> float:
    """Return the power of two nearest to a size; 0 for 0."""
    return float(np.exp2(np.rint(np.log2(size)))) if size > 0 else 0.0
