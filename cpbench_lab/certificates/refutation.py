"""Boxes around an answer that provably hold no solution, so that a wrong answer is proved wrong.

In a box, a component of an answer contradicts its condition where balls say so for every point of the box: an unknown
away from its bound beside a row that is not 0, a contact that presses while it opens. That is the test of Alefeld, Chen
and Potra (Numerical validation of solutions of linear complementarity problems, Numer. Math. 83, 1999) for the absence
of solutions, without their preconditioner: it needs no solution nearby.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from flint import arb

from cpbench.formulations.base import Problem
from cpbench.foundation.matrices import Vector
from cpbench_lab.certificates.certificate import Evidence
from cpbench_lab.certificates.contact_balls import BallRows, Scene, square
from cpbench_lab.certificates.descent import WithRows, direction
from cpbench_lab.certificates.krawczyk import digits
from cpbench_lab.certificates.map_balls import values
from cpbench_lab.certificates.mixed import CONTACTS, POLYHEDRAL, mixed
from cpbench_lab.certificates.nonlinear_boxes import Bounded

ROWS = ("qp", "avi")
"""Nodes whose answers have multipliers that are not part of what is asked."""
FINEST = 60
"""The smallest radius that is tried is 2^-FINEST of the answer's size."""


def excluded(problem: Problem, point: Any, *, near: bool = False) -> tuple[float, Evidence]:
    """Return the largest radius 2^-k, over ‖answer‖∞, of a box around the answer without a solution, 0 if none is; and
    the evidence, if it needs any.

    Of a program or variational inequality with rows the box is around z, with any multipliers, where a direction
    refutes it; else around z and its multipliers, as it is where a solution z is known to be `near`.
    """
    if problem.node in ROWS and not near:
        P = WithRows.of(problem)
        result = _largest(lambda radius: direction(P, point.z, radius), _size(point.z))
        if result is not None:
            return result
    test = _test(problem, point)
    if test is None:
        return 0.0, {}
    contradicts, x = test
    with digits():
        result = _largest(lambda r: {} if contradicts([arb(v, r) for v in x.tolist()]) else None, _size(x))
    return result or (0.0, {})


def _size(x: Vector) -> float:
    return float(np.abs(x).max(initial=0.0)) or 1.0


def _largest(refuted: Callable[[float], Evidence | None], size: float) -> tuple[float, Evidence] | None:
    """Return the largest 2^-k with evidence at that radius over `size`: what holds for a box holds for smaller ones."""
    low, high, best = 0, FINEST + 1, None
    while low < high:
        middle = (low + high) // 2
        found = refuted(size * 2.0**-middle)
        if found is None:
            low = middle + 1
        else:
            high, best = middle, found
    return None if best is None else (2.0**-low, best)


def _test(problem: Problem, point: Any) -> tuple[Callable[[Sequence[Any]], bool], Vector] | None:
    P = Bounded.of(problem)
    if P is not None:
        return lambda x: _bounds(P.lo, P.hi, x, values(P.F, x)), point.z
    if problem.node in POLYHEDRAL:
        form = mixed(problem, point)
        assert form is not None
        affine, rows = form[0], BallRows.of(form[0].K, form[0].c)
        return lambda x: _bounds(affine.lo, affine.hi, x, rows(x)), form[1]
    if problem.node in CONTACTS:
        scene, x = Scene.of(problem, point)
        return lambda balls: _contacts(scene, balls), x
    return None


def _bounds(lo: Vector, hi: Vector, x: Sequence[Any], f: Sequence[Any]) -> bool:
    """Return whether some unknown contradicts its bounds or its row."""
    for v, row, low, high in zip(x, f, lo.tolist(), hi.tolist(), strict=True):
        above, below = low == -np.inf or v > low, high == np.inf or v < high
        if (low > -np.inf and v < low) or (high < np.inf and v > high):
            return True
        if low < high and ((row > 0 and above) or (row < 0 and below)):
            return True
    return False


def _contacts(scene: Scene, x: Sequence[Any]) -> bool:
    """Return whether some equation or contact contradicts its law."""
    if any(row > 0 or row < 0 for row in scene.equations(x)):
        return True
    u, r, d = scene.velocities(x), x[scene.k :], scene.q.size // max(scene.mu.size, 1)
    return any(_contact(u[d * c : d * c + d], r[d * c : d * c + d], arb(mu)) for c, mu in enumerate(scene.mu.tolist()))


def _contact(u: Sequence[Any], r: Sequence[Any], mu: Any) -> bool:
    (u_N, *u_T), (r_N, *r_T) = u, r
    if u_N < 0 or r_N < 0 or (u_N > 0 and any(v > 0 or v < 0 for v in r)):
        return True
    rub, slip = square(r_T), square(u_T)
    if rub > mu * r_N * mu * r_N:
        return True
    if not slip > 0:
        return False
    speed, limit = slip.sqrt(), mu * r_N
    return any(bool(v > 0 or v < 0) for v in (speed * a + limit * b for a, b in zip(r_T, u_T, strict=True)))
