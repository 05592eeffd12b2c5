"""Approximate multipliers, points and rays of a polyhedron by linear programs (HiGHS); what they prove is decided
elsewhere, in exact arithmetic."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp

from cpbench.foundation import matrices
from cpbench.foundation.matrices import Vector, power_of_two
from cpbench.proofs.polyhedra import Objective, Polyhedron

ACCURACY = 1e-10
"""HiGHS' least feasibility tolerance."""
CURVED = 5
"""Eigenvectors of negative curvature near which a ray is sought."""
LARGEST = 1000
"""Unknowns of the largest objective whose eigenvectors are computed."""
STEPS = 2
"""Further linear programs from an eigenvector near which there is no ray."""


def multipliers(P: Polyhedron, deadline: float) -> Iterator[Vector]:
    """Yield the vector (λ, μ) of the largest margin that combines the conditions to a contradiction, where there is
    one."""
    S, row, column = _scaled(P)
    n, m, k, far = S.lb.size, S.h.size, S.f.size, P.sizes.reach / column
    unit, every = sp.eye_array(n, format="csr"), np.concatenate([S.h, S.f, -S.f, S.lb, -S.ub])
    used = np.flatnonzero(np.isfinite(every))
    if used.size == 0:
        return
    balance: Any = sp.csc_array(sp.hstack([S.G.T, S.E.T, -S.E.T, unit, -unit]))[:, used]
    gain = every[used]
    cost = 1.0 + np.abs(gain) + np.where(used < m + 2 * k, abs(balance).T @ far, 0.0)

    split = sp.eye_array(m + k, format="csr")
    rows: Any = sp.hstack([split, -split[:, m:], sp.csr_array((m + k, 2 * n))], format="csr")[:, used]
    most, still = cost.max(initial=1.0), np.zeros(n)
    vertex = _least(-gain, sp.csr_array(cost[None, :]), np.array([most]), balance, still, (0.0, None), deadline)
    if vertex is None or not gain @ vertex > 0.0:
        return
    yield row * (rows @ vertex)


def interior_point(P: Polyhedron, deadline: float) -> Vector | None:
    """Return a point that meets the conditions, as far from their sides as there is room."""
    S, _, column = _scaled(P)
    n, rows = S.lb.size, np.flatnonzero(np.isfinite(S.h))
    low, high = np.flatnonzero(np.isfinite(S.lb)), np.flatnonzero(np.isfinite(S.ub))
    unit = sp.eye_array(n, format="csr")
    sides = sp.vstack([-S.G[rows], -unit[low], unit[high]], format="csr")
    room = np.concatenate([np.ones(rows.size), *(np.where(S.lb[at] < S.ub[at], 1.0, 0.0) for at in (low, high))])
    x = _least(
        np.append(np.zeros(n), -1.0),
        sp.hstack([sides, sp.csr_array(room[:, None])], format="csr"),
        np.concatenate([-S.h[rows], -S.lb[low], S.ub[high]]),
        sp.hstack([S.E, sp.csr_array((S.f.size, 1))], format="csr"),
        S.f,
        np.vstack([np.full((n, 2), (-np.inf, np.inf)), (0.0, 1.0)]),
        deadline,
    )
    return None if x is None else x[:n] * column


def rays(P: Polyhedron, goal: Objective, deadline: float) -> Iterator[Vector]:
    """Directions d that never leave the polyhedron and along which the objective curves down: those of the least
    ‖d − v‖₁ from eigenvectors v of negative curvature, else the farthest along v, then along −Qd; none where Q is too
    large for these."""
    S, _, column = _scaled(P)
    n, rows = S.lb.size, np.flatnonzero(np.isfinite(S.h))
    if not 0 < n <= LARGEST:
        return
    Q: Any = column[:, None] * matrices.sparse(goal.Q).toarray() * column
    level = sl.null_space(matrices.sparse(S.E).toarray()) if S.f.size else np.eye(n)
    values, vectors = np.linalg.eigh(level.T @ (Q + Q.T) @ level)
    curved = [v / np.abs(v).max() for v in (level @ vectors[:, (values < 0.0) & (np.arange(values.size) < CURVED)]).T]
    unit, still = sp.eye_array(n, format="csr"), sp.csr_array((rows.size, n))
    sides: Any = sp.block_array([[unit, -unit], [-unit, -unit], [-matrices.sparse(S.G)[rows], still]], format="csr")
    equal = sp.hstack([S.E, sp.csr_array((S.f.size, n))], format="csr")
    cone = np.stack([np.maximum(S.recession.lb, -1.0), np.minimum(S.recession.ub, 1.0)], axis=1)
    bounds = np.vstack([cone, np.full((n, 2), (0.0, np.inf))])
    cost = np.concatenate([np.zeros(n), np.ones(n)])
    for v in chain.from_iterable((v, -v) for v in curved):
        limits = np.concatenate([v, -v, np.zeros(rows.size)])
        ray, slope = _least(cost, sides, limits, equal, np.zeros(S.f.size), bounds, deadline), -v
        for _ in range(STEPS):
            if ray is None or ray[:n] @ Q @ ray[:n] < 0.0:
                break
            ray = _least(slope, -S.G[rows], limits[2 * n :], S.E, np.zeros(S.f.size), cone, deadline)
            slope = slope if ray is None else (Q + Q.T) @ ray
        if ray is not None and ray[:n] @ Q @ ray[:n] < 0.0:
            yield ray[:n] * column


def _scaled(P: Polyhedron) -> tuple[Polyhedron, Vector, Vector]:
    """Return it in units of its sizes, to powers of two, and these: x = column·x', multipliers = row·theirs."""
    row, column = power_of_two(P.sizes.rows), 1.0 / power_of_two(P.sizes.unknowns)
    right: Any = sp.diags_array(column)
    m = P.h.size
    G, E = (sp.csr_array(sp.diags_array(d) @ sp.csr_array(A) @ right) for d, A in ((row[:m], P.G), (row[m:], P.E)))
    with np.errstate(all="ignore"):
        scaled = replace(P, G=G, h=P.h * row[:m], E=E, f=P.f * row[m:], lb=P.lb / column, ub=P.ub / column)
    return scaled, row, column


def _least(cost: Vector, A: Any, b: Vector | None, E: Any, f: Vector, bounds: Any, deadline: float) -> Vector | None:
    """Return a minimiser of costᵀx over Ax ≤ b, Ex = f and the bounds; None where HiGHS gives none in time."""
    from scipy.optimize import linprog  # slow to import, and rarely needed

    left = deadline - time.perf_counter()
    numbers: list[Any] = [part for part in (cost, A, b, E, f) if part is not None]
    if left <= 0.0 or not all(
        np.isfinite(sp.coo_array(part).data).all() for part in numbers
    ):  # 1 over a subnormal number is not
        return None
    options: Any = {"primal_feasibility_tolerance": ACCURACY, "dual_feasibility_tolerance": ACCURACY}
    if math.isfinite(left):
        options["time_limit"] = left
    A, b = (None, None) if A is None or A.shape[0] == 0 else (A, b)
    E, f_ = (None, None) if E.shape[0] == 0 else (E, f)
    program: Any = linprog(cost, A_ub=A, b_ub=b, A_eq=E, b_eq=f_, bounds=bounds, method="highs-ds", options=options)
    if program.x is None or program.status not in (0, 3):
        return None
    return np.asarray(program.x, dtype=np.float64)
