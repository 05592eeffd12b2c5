"""Multipliers for an answer that came without them, by linear least squares with signs.

With the unknowns z given, optimality says that the gradient F(z) is Σ yᵢ∇rᵢ(z) over the conditions rᵢ(z) ≥ 0 and
rᵢ(z) = 0, with yᵢ ≥ 0 and yᵢ rᵢ = 0 at inequalities (bounds among them). The multipliers are the minimiser of

    Σ_j (F(z) − Σ yᵢ∇rᵢ(z))_j² / w_j²  +  Σ_i (yᵢ rᵢ(z) / Σ_j|z_j| w_j)²

with these signs: a slack is paid for by its product, so that no threshold says which rows are active. Both sums have no
unit. First all w_j are equal; then w_j is what the terms of component j add up to in absolute value, those of the
multipliers found first among them; of the two points the one with the smaller error counts. Free multipliers are
eliminated by an orthogonal factorization, the others found by Lawson and Hanson's method (`scipy.optimize.nnls`;
Solving Least Squares Problems, 1974, chapter 23).

None of this can make a wrong z pass: what comes out is measured as any other answer.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp

from cpbench.errors import PointError
from cpbench.formulations.base import Point, Problem
from cpbench.formulations.conic import ConeQP
from cpbench.formulations.linear import AVI
from cpbench.formulations.primal import Primal
from cpbench.formulations.programs import NLP, QP
from cpbench.formulations.variational import VI
from cpbench.foundation import matrices
from cpbench.foundation.cones import Cone
from cpbench.foundation.matrices import Dense, Matrix, Vector
from cpbench.verification import Verdict, judge

COMPLETED = "multipliers completed"
"""Flag of a verdict on an answer whose multipliers are not its author's but computed here."""
LARGEST = 6e6
"""Entries of the largest least-squares matrix, 48 MB; with so many the method takes about half a minute."""
RANK = 1e-12
"""Pivot, beside the first, below which a gradient of an equality depends on the others."""


@dataclass(frozen=True, eq=False)
class _Conditions:
    """Conditions of one sign, whose multipliers are `sign` times numbers `at` of the part `name` ("": of none).

    J : (m, n) gradients. slack : (m,). free : whether the multipliers have any sign.
    """

    name: str
    at: Any
    J: Matrix
    slack: Vector
    free: bool = False
    sign: float = 1.0


@dataclass(frozen=True, eq=False)
class _LeastSquares:
    """Everything known of z: the gradient F and the absolute terms of it, (n,), and the conditions."""

    z: Vector
    F: Vector
    terms: Vector
    conditions: list[_Conditions]

    @cached_property
    def J(self) -> Dense:
        """Gradients of all conditions, (k, n)."""
        return np.vstack([matrices.dense(some.J) for some in self.conditions if some.slack.size])

    @cached_property
    def slack(self) -> Vector:
        """Slacks of inequalities, 0 at equalities, (k,)."""
        return np.concatenate([some.slack * (not some.free) for some in self.conditions])

    @cached_property
    def free(self) -> Any:
        """Whether a multiplier has any sign, (k,)."""
        return np.repeat([some.free for some in self.conditions], [some.slack.size for some in self.conditions])

    def solution(self, w: Vector) -> Vector:
        """Return the multipliers by the weights w, (k,)."""
        products = np.abs(self.slack) / (float(np.abs(self.z) @ w) or 1.0)
        paid = np.flatnonzero(products)
        n, k = self.F.size, self.slack.size
        X = np.zeros((n + paid.size, k))
        X[:n] = (self.J / w).T
        X[n + np.arange(paid.size), paid] = products[paid]
        size = np.sqrt(np.einsum("ij,ij->j", X, X))
        size[size == 0.0] = 1.0
        return _signed_least_squares(X / size, np.append(self.F / w, np.zeros(paid.size)), self.free) / size


def whole(problem: Problem, answer: Any, tolerance: float) -> tuple[Point, str]:
    """Return a point as it is, and a `Primal` with multipliers and the remark that they were computed here.

    Raises PointError as `completed` does.
    """
    if not isinstance(answer, Primal):
        return answer, ""
    names = ", ".join(name for name, size in problem.point_sizes.items() if size and name != answer.name)
    how = "computed by cpbench (least squares), no solver claimed them"
    remark = f"the answer is {answer.name} alone: its multipliers ({names}) were {how}"
    return completed(problem, answer, tolerance), remark


def marked(verdict: Verdict) -> Verdict:
    """Return the verdict on a completed answer, with the flag that says so."""
    return replace(verdict, flags=(*verdict.flags, COMPLETED))


def completed(problem: Problem, primal: Primal, tolerance: float = 1e-6) -> Point:
    """Return the point of `problem` with these unknowns and the multipliers that suit them best.

    Raises PointError where multipliers of this formulation or set are not computed, or the problem is too large.
    """
    candidates = [_point(problem, primal, [], np.zeros(0))]
    if np.isfinite(primal.values).all():
        with np.errstate(all="ignore"):
            candidates += _candidates(problem, primal)
    return min(reversed(candidates), key=lambda point: judge(problem, point, tolerance).error)


def _candidates(problem: Problem, primal: Primal) -> Iterable[Point]:
    """Yield the points by equal weights and by those of the terms."""
    given = _stated(problem, primal.values)
    n, k = given.F.size, given.slack.size
    if (n + k) * k > LARGEST:
        raise PointError(f"{problem.node}: {k} multipliers of {n} unknowns are too many to compute: give them")
    largest = float(given.terms.max(initial=0.0))
    if not k or not 0.0 < largest < np.inf or not np.isfinite(given.slack).all() or not np.isfinite(given.J).all():
        return
    y = given.solution(np.full(n, largest))
    yield _point(problem, primal, given.conditions, y)
    terms = given.terms + np.abs(given.J).T @ np.abs(y)
    y = given.solution(np.where(terms > 0.0, terms, largest))
    yield _point(problem, primal, given.conditions, y)


