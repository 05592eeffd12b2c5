"""Whether forces at the contacts hold bodies at rest under a load: Ar + f = 0 with r ∈ K_μ at every contact.

For `gfc` A = [H G], the reactions of joints being free, and v = 0; for `fc` A = W and f = q, and u = 0. A cone
program gives forces with the largest margin s to the cones. Both answers are proved in rational arithmetic, for the
data as they are:

    holds           r exact with Ar + f = 0, r_N ≥ 0 and ‖r_T‖² ≤ (μ r_N)² at every contact
    does not hold   v exact with fᵀv > 0, and u = Aᵀv with u_N ≥ 0 and u_N² ≥ μ²‖u_T‖² at every contact, 0 at joints:
                    forces that hold would have 0 ≤ rᵀu = −fᵀv
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse as sp
from flint import fmpq
from numpy.typing import NDArray

from cpbench.errors import ProblemError
from cpbench.formulations.base import Problem
from cpbench.formulations.global_contact import GlobalFrictionContact
from cpbench.formulations.local_contact import FrictionContact
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Vector
from cpbench_lab.certificates.exact_rows import ExactRows, rational, solve_near
from cpbench_lab.certificates.hold_programs import CLOSE, Balance, inward_motion, scaled, with_most_margin

Rationals: TypeAlias = list[Any]


@dataclass(frozen=True, eq=False)
class HoldAnswer:
    """Answer to the question whether a load is held.

    Attributes
    ----------
    holds : None where it is not decided. proved : whether that is proved in rational arithmetic.
    forces : r, exact, where it is held and proved. motion : v, exact, where it is not held and that is proved.
    """

    holds: bool | None
    proved: bool = False
    forces: Rationals = field(default_factory=list)
    motion: Rationals = field(default_factory=list)


def balance_of(problem: Problem) -> Balance:
    """Return the equations of rest of a problem; raises ProblemError where contacts or joints move by themselves."""
    if isinstance(problem, FrictionContact):
        return Balance(sp.csr_array(problem.W), problem.q, problem.mu, problem.dimension)
    if isinstance(problem, GlobalFrictionContact):
        for name, given in (("w", problem.w), ("b", problem.b)):
            if given.any():
                text = (
                    f"is {matrices.max_abs(given):.3g} somewhere, expected 0: bodies at rest are what a load is held by"
                )
                raise ProblemError(f"gfc.{name}", text)
        A = sp.csr_array(sp.hstack([matrices.sparse(problem.H), matrices.sparse(problem.G)]))
        return Balance(A, problem.f, problem.mu, problem.dimension)
    raise ProblemError(problem.node, "has no hold limit: that is of fc and gfc")


def held(balance: Balance) -> HoldAnswer:
    """Return whether forces hold the load, with a proof where one is found."""
    if not balance.f.any():
        return HoldAnswer(True, True, [fmpq(0)] * balance.A.shape[1])
    units, row, column = scaled(balance)
    found = with_most_margin(units)
    if found is None:
        return _unreachable(balance)
    x, margin, v = found
    if margin < 0.0:
        refuted = _refuted(balance, units, v, row, margin < -CLOSE)
        if refuted.holds is not None:
            return refuted
    return _confirmed(balance, x * column, margin > CLOSE)


def _confirmed(balance: Balance, x: Vector, clear: bool) -> HoldAnswer:
    """Return that forces near x hold the load, where some are exact, if need be on the edges of cones that x is close
    to; not decided where neither they nor the margin are clear."""
    used, A, right = _with_force(balance), sp.csr_array(balance.A), [-value for value in rationals(balance.f)]
    r = x[: balance.rows].reshape(-1, balance.d)
    size, close = np.linalg.norm(r[:, 1:], axis=1), CLOSE * np.abs(r).max(initial=0.0)
    none = (r[:, 0] <= close) & (size <= close)
    on_edge = np.flatnonzero((abs(size - balance.mu * r[:, 0]) <= close) & (balance.mu > 0.0) & ~none)
    edges = np.zeros((on_edge.size * (balance.d - 1), balance.A.shape[1]))
    for k, c in enumerate(on_edge.tolist()):
        rows, at = slice(k * (balance.d - 1), (k + 1) * (balance.d - 1)), c * balance.d
        edges[rows, at + 1 : at + balance.d] = np.eye(balance.d - 1)
        edges[rows, at] = -balance.mu[c] * np.round(r[c, 1:] / size[c], 9)
    strict = used & ~np.append(np.repeat(none, balance.d), np.zeros(x.size - balance.rows, bool))
    for some, matrix in ((used, A), (strict, sp.vstack([A, sp.csr_array(edges)], format="csr"))):
        part = _near(matrix[:, some], right + [fmpq(0)] * (matrix.shape[0] - A.shape[0]), x[some])
        if part is not None:
            values = iter(part)
            exact = [next(values) if at else fmpq(0) for at in some.tolist()]
            if forces_hold(balance, exact):
                return HoldAnswer(True, True, exact)
    return HoldAnswer(True if clear else None)


def _refuted(balance: Balance, units: Balance, v: Vector, row: Vector, clear: bool) -> HoldAnswer:
    """Return that nothing holds the load, with a motion near v or −v that proves it where one does; not decided where
    neither it nor the margin is clear."""
    inward = inward_motion(units)
    for sign in (1.0, -1.0):
        start = sign * v
        if not units.f @ start > 0.0:
            continue
        for step in (0.0, 1e-9, 1e-7, 1e-5, 1e-3):
            if step and inward is None:
                break
            moved = start + step * float(np.abs(start).max()) * (inward if inward is not None else 0.0)
            motion = _of_joints(balance, row * moved)
            if motion is not None and motion_gains(balance, motion):
                return HoldAnswer(False, True, motion=motion)
    return HoldAnswer(False if clear else None)


def _unreachable(balance: Balance) -> HoldAnswer:
    """Return that no forces at all balance the load, with a motion that proves it; not decided where there is none."""
    A = balance.A.toarray()[:, _with_force(balance)]
    rest = balance.f - A @ np.linalg.lstsq(A, balance.f, rcond=None)[0]
    motion = _near(A.T, [fmpq(0)] * A.shape[1], rest)
    return (
        HoldAnswer(False, True, motion=motion)
        if motion is not None and motion_gains(balance, motion)
        else HoldAnswer(None)
    )


def _with_force(balance: Balance) -> NDArray[np.bool_]:
    """Return which unknowns may be other than 0: all but tangential forces without friction."""
    normal = np.arange(balance.rows) % balance.d == 0
    return np.append(normal | np.repeat(balance.mu > 0.0, balance.d), np.ones(balance.A.shape[1] - balance.rows, bool))


def _of_joints(balance: Balance, v: Vector) -> Rationals | None:
    """Return v as rationals, changed so that it moves no joint."""
    joints = sp.csr_array(balance.A.T[balance.rows :])
    if not joints.shape[0]:
        return rationals(v)
    return _near(joints, [fmpq(0)] * joints.shape[0], v)


def _near(A: Any, right: Rationals, x: Vector) -> Rationals | None:
    """Return an exact solution of A x = right that is as near to x as rounding allows; None where there is none."""
    start = rationals(x)
    K = sp.csr_array(A)
    rest = [b - a for a, b in zip(ExactRows.of(K).products(start), right, strict=True)]
    change = solve_near(K, rest, np.zeros(x.size))
    return None if change is None else [a + b for a, b in zip(start, change, strict=True)]


def forces_hold(balance: Balance, r: Sequence[Any]) -> bool:
    """Return whether exact forces balance the load, each in its cone."""
    total = ExactRows.of(sp.csr_array(balance.A)).products(r)
    if any(a + b for a, b in zip(total, rationals(balance.f), strict=True)):
        return False
    for c, mu in enumerate(rationals(balance.mu)):
        normal, *tangential = r[c * balance.d : (c + 1) * balance.d]
        if normal < 0 or dot(tangential, tangential) > (mu * normal) ** 2:
            return False
    return True


def motion_gains(balance: Balance, v: Sequence[Any]) -> bool:
    """Return whether the load gains by an exact motion that no force in its cone is against."""
    if dot(rationals(balance.f), v) <= 0:
        return False
    u = ExactRows.of(sp.csr_array(balance.A.T)).products(v)
    if any(u[balance.rows :]):
        return False
    for c, mu in enumerate(rationals(balance.mu)):
        normal, *tangential = u[c * balance.d : (c + 1) * balance.d]
        if normal < 0 or mu**2 * dot(tangential, tangential) > normal**2:
            return False
    return True


def rationals(x: Vector) -> Rationals:
    """Return the doubles of a finite vector as they are."""
    return [rational(value) for value in x.tolist()]


def dot(x: Sequence[Any], y: Sequence[Any]) -> Any:
    """Return Σ xᵢ yᵢ."""
    return sum((a * b for a, b in zip(x, y, strict=True)), fmpq(0))
