"""The boxed linear complementarity problem with friction index of physics engines (ODE, DART, Bullet, Gazebo) as an
AVI:

    Ax = b + w,  lo ≤ x ≤ hi,  w_i ≥ 0 where x_i = lo_i,  w_i ≤ 0 where x_i = hi_i,  w_i = 0 between

This is the sign of ODE's dSolveLCP (`lcp.cpp`: "solve A*x = b+w"), of DART's BoxedLcpSolver and of Bullet's MLCP. Where
yours is w = Ax + b, take −b. A row with findex_i = −1 has constant bounds. A row i with findex_i = j ≥ 0 (counted from
0) is friction at the normal row j: hi_i is its coefficient of friction, and −hi_i x_j ≤ x_i ≤ hi_i x_j.

Without friction rows it is the AVI with M = A, q = −b over the box, exactly. With k of them there are 2k more unknowns:
x_i is free, w_i = κ − κ', 0 ≤ κ ⟂ hi_i x_j + x_i ≥ 0, 0 ≤ κ' ⟂ hi_i x_j − x_i ≥ 0; z = (x, κ, κ'). The bounds belong
to the x_j of the answer itself, as in the limit of projected Gauss-Seidel sweeps. The Dantzig solvers of these engines
take x_j once, from the rows before the first friction row, where all friction is 0: another law.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.errors import ProblemError
from cpbench.formulations.base import Info, Problem
from cpbench.formulations.linear import AVI
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Vector

BOXED = "boxed_lcp"
"""Property of an AVI that is a boxed LCP: the number of its unknowns x."""
_CONVENTION = "Ax = b + w, lo <= x <= hi, w >= 0 at lo, w <= 0 at hi; with findex_i = j >= 0: |x_i| <= hi_i x_j"


def boxed_problem(A: Any, b: Any, lo: Any, hi: Any, findex: Any = None, name: str = "") -> AVI:
    """Return the AVI of a boxed LCP: A (n, n), b, lo, hi (n,), bounds finite or not; findex (n,) whole numbers, −1 for
    constant bounds, None for −1 everywhere.

    Raises ProblemError where the shapes differ or a bound is not one that the law has.
    """
    A = matrices.matrix(A, "boxed.A")
    b, lo, hi = (
        matrices.vector(part, f"boxed.{label}", finite=label == "b")
        for label, part in zip(("b", "lo", "hi"), (b, lo, hi), strict=True)
    )
    n = b.size
    normal = _whole(np.full(n, -1.0) if findex is None else findex)
    for label, size in (("lo", lo.size), ("hi", hi.size), ("findex", normal.size)):
        if size != n:
            raise ProblemError(f"boxed.{label}", f"has {size} numbers, expected {n} as b has")
    if A.shape != (n, n):
        raise ProblemError("boxed.A", f"is {A.shape[0]} x {A.shape[1]}, expected {n} x {n} as b has {n} numbers")
    friction = np.flatnonzero(normal >= 0)
    _require_law(lo, hi, normal, friction)
    lb, ub = lo.copy(), hi.copy()
    lb[friction], ub[friction] = -np.inf, np.inf
    more = np.zeros(2 * friction.size)
    return AVI(
        M=_with_friction(A, hi, normal, friction) if friction.size else A,
        q=np.concatenate([-b, more]),
        lb=np.concatenate([lb, more]),
        ub=np.concatenate([ub, np.full(more.size, np.inf)]),
        name=name,
        info=Info(
            title=f"boxed LCP, {n} rows, {friction.size} with friction index",
            math_info=_CONVENTION,
            properties={BOXED: n},
        ),
    )


def rows_of(problem: Problem) -> int | None:
    """Return the number of unknowns x of the boxed LCP that a problem is, None where it is none."""
    size = problem.info.properties.get(BOXED)
    if problem.node != "avi" or not isinstance(size, int | np.integer):
        return None
    return int(size) if 0 <= size <= problem.point_sizes["z"] else None


def _whole(findex: Any) -> Any:
    """Return the friction index as whole numbers; raises ProblemError."""
    given = matrices.vector(findex, "boxed.findex")
    wrong = np.flatnonzero((given != np.floor(given)) | (given < -1) | (given >= given.size))
    if wrong.size:
        i = int(wrong[0])
        raise ProblemError(
            "boxed.findex", f"is {given[i]:g} at row {i}, expected -1 or a row from 0 to {given.size - 1}"
        )
    return given.astype(np.int64)


def _require_law(lo: Vector, hi: Vector, normal: Any, friction: Any) -> None:
    """Raise ProblemError where a friction row has bounds or a normal row that the law does not have."""
    for i in friction.tolist():
        j = int(normal[i])
        if normal[j] >= 0:
            raise ProblemError("boxed.findex", f"is {j} at row {i}, and row {j} has a friction index itself")
        if not lo[j] >= 0.0:
            raise ProblemError("boxed.lo", f"is {lo[j]:g} at row {j}, the normal row of row {i}, expected at least 0")
        if not 0.0 <= hi[i] < np.inf:
            text = f"is {hi[i]:g} at row {i} with a friction index, expected a coefficient of friction"
            raise ProblemError("boxed.hi", f"{text}; for no slip write findex -1 and infinite bounds")
        if lo[i] != -hi[i]:
            raise ProblemError("boxed.lo", f"is {lo[i]:g} at row {i} with a friction index, expected -hi = {-hi[i]:g}")


def _with_friction(A: Any, hi: Vector, normal: Any, friction: Any) -> Any:
    """Return M of z = (x, κ, κ')."""
    n, k = A.shape[0], friction.size
    every = np.arange(k)
    own = sp.csr_array((np.ones(k), (every, friction)), shape=(k, n))
    bound = sp.csr_array((hi[friction], (every, normal[friction])), shape=(k, n))
    M = sp.csr_array(
        sp.block_array([[matrices.sparse(A), -own.T, own.T], [bound + own, None, None], [bound - own, None, None]])
    )
    return M if matrices.is_sparse(A) else M.toarray()
