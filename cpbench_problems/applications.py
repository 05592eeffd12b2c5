"""Problems as other fields write them, with their own unknowns in an answer: bimatrix games as LCPs, linear least
squares with bounds as QPs, boxed LCPs of rigid-body engines as AVIs.

Bimatrix games as linear complementarity problems (Cottle, Pang, Stone, *The Linear Complementarity Problem*, §1.4).

Two players choose a row and a column; x and y are the probabilities of their choices. Payoffs become costs > 0, since a
constant added to all payoffs of a player changes no equilibrium:

    Â = max A − A + s,  B̂ = max B − B + s,  s = max − min of each (1 where that is 0)
    0 ≤ u ⟂ Âv − 1 ≥ 0,  0 ≤ v ⟂ B̂ᵀu − 1 ≥ 0;  x = u/Σu, y = v/Σv

Every solution is an equilibrium, and every equilibrium is one solution: v = y/(xᵀÂy), u = x/(xᵀB̂y). The differences
are exact where payoffs are integers.

Linear least squares with bounds as a quadratic program, with the residual as a further unknown:

    min ½‖r‖²  subject to  Ax − r = b, lb ≤ x ≤ ub

AᵀA, whose condition number is the square of that of A, is never formed.

The boxed linear complementarity problem with friction index of physics engines (ODE, DART, Bullet, Gazebo) as an
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

from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.errors import PointError, ProblemError
from cpbench.formulations.base import Info, Point, Problem
from cpbench.formulations.linear import AVI, LCP, LCPPoint
from cpbench.formulations.programs import QP
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Dense, Vector

GAME = "game"
"""Property of an LCP that is a game: the number of rows and of columns."""


def game_problem(A: Any, B: Any, name: str = "") -> LCP:
    """Return the LCP of a game with payoffs A and B, shape (m, n), of the player who chooses the row and of the other.

    Raises ProblemError where the shapes differ, a matrix is empty, or an entry is not finite.
    """
    costs = [_costs(payoff, label) for payoff, label in ((A, "A"), (B, "B"))]
    (m, n), other = costs[0].shape, costs[1].shape
    if other != (m, n):
        raise ProblemError("game.B", f"is {other[0]} x {other[1]}, expected {m} x {n} as A is")
    M = np.zeros((m + n, m + n))
    M[:m, m:], M[m:, :m] = costs[0], costs[1].T
    info = Info(title=f"bimatrix game, {m} x {n}", properties={GAME: [m, n]})
    return LCP(M=M, q=-np.ones(m + n), name=name, info=info)


def game_sizes(problem: Problem) -> tuple[int, int] | None:
    """Return the rows and columns of the game that a problem is, None where it is none."""
    sizes = problem.info.properties.get(GAME)
    if problem.node != "lcp" or not isinstance(sizes, list | tuple | np.ndarray) or len(sizes) != 2:
        return None
    m, n = (int(size) if isinstance(size, int | np.integer) else 0 for size in sizes)
    return (m, n) if min(m, n) > 0 and m + n == sum(problem.point_sizes.values()) else None


def strategies(problem: Problem, point: Point) -> tuple[Vector, Vector]:
    """Return the probabilities (x, y), shapes (m,) and (n,), of an answer to a problem that is a game: its two parts,
    each divided by its sum, negative entries as 0.

    Raises PointError where a part has no positive number, or an infinite one.
    """
    sizes = game_sizes(problem)
    if sizes is None or not isinstance(point, LCPPoint):
        raise PointError(f"{problem.node}: is no game")
    parts: list[Vector] = []
    for name, part in (("x", point.z[: sizes[0]]), ("y", point.z[sizes[0] :])):
        positive = np.maximum(part, 0.0)
        largest = float(positive.max())
        if not 0.0 < largest < np.inf:
            raise PointError(f"game: {name} are no probabilities: the largest of its numbers is {part.max():g}")
        scaled = positive / largest  # whose sum does not overflow
        parts.append(scaled / scaled.sum())
    return parts[0], parts[1]


def _costs(payoff: Any, label: str) -> Dense:
    """Return costs > 0 in place of payoffs; raises ProblemError."""
    dense = matrices.dense(matrices.matrix(payoff, f"game.{label}"))
    if not dense.size:
        raise ProblemError(
            f"game.{label}", f"is {dense.shape[0]} x {dense.shape[1]}, expected a choice for each player"
        )
    most = float(dense.max())
    return (most - dense) + ((most - float(dense.min())) or 1.0)


LEAST_SQUARES = "least_squares"
"""Property of a QP that is a least-squares problem: the number of its unknowns x."""


def least_squares_problem(
    A: Any, b: Any, lb: Any = None, ub: Any = None, name: str = "", rows: Mapping[str, Any] | None = None
) -> QP:
    """Return the QP of min ½‖Ax − b‖² with lb ≤ x ≤ ub; A has shape (m, n), b (m,), lb and ub (n,) or one number.

    rows : A, b, C, d of conditions Ax ≥ b, Cx = d on x.

    Raises ProblemError where the shapes differ, an entry is not finite, or the bounds exclude each other.
    """
    A, b = matrices.matrix(A, "least_squares.A"), matrices.vector(b, "least_squares.b")
    m, n = A.shape
    if b.size != m:
        raise ProblemError("least_squares.b", f"has {b.size} numbers, expected {m}, the rows of A")
    residual, none = sp.csr_array(sp.eye_array(m, format="csr", dtype=np.float64)), sp.csr_array((0, n))
    given = rows or {"A": none, "b": np.zeros(0), "C": none, "d": np.zeros(0)}
    return QP(
        Q=sp.csr_array(sp.block_diag([sp.csr_array((n, n)), residual], format="csr")),
        p=np.zeros(n + m),
        A=sp.csr_array(sp.hstack([given["A"], sp.csr_array((given["b"].size, m))])),
        b=given["b"],
        C=sp.csr_array(sp.block_array([[matrices.sparse(A), -residual], [given["C"], None]])),
        d=np.concatenate([b, given["d"]]),
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


def own_unknowns(problem: Problem, point: Point) -> dict[str, Vector] | None:
    """Return x and y of a game, x and the residual r of least squares, or x of a boxed LCP; None of any other problem,
    and where the answer has no probabilities."""
    if game_sizes(problem) is not None:
        try:
            x, y = strategies(problem, point)
        except PointError:
            return None
        return {"x": x, "y": y}
    z = point.arrays().get("z")
    if z is not None and (columns := columns_of(problem)) is not None:
        return {"x": z[:columns], "r": z[columns:]}
    if z is not None and (rows := rows_of(problem)) is not None:
        return {"x": z[:rows]}
    return None
