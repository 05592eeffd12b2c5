"""Boxes around answers to nonlinear complementarity problems over bounds, and to systems of equations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cpbench.formulations.base import Problem
from cpbench.formulations.expressions import Map
from cpbench.foundation.matrices import Dense, Vector
from cpbench.verification.sets import INFINITE
from cpbench_lab.certificates.active_sets import BASIC, LOWER, UPPER, States
from cpbench_lab.certificates.affine_parts import dependent_rows
from cpbench_lab.certificates.exact_points import rounded
from cpbench_lab.certificates.exact_rows import Index, rational
from cpbench_lab.certificates.krawczyk import PARTS, Enclosed, balls, digits, enclose, no_box
from cpbench_lab.certificates.map_balls import exact_values, jacobian, values
from cpbench_lab.certificates.mixed import MAPS
from cpbench_lab.certificates.redundant import reduced, with_held

LARGEST = 1500
"""Unknowns of the largest system that is enclosed: its inverse is dense, and derivatives are taken in balls."""
ROUNDS = 6


@dataclass(frozen=True, eq=False)
class Bounded:
    """F(z) beside lo ≤ z ≤ hi."""

    F: Map
    lo: Vector
    hi: Vector

    @classmethod
    def of(cls, problem: Problem) -> Bounded | None:
        """Return an NCP, MiCP or equation in this form; None for other problems."""
        own: Any = problem
        n = own.F.inputs if problem.node in MAPS else 0
        if problem.node == "ncp":
            return cls(own.F, np.zeros(n), np.full(n, np.inf))
        if problem.node == "equation":
            return cls(own.F, np.full(n, -np.inf), np.full(n, np.inf))
        if problem.node == "micp":
            lo = np.where(own.lb <= -INFINITE, -np.inf, own.lb)
            return cls(own.F, lo, np.where(own.ub >= INFINITE, np.inf, own.ub))
        return None


@dataclass(frozen=True, eq=False)
class BasicSystem:
    """F of the basic unknowns, with the others at their bounds."""

    P: Bounded
    basic: Index
    held: Vector

    def full(self, x: Sequence[Any]) -> list[Any]:
        """Return all unknowns."""
        return with_held(self.held, self.basic, x)

    def residual(self, x: Sequence[Any]) -> list[Any]:
        """F of the basic rows."""
        rows = values(self.P.F, self.full(x))
        return [rows[i] for i in self.basic.tolist()]

    def jacobian(self, x: Sequence[Any]) -> tuple[Dense, Dense]:
        """Return the derivatives by the basic unknowns."""
        centre, spread = jacobian(self.P.F, self.full(x), self.basic.tolist())
        return centre[self.basic], spread[self.basic]


def enclose_nonlinear(P: Bounded, z: Vector) -> Enclosed:
    """Find a box that holds a solution near z."""
    states, reason, tried = _states(P, z), "", set[bytes]()
    while states.tobytes() not in tried and len(tried) < ROUNDS:
        tried.add(states.tobytes())
        result, better = _enclosed(P, z, states)
        if not result.reason:
            return result
        reason, states = reason or result.reason, better
    return no_box(states, reason)


def _enclosed(P: Bounded, z: Vector, states: States) -> tuple[Enclosed, States]:
    """Return the box of an active set, or what stops it; and the active set that may be better."""
    basic = np.flatnonzero(states == BASIC).astype(np.int64)
    if basic.size > LARGEST:
        return no_box(states, f"{basic.size} unknowns hang together, {LARGEST} is the most that is enclosed"), states
    held = np.where(states == LOWER, P.lo, np.where(states == UPPER, P.hi, z))
    system = BasicSystem(P, basic, held)
    # an unknown of size 0 has that of all: its equation says nothing of its unit
    units = np.maximum(np.abs(held[basic]), 1e-3 * (np.abs(z).max(initial=0.0) or 1.0))
    box, dropped = enclose(system, held[basic], units), np.zeros(0, dtype=np.int64)
    if box.reason:
        at_bounds = {int(i): float(held[i]) for i in np.flatnonzero(states != BASIC)}
        dropped = dependent_rows(P.F, basic.tolist(), at_bounds)
        if not dropped.size:
            return no_box(states, box.reason), states
        with digits():
            part = reduced(system, dropped, held[basic], units, np.zeros(0, dtype=np.int64))
        box = enclose(part, part.held[part.columns], units[part.columns])
        if box.reason:
            return no_box(states, box.reason), states
        basic = basic[part.columns]
    centre, radius = np.zeros((z.size, PARTS)), np.zeros(z.size)
    centre[:, 0] = held
    centre[basic], radius[basic] = box.centre, box.radius
    with digits():
        wrong = _broken(P, states, balls(centre, radius))
    if not wrong:
        return Enclosed(states, dropped, centre, radius), states
    certain = [place for place in wrong if place[2]] or wrong
    more = f", and {len(wrong) - 1} more" if len(wrong) > 1 else ""
    what = "a condition fails at" if certain[0][2] else "the pair may be degenerate at"
    better = states.copy()
    for i, state, _ in certain:
        better[i] = state
    return no_box(states, f"{what} unknown {certain[0][0]}{more}"), better


def _broken(P: Bounded, states: States, x: Sequence[Any]) -> list[tuple[int, int, bool]]:
    """Places whose conditions are not certain, with the other state, and whether they certainly fail."""
    result: list[tuple[int, int, bool]] = []
    f = values(P.F, x)
    for i, state in enumerate(states.tolist()):
        low, high = P.lo[i], P.hi[i]
        if low == high:
            continue
        if state == BASIC:
            if low > -np.inf and not x[i] >= low:
                result.append((i, LOWER, bool(x[i] < low)))
            elif high < np.inf and not x[i] <= high:
                result.append((i, UPPER, bool(x[i] > high)))
        elif state == LOWER and not f[i] >= 0:
            result.append((i, BASIC, bool(f[i] < 0)))
        elif state == UPPER and not f[i] <= 0:
            result.append((i, BASIC, bool(f[i] > 0)))
    return result


def _states(P: Bounded, z: Vector) -> States:
    """Return whether each unknown is nearer to a bound than its row to 0, both over what the Jacobian says they do."""
    f = P.F(z)
    sizes: Any = abs(P.F.jacobian(z))
    unit = np.asarray(sizes @ np.maximum(np.abs(z), 1e-12)).ravel()
    weights = np.divide(1.0, unit, out=np.zeros_like(unit), where=unit > 0)
    effect = np.asarray((sizes.multiply(weights[:, None])).max(axis=0).toarray()).ravel() if sizes.nnz else 0 * z
    with np.errstate(invalid="ignore"):
        low = (f * weights > (z - P.lo) * effect) & np.isfinite(P.lo)
        high = (-f * weights > (P.hi - z) * effect) & np.isfinite(P.hi)
    return np.where((P.lo == P.hi) | low, LOWER, np.where(high, UPPER, BASIC)).astype(np.int8)


def exact_point(P: Bounded, z: Vector) -> Vector | None:
    """Return a point of few binary digits near z that solves the problem exactly, over the rationals."""
    for near in rounded(np.clip(z, P.lo, P.hi)):
        f = exact_values(P.F, [rational(v) for v in near.tolist()])
        if (
            f is not None
            and all(
                low == high or value == 0 or (value > 0 and x == low) or (value < 0 and x == high)
                for value, x, low, high in zip(f, near.tolist(), P.lo.tolist(), P.hi.tolist(), strict=True)
            )
            and ((near >= P.lo) & (near <= P.hi)).all()
        ):
            return near
    return None