def _stated(problem: Problem, z: Vector) -> _LeastSquares:
    """Return the gradient and the conditions of a problem at z; raises PointError where no rule is known."""
    if isinstance(problem, QP | ConeQP):
        F, terms = problem.Q @ z + problem.p, abs(problem.Q) @ np.abs(z) + np.abs(problem.p)
        rows = _cone_rows(problem, z) if isinstance(problem, ConeQP) else _rows(problem, z)
        return _LeastSquares(z, F, terms, rows if isinstance(problem, ConeQP) else [*rows, *_bounds(problem, z, "nu")])
    if isinstance(problem, AVI):
        F, terms = problem.M @ z + problem.q, abs(problem.M) @ np.abs(z) + np.abs(problem.q)
        return _LeastSquares(z, F, terms, [*_rows(problem, z), *_bounds(problem, z, "")])
    if isinstance(problem, NLP):
        F = matrices.dense(problem.f.jacobian(z)).ravel()
        rows = [_inequalities("lam", problem.g.jacobian(z), problem.g(z))]
        rows.append(_Conditions("mu", slice(None), problem.h.jacobian(z), np.zeros(problem.h.rows), free=True))
        return _LeastSquares(z, F, np.abs(F), [*rows, *_bounds(problem, z, "nu")])
    if isinstance(problem, VI) and problem.only_box:
        F = problem.F(z)
        curved = _inequalities("nu", problem.g.jacobian(z), problem.g(z))
        return _LeastSquares(z, F, np.abs(F), [*_rows(problem, z), curved, *_bounds(problem, z, "")])
    raise PointError(
        f"{problem.node}: an answer without multipliers is completed over bounds and rows, and not over other cones: "
        f"give all of {', '.join(problem.point_sizes)}"
    )


def _inequalities(name: str, J: Matrix, slack: Vector) -> _Conditions:
    return _Conditions(name, slice(None), J, slack)


def _rows(problem: Any, z: Vector) -> list[_Conditions]:
    """Return Az ≥ b and Cz = d."""
    equalities = _Conditions("mu", slice(None), problem.C, np.zeros(problem.d.size), free=True)
    return [_inequalities("lam", problem.A, problem.A @ z - problem.b), equalities]


def _bounds(problem: Any, z: Vector, name: str) -> list[_Conditions]:
    """Return lb ≤ z ≤ ub, with multipliers `name` that are positive at lb."""
    lb, ub = problem.box if isinstance(problem, VI) else (problem.lb, problem.ub)
    unit, fixed = sp.eye_array(z.size, format="csr"), lb == ub
    both, low, high = (np.flatnonzero(at) for at in (fixed, np.isfinite(lb) & ~fixed, np.isfinite(ub) & ~fixed))
    return [
        _Conditions(name, both, unit[both], np.zeros(both.size), free=True),
        _Conditions(name, low, unit[low], (z - lb)[low]),
        _Conditions(name, high, -unit[high], (ub - z)[high], sign=-1.0),
    ]


def _cone_rows(problem: ConeQP, x: Vector) -> list[_Conditions]:
    """Return the rows of Ax + b that are ≥ 0 and those that are 0; raises PointError on other cones."""
    kind = np.repeat(problem.K.kind, problem.K.size.astype(np.int64))
    if not np.isin(kind, (Cone.ZERO, Cone.FREE, Cone.NONNEGATIVE)).all():
        raise PointError("coneqp: multipliers are completed where all cones are orthants, {0} or ℝ: give y too")
    A, s = matrices.sparse(problem.A), problem.A @ x + problem.b
    zero, signed = np.flatnonzero(kind == Cone.ZERO), np.flatnonzero(kind == Cone.NONNEGATIVE)
    return [_Conditions("y", signed, A[signed], s[signed]), _Conditions("y", zero, A[zero], s[zero], free=True)]


def _point(problem: Problem, primal: Primal, conditions: list[_Conditions], y: Vector) -> Point:
    """Return the point with multipliers y of the conditions, and 0 elsewhere; raises PointError on a wrong length."""
    parts = {name: np.zeros(size) for name, size in problem.point_sizes.items()} | {primal.name: primal.values}
    at = 0
    for some in conditions:
        if some.name:
            parts[some.name][some.at] += some.sign * y[at : at + some.slack.size]
        at += some.slack.size
    point = problem.point_type(**parts)
    problem.check_point(point)
    return point


def _signed_least_squares(X: Dense, b: Vector, free: Any) -> Vector:
    """Return y with the least ‖Xy − b‖₂, y ≥ 0 where not `free`; X has columns of length 1."""
    from scipy.optimize import nnls  # slow to import

    y = np.zeros(free.size)
    Q, R, order = sl.qr(X[:, free], mode="economic", pivoting=True)
    pivots = np.abs(np.diagonal(R))
    rank = int((pivots > RANK * pivots.max(initial=0.0)).sum())
    Q, R, kept = Q[:, :rank], R[:rank, :rank], np.flatnonzero(free)[order[:rank]]
    signed = np.flatnonzero(~free)
    if signed.size:  # without columns nnls of SciPy 1.17 ends the process
        N = X[:, signed]
        try:
            y[signed] = nnls(N - Q @ (Q.T @ N), b - Q @ (Q.T @ b), maxiter=30 * signed.size)[0]
        except RuntimeError:
            raise PointError(f"no multipliers were found in {30 * signed.size} steps: give them") from None
    y[kept] = sl.solve_triangular(R, Q.T @ (b - X[:, signed] @ y[signed]))
    return y
