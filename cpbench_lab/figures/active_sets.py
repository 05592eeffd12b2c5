"""Active sets: which of each pair 0 ≤ x ⟂ y ≥ 0 is zero in an answer, which are both, which are neither."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from cpbench.errors import NotApplicable, PointError
from cpbench.formulations.base import Problem
from cpbench.formulations.linear import LCP, MLCP, LCPPoint, MLCPPoint
from cpbench.formulations.nonlinear import NCP, MiCP, MiCPPoint, NCPPoint
from cpbench.formulations.programs import QP, QPPoint
from cpbench.foundation.matrices import Vector, max_abs


class ActiveSide(StrEnum):
    """Member of a pair that is away from zero."""

    FIRST = "first"
    SECOND = "second"
    NEITHER = "neither"
    """Both are zero: strict complementarity fails."""
    BOTH = "both"
    """No complementarity: one of them should be zero."""
    NEGATIVE = "negative"
    """One is below zero by more than the tolerance."""


@dataclass(frozen=True, eq=False)
class Pairs:
    """Complementary pairs of one kind, in units of their own sizes.

    Attributes
    ----------
    first, second : what they are, `z` and `w`. x, y : (k,), over the largest |x|, |y| (or the data's own unit).
    side : (k,), a Side each.
    """

    first: str
    second: str
    x: Vector
    y: Vector
    side: NDArray[np.str_]

    def count(self, side: ActiveSide) -> int:
        return int((self.side == str(side)).sum())


def active_set(problem: Problem, point: object, tolerance: float = 1e-6) -> list[Pairs]:
    """Return pairs z, w of an LCP or NCP; v, w of an MLCP; distances to the bounds and forces of a MiCP; multipliers
    and slacks of the rows and bounds of a QP.

    Zero is what is at most `tolerance` in size. Raises NotApplicable for other formulations, PointError on an answer
    that is not finite or not of this problem.
    """
    if not isinstance(problem, (LCP, MLCP, QP, NCP, MiCP)):
        raise NotApplicable(
            "active set",
            f"is told of lcp, mlcp, qp, ncp and micp, not of {problem.node}: cpbench convert FILE --to lcp may help",
        )
    problem.check_point(point)
    result = [
        Pairs(first, second, x / x_size, y / y_size, _sides(x / x_size, y / y_size, tolerance))
        for first, second, x, y, x_size, y_size in _pairs(problem, point)
        if x.size
    ]
    if not all(np.isfinite(pairs.x).all() and np.isfinite(pairs.y).all() for pairs in result):
        raise PointError(f"{problem.node}: the answer has a number that is not finite")
    return result


def _pairs(
    problem: LCP | MLCP | QP | NCP | MiCP, point: object
) -> Iterator[tuple[str, str, Vector, Vector, float, float]]:
    """Yield names, values and sizes of the pairs."""
    with np.errstate(all="ignore"):
        if isinstance(problem, LCP) and isinstance(point, LCPPoint):
            w = problem.slacks(point)["w"]
            yield "z", "w", point.z, w, _size(point.z, problem.z_unit), _size(w, max_abs(problem.q))
        elif isinstance(problem, MLCP) and isinstance(point, MLCPPoint):
            w = problem.slacks(point)["w"]
            yield "v", "w", point.v, w, _size(point.v, problem.v_unit), _size(w, max_abs(problem.b))
        elif isinstance(problem, NCP) and isinstance(point, NCPPoint):
            w = problem.F(point.z)
            yield "z", "w", point.z, w, _size(point.z, 0.0), _size(w, problem.scale)
        elif isinstance(problem, MiCP) and isinstance(point, MiCPPoint):
            w = problem.F(point.z)
            force, moves = _size(w, problem.scale), problem.lb < problem.ub
            for sign, bound, other, first in (
                (1.0, problem.lb, problem.ub, "z − lb"),
                (-1.0, problem.ub, problem.lb, "ub − z"),
            ):
                own = np.isfinite(bound) & moves
                gap, pressed = sign * (point.z - bound)[own], sign * w[own]
                # of two bounds, each has one sign of w
                pressed = np.where(np.isfinite(other[own]), np.maximum(pressed, 0.0), pressed)
                yield first, "w" if sign > 0 else "−w", gap, pressed, _size(gap, max_abs(bound[own])), force
        elif isinstance(problem, QP) and isinstance(point, QPPoint):
            slack = problem.A @ point.z - problem.b
            dual = max(max_abs(point.lam), max_abs(point.nu), max_abs(problem.p))
            yield "λ", "Az − b", point.lam, slack, _size(point.lam, dual), _size(slack, max_abs(problem.b))
            for sign, bound, second in ((1.0, problem.lb, "z − lb"), (-1.0, problem.ub, "ub − z")):
                finite = np.isfinite(bound)
                gap = sign * (point.z - bound)[finite]
                # ν has the multipliers of both bounds, one positive and one negative
                other = np.isfinite(problem.ub if sign > 0 else problem.lb)[finite]
                nu = sign * point.nu[finite]
                yield (
                    "ν" if sign > 0 else "−ν",
                    second,
                    np.where(other, np.maximum(nu, 0.0), nu),
                    gap,
                    _size(nu, dual),
                    _size(gap, max_abs(bound[finite])),
                )


def _size(value: Vector, unit: float) -> float:
    return max(max_abs(value), unit) or 1.0


def _sides(x: Vector, y: Vector, tolerance: float) -> NDArray[np.str_]:
    """Return a Side for every pair."""
    names = [ActiveSide.NEGATIVE, ActiveSide.NEITHER, ActiveSide.FIRST, ActiveSide.SECOND]
    conditions = [np.minimum(x, y) < -tolerance, np.maximum(x, y) <= tolerance, y <= tolerance, x <= tolerance]
    return np.select(conditions, [str(name) for name in names], str(ActiveSide.BOTH))
