"""The error by which solvers of affine problems end: that of norms, and the verdict's."""

from __future__ import annotations

from typing import Any, TypeAlias
from weakref import WeakKeyDictionary

import numpy as np

from cpbench.formulations.linear import AVI, LCP, MLCP, Relay
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Vector
from cpbench_solvers.kernels import linear_error, linear_rows, qp_sparse
from cpbench_solvers.qp.kkt_system import entries

Affine: TypeAlias = LCP | MLCP | Relay | AVI
_DATA: WeakKeyDictionary[Any, Any] = WeakKeyDictionary()
_ROWS: WeakKeyDictionary[Any, Any] = WeakKeyDictionary()
NONE = np.zeros(0)


def data_of(problem: Affine) -> Any:
    """Return M, the rows of A and then of C, q, the sides of the rows, how many are of A, and the box, for compiled
    loops; made once. Those of an MLCP have u before v."""
    if problem in _DATA:
        return _DATA[problem]
    inf, P = np.inf, problem
    rows, sides, count = (np.zeros(1, np.int32), np.zeros(0, np.int32), NONE), NONE, 0
    if isinstance(P, MLCP):
        M, q, low = matrices.block([[P.A, P.C], [P.D, P.B]]), np.concatenate([P.a, P.b]), np.zeros(P.a.size + P.b.size)
        low[: P.a.size] = -inf
    else:
        M, q, low = P.M, P.q, np.zeros(P.q.size) if isinstance(P, LCP) else P.lb
    high = P.ub if isinstance(P, Relay | AVI) else np.full(q.size, inf)
    if isinstance(P, AVI) and not P.only_box:
        rows = qp_sparse.stacked(entries(P.A), entries(P.C))
        sides, count = np.concatenate([P.b, P.d]), P.b.size
    result = _DATA[problem] = entries(M), rows, q, sides, count, low, high
    return result


def rows_of(problem: Affine) -> Any:
    """Return the rows of a problem, as the kernel `linear_rows` has them, made once."""
    if problem not in _ROWS:
        _ROWS[problem] = linear_rows.linear(*data_of(problem), False)
    return _ROWS[problem]


def verdict_error(problem: Affine, x: Vector) -> float:
    """Return the verdict's error (`linear_error`); 8 eps for an answer that is exact to rounding, as nearly all of
    pivoting are. x : z, or u and v, then multipliers."""
    kernel = linear_error
    if kernel.exact(*data_of(problem), x):
        return kernel.NOISE
    return kernel.largest_error(rows_of(problem), x, NONE)


def error_of(problem: AVI | Relay, point: Any, tolerance: float) -> float:
    """Return the error of norms (`residuals`) or, where that is within the tolerance, the verdict's if that is
    larger; infinity for an answer that is not finite."""
    x, kernel = point.vector, linear_error
    if kernel.exact(*data_of(problem), x):
        return kernel.NOISE
    if not point.finite:
        return np.inf
    error = problem.residuals(point, tolerance).error
    return max(error, kernel.largest_error(rows_of(problem), x, NONE)) if error <= tolerance else error
