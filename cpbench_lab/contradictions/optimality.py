"""Conditions of optimality and size of the objective of a program, by code that shares nothing with the verdict."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.formulations import QP
from cpbench.formulations.programs import QPPoint
from cpbench.foundation import matrices
from cpbench.foundation.matrices import max_abs


def meets_conditions(program: QP, x: QPPoint, share: float) -> bool:
    """Return whether a point misses no condition of Karush, Kuhn and Tucker by more than `share`.

    A row may be missed by its share of |b_i|, and of its largest entry times the largest unknown; a bound by that of
    the largest unknown; a component of stationarity by that of |p_j|, of the largest entry of its column of Q times the
    largest unknown, and of that of A, C and the bounds times the largest multiplier, in units in which the largest
    entry of a row is 1; the gap between primal and dual objective by that of |f|. Multipliers have the right sign.
    """
    return _feasible(program, x, share) and _stationary(program, x, share) and _no_gap(program, x, share)


def _rows(program: QP) -> Any:
    return matrices.sparse(matrices.block([[program.A], [program.C]]))


def _feasible(program: QP, x: QPPoint, share: float) -> bool:
    rows, m, top = _rows(program), program.b.size, max_abs(x.z)
    sides = np.concatenate([program.b, program.d])
    missed = sides - rows @ x.z
    missed[m:] = abs(missed[m:])
    allowed = share * (abs(rows).max(axis=1).toarray().ravel() * top + abs(sides))
    within = (program.lb - x.z <= share * top) & (x.z - program.ub <= share * top)
    return bool((missed <= allowed).all() and within.all())


def _stationary(program: QP, x: QPPoint, share: float) -> bool:
    rows, multipliers = _rows(program), np.concatenate([x.lam, x.mu])
    size = abs(rows).max(axis=1).toarray().ravel()
    unit_rows: Any = sp.diags_array(1.0 / np.where(size > 0.0, size, 1.0)) @ abs(rows)
    force = max(max_abs(multipliers * size), max_abs(x.nu))
    columns = np.maximum(unit_rows.max(axis=0).toarray().ravel(), x.nu != 0.0)
    Q = abs(matrices.sparse(program.Q)).max(axis=1).toarray().ravel()
    missed = program.Q @ x.z + program.p - rows.T @ multipliers - x.nu
    return bool((abs(missed) <= share * (Q * max_abs(x.z) + abs(program.p) + columns * force)).all())


def _no_gap(program: QP, x: QPPoint, share: float) -> bool:
    at = x.nu != 0.0
    bounds = np.where(x.nu > 0.0, program.lb, program.ub)[at]
    if (x.lam < 0.0).any() or not np.isfinite(bounds).all():
        return False
    dual = program.b @ x.lam + program.d @ x.mu + bounds @ x.nu[at]
    gap = x.z @ (program.Q @ x.z) + program.p @ x.z - dual
    return bool(abs(gap) <= share * abs(program.objective(x.z)))


def objective_unit(program: Any) -> float:
    """Return the size of an objective by the data alone, the same in all units of unknowns: Σ p_i²/Q_ii, and |p_i|
    times the larger finite bound of an unknown with Q_ii = 0; 0 where there is neither."""
    diagonal, p = np.asarray(program.Q.diagonal()), program.p
    curved = diagonal > 0.0
    unit = float((p[curved] ** 2 / diagonal[curved]).sum())
    if isinstance(program, QP):
        bounds = np.maximum(*(np.where(np.isfinite(bound), abs(bound), 0.0) for bound in (program.lb, program.ub)))
        unit += float(abs(p[~curved]) @ bounds[~curved])
    return unit
