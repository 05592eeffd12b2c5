"""Linear least squares with bounds as a quadratic program, with the residual as a further unknown:

    min ½‖r‖²  subject to  Ax − r = b, lb ≤ x ≤ ub

AᵀA, whose condition number is the square of that of A, is never formed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.errors import ProblemError
from cpbench.formulations.base import Info, Problem
from cpbench.formulations.programs import QP
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Vector

LEAST_SQUARES = "least_squares"
"""Property of a QP that is a least-squares problem: the number of its unknowns x."""


def least_squares_problem(A: Any, b: Any, lb: Any = None, ub: Any = None, name: str = "") -> QP:
    """Return the QP of min ½‖Ax − b‖² with lb ≤ x ≤ ub; A has shape (m, n), b (m,), lb and ub (n,) or one number.

    Raises ProblemError where the shapes differ, an entry is not finite, or the bounds exclude each other.
    """
    A, b = matrices.matrix(A, "least_squares.A"), matrices.vector(b, "least_squares.b")
    m, n = A.shape
    if b.size != m:
        raise ProblemError("least_squares.b", f"has {b.size} numbers, expected {m}, the rows of A")
    residual = sp.csr_array(sp.eye_array(m, format="csr", dtype=np.float64))
    return QP(
        Q=sp.csr_array(sp.block_diag([sp.csr_array((n, n)), residual], format="csr")),
        p=np.zeros(n + m),
        A=sp.csr_array((0, n + m)),
        b=np.zeros(0),
        C=sp.csr_array(sp.hstack([matrices.sparse(A), -residual])),
        d=b,
        lb=np.concatenate([_bound(lb, -np.inf, n, "lb"), np.full(m, -np.inf)]),
        ub=np.concatenate([_bound(ub, np.inf, n, "ub"), np.full(m, np.inf)]),
        name=name,
        info=Info(title=f"least squares, {m} x {n}", properties={LEAST_SQUARES: n}),
    )


def columns_of(problem: Problem) -> int | None:
    """Return the number of unknowns x of the least-squares problem that a problem is, None where it is none."""
    size = problem.info.properties.get(LEAST_SQUARES)
    if problem.node != "qp" or not isinstance(size, int | np.integer):
        return None
    return int(size) if 0 <= size <= problem.point_sizes["z"] else None


def _bound(bound: Any, absent: float, n: int, label: str) -> Vector:
    """Return a bound of each x, `absent` where none is given; raises ProblemError."""
    given = absent if bound is None else bound
    values = np.full(n, float(given)) if np.ndim(given) == 0 else matrices.vector(given, label, finite=False)
    if values.size != n:
        raise ProblemError(f"least_squares.{label}", f"has {values.size} numbers, expected {n}, the columns of A")
    return values
