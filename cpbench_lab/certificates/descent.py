"""Directions that refute answers to programs and variational inequalities with rows, whatever their multipliers.

At a solution z*, (Mz* + q)ᵀd ≥ 0 for every d that keeps the conditions that bind there: Aᵢd ≥ 0 for rows with
Aᵢz* = bᵢ, Cd = 0, and dⱼ ≥ 0 or ≤ 0 at a bound. Where d does so for all conditions that may bind in a box around an
answer, and (Mz + q)ᵀd < 0 all over it, the box holds no solution. A linear program in doubles gives d; conditions that
are tight are then solved for over the rationals, and everything is checked exactly.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.optimize import linprog

from cpbench.foundation.matrices import Sparse, Vector
from cpbench.verification.sets import INFINITE
from cpbench_lab.certificates.exact_rows import ExactRows, rational, regular_part, solve

LARGEST = 300
"""Unknowns of the largest system that is solved for a direction."""
TIGHT = 1e-9
"""Share of a row's sum below which it is taken for 0, and so for tight: a hint."""
SECONDS = 2.0
"""Limit of a linear program [s]."""


@dataclass(frozen=True, eq=False)
class WithRows:
    """Solutions z of a variational inequality over Az ≥ b, Cz = d, lb ≤ z ≤ ub, with exact copies of Mᵀ and of the
    rows."""

    M: Sparse
    q: Vector
    rows: Sparse
    low: Vector
    high: Vector
    lb: Vector
    ub: Vector
    transposed: ExactRows
    exact_rows: ExactRows

    @classmethod
    def of(cls, problem: Any) -> WithRows:
        """Return a `qp` or an `avi`; an equation is a row with both sides."""
        M, q = (problem.Q, problem.p) if problem.node == "qp" else (problem.M, problem.q)
        M, rows = sp.csr_array(M), sp.csr_array(sp.vstack([sp.csr_array(problem.A), sp.csr_array(problem.C)]))
        low = np.concatenate([np.where(problem.b > -INFINITE, problem.b, -np.inf), problem.d])
        high = np.concatenate([np.full(problem.b.size, np.inf), problem.d])
        lb = np.where(problem.lb <= -INFINITE, -np.inf, problem.lb)
        ub = np.where(problem.ub >= INFINITE, np.inf, problem.ub)
        return cls(M, q, rows, low, high, lb, ub, ExactRows.of(sp.csr_array(M.T)), ExactRows.of(rows))


def direction(P: WithRows, z: Vector, radius: float) -> Mapping[str, NDArray[Any]] | None:
    """Return the evidence that no solution is within `radius` of z; None where none is found.

    `direction` has what d is held at, NaN where it is solved for by the rows `direction_rows` = 0, for the unknowns
    `direction_columns`; it is 0 where some condition fails all over the box.
    """
    n, none = z.size, np.zeros(0, dtype=np.int64)
    if _outside(P, z, radius):
        return {"direction": np.zeros(n), "direction_rows": none, "direction_columns": none}
    d = _hint(P, z, radius)
    if d is None:
        return None
    sizes = abs(P.rows) @ np.ones(n)
    tight = np.flatnonzero((np.abs(P.rows @ d) <= TIGHT * sizes) & (sizes > 0) & _may_bind(P, z, radius))
    inside = np.flatnonzero((np.abs(d) > TIGHT) & (np.abs(d) < 1.0))
    if inside.size > LARGEST or tight.size > LARGEST:
        return None
    rows = columns = none
    if inside.size and tight.size:
        rows, columns = regular_part(P.exact_rows, tight, inside, d[inside])
    held = d.copy()
    held[np.abs(d) <= TIGHT] = 0.0
    held[columns] = np.nan
    exact = [rational(0.0 if v != v else v) for v in held.tolist()]
    sides = [-v for v in P.exact_rows.products(exact, rows.tolist())]
    part = solve(P.exact_rows, rows, columns, sides) if rows.size else []
    if part is None:
        return None
    for j, value in zip(columns.tolist(), part, strict=True):
        exact[j] = value
    found = {"direction": held, "direction_rows": rows, "direction_columns": columns}
    return found if _refutes(P, z, radius, exact) else None


def _hint(P: WithRows, z: Vector, radius: float) -> Vector | None:
    """Return the direction of steepest descent in the ∞-norm that keeps what may bind, in doubles."""
    slope, bind = P.M @ z + P.q, _may_bind(P, z, radius)
    equal = bind & (P.low == P.high)
    above = bind & ~equal
    scale: Any = abs(P.rows) @ np.ones(z.size)
    unit: Any = sp.csr_array(sp.diags_array(1.0 / np.where(scale > 0, scale, 1.0)) @ P.rows)
    lower = np.where(z - radius <= P.lb, 0.0, -1.0)
    upper = np.where(z + radius >= P.ub, 0.0, 1.0)
    size = np.abs(slope).max(initial=0.0)
    if not (np.isfinite(size) and size > 0 and np.isfinite(unit.data).all()):
        return None
    found: Any = linprog(
        slope / size,
        A_ub=-unit[above] if above.any() else None,
        b_ub=np.zeros(int(above.sum())) if above.any() else None,
        A_eq=unit[equal] if equal.any() else None,
        b_eq=np.zeros(int(equal.sum())) if equal.any() else None,
        bounds=np.column_stack([lower, upper]),
        method="highs-ds",
        options={"time_limit": SECONDS},
    )
    return np.asarray(found.x) if found.x is not None and found.fun < 0 else None


def _may_bind(P: WithRows, z: Vector, radius: float) -> NDArray[np.bool_]:
    """Return the rows that are not clearly away from their lower side all over the box; more than these do no harm."""
    reach = abs(P.rows) @ (np.abs(z) * 1e-12 + radius)
    return P.rows @ z - reach <= P.low


def _outside(P: WithRows, z: Vector, radius: float) -> bool:
    """Return whether one condition fails all over the box."""
    r, x = rational(radius), [rational(v) for v in z.tolist()]
    beside = [(v, r, low, high) for v, low, high in zip(x, P.lb.tolist(), P.ub.tolist(), strict=True)]
    reach = P.exact_rows.products([r] * z.size, absolute=True)
    values = P.exact_rows.products(x)
    beside += zip(values, reach, P.low.tolist(), P.high.tolist(), strict=True)
    return any(
        (low > -np.inf and v + away < rational(low)) or (high < np.inf and v - away > rational(high))
        for v, away, low, high in beside
    )


def _refutes(P: WithRows, z: Vector, radius: float, d: Sequence[Any]) -> bool:
    """Return whether d keeps all that may bind in the box, and descends all over it: exactly."""
    r, x, n = rational(radius), [rational(v) for v in z.tolist()], z.size
    for v, own, low, high in zip(x, d, P.lb.tolist(), P.ub.tolist(), strict=True):
        if (own < 0 and low > -np.inf and v - r <= rational(low)) or (
            own > 0 and high < np.inf and v + r >= rational(high)
        ):
            return False
    moved, values = P.exact_rows.products(d), P.exact_rows.products(x)
    reach = P.exact_rows.products([r] * n, absolute=True)
    for step, v, away, low, high in zip(moved, values, reach, P.low.tolist(), P.high.tolist(), strict=True):
        if low == high and step != 0:
            return False
        if step < 0 and low > -np.inf and v - away <= rational(low):
            return False
    slope = P.transposed.products(d)
    total = sum((a * v + abs(a) * r for a, v in zip(slope, x, strict=True)), rational(0.0))
    return total + sum((rational(a) * v for a, v in zip(P.q.tolist(), d, strict=True)), rational(0.0)) < 0
