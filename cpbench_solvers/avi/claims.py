"""The error by which solvers of affine variational inequalities end: that of norms, and that of connected parts."""

from __future__ import annotations

from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from cpbench.formulations.avi import AVI
from cpbench.formulations.relay import Relay
from cpbench.foundation.kernel_cache import load
from cpbench_solvers.qp.kkt_system import entries

_DATA: WeakKeyDictionary[Any, Any] = WeakKeyDictionary()
_PROGRAMS: WeakKeyDictionary[Any, Any] = WeakKeyDictionary()


def data_of(problem: AVI | Relay) -> Any:
    """Return M, the rows of A and then of C, their sides, and how many are of A, for compiled loops; made once."""
    if problem in _DATA:
        return _DATA[problem]
    if isinstance(problem, AVI) and not problem.only_box:
        G = load("cpbench_solvers.kernels.qp_sparse").stacked(entries(problem.A), entries(problem.C))
        result = entries(problem.M), G, np.concatenate([problem.b, problem.d]), problem.b.size
    else:
        none = np.zeros(0)
        result = entries(problem.M), (np.zeros(1, np.int32), np.zeros(0, np.int32), none), none, 0
    _DATA[problem] = result
    return result


def program_of(problem: AVI | Relay) -> Any:
    """Return the rows of a problem with their connected parts, as the kernel `affine_parts` has them, found once."""
    if problem not in _PROGRAMS:
        M, G, sides, count = data_of(problem)
        affine = load("cpbench_solvers.kernels.affine_parts").affine
        _PROGRAMS[problem] = affine(M, G, problem.q, sides, count, problem.lb, problem.ub)
    return _PROGRAMS[problem]


def error_of(problem: AVI | Relay, point: Any, tolerance: float) -> float:
    """Return the larger one of the error of norms (`residuals`) and, where that is within the tolerance, of that of the
    connected parts (`affine_rows`); 8 eps for an answer that is exact to rounding, as nearly all of pivoting are, and
    infinity for one that is not finite."""
    x, kernel = point.vector, load("cpbench_solvers.kernels.affine_rows")
    M, G, sides, count = data_of(problem)
    if kernel.exact(M, G, problem.q, sides, count, problem.lb, problem.ub, x):
        return kernel.NOISE
    if not point.finite:
        return np.inf
    error = problem.residuals(point, tolerance).error
    return max(error, kernel.largest_error(program_of(problem), x)) if error <= tolerance else error
