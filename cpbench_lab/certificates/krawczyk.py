"""Boxes that hold exactly one zero of a smooth system, by Krawczyk's test (Computing 4, 1969).

The preconditioner C is an inverse in doubles, the residual at the centre x̃ is taken in balls of many digits, and the
matrix I − C·F′(X) is bounded in doubles with the rounding errors of its products added (Rump, Verification methods,
Acta Numerica 19, 2010). Where x̃ − C·F(x̃) + (I − C·F′(X))(X − x̃) is in the interior of the box X, F has a zero in X
and no other one.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from flint import arb, ctx

from cpbench.foundation.matrices import Dense, Vector
from cpbench_lab.certificates.exact_rows import Index

PRECISION = 256
"""Bits of the balls."""
STEPS = 14
PARTS = 4
"""Doubles whose sum is the centre of a box."""
SMALL = 2.0**-80
"""Radius of a box over the size of what it holds, where the residual allows it."""
_UNIT = 2.0**-53
_OUT = 1.0 + 1e-9
"""Outweighs the rounding of sums of up to 10⁶ doubles of one sign."""
_LEAST = 1e-290
"""Outweighs what underflow takes from sums of products."""


class SmoothSystem(Protocol):
    """F: ℝⁿ → ℝⁿ, smooth on the boxes that are asked for."""

    def residual(self, x: Sequence[Any]) -> list[Any]:
        """F of balls, in balls; one that is not finite where F may be undefined."""
        ...

    def jacobian(self, x: Sequence[Any]) -> tuple[Dense, Dense]:
        """Centres and radii, in doubles, of matrices that hold F′ on a box of balls."""
        ...


@dataclass(frozen=True, eq=False)
class ZeroBox:
    """A box with exactly one zero, or what stops the proof.

    Attributes
    ----------
    centre : (n, PARTS) doubles whose sums are the centre. radius : (n,). reason : '' where there is a box.
    """

    centre: Dense
    radius: Vector
    reason: str = ""

    @property
    def x(self) -> list[Any]:
        """The box as balls; they are a little larger where a radius is rounded."""
        return balls(self.centre, self.radius)


def balls(centre: Dense, radius: Vector) -> list[Any]:
    """Balls around sums of doubles; exact where a radius is 0."""
    pairs = zip(centre.tolist(), radius.tolist(), strict=True)
    return [sum(map(arb, parts), arb(0, r) if r > 0 else arb(0)) for parts, r in pairs]


def sums_of_doubles(near: Sequence[Any]) -> Dense:
    """Numbers as sums of PARTS doubles, rounded to as much."""
    result = np.zeros((len(near), PARTS))
    for i, value in enumerate(near):
        rest = value
        for k in range(PARTS):
            result[i, k] = float(rest.mid())
            rest = rest - arb(result[i, k])
    return result


@contextmanager
def digits(bits: int = PRECISION) -> Any:
    """Set the precision of balls for a while."""
    before = ctx.prec
    ctx.prec = bits
    try:
        yield
    finally:
        ctx.prec = before


@dataclass(frozen=True, eq=False)
class Enclosed:
    """States of the unknowns with a box that holds a solution, or what stops the proof.

    Attributes
    ----------
    states : one of each contact, or of each unknown. dropped : equations that others imply exactly. centre : (n, PARTS)
    doubles whose sums are the centre. radius : (n,), 0 where an unknown is held. reason : '' where there is a box.
    """

    states: Any
    dropped: Index
    centre: Dense
    radius: Vector
    reason: str = ""


def no_box(states: Any, reason: str) -> Enclosed:
    """Return what is known where no box was found."""
    return Enclosed(states, np.zeros(0, dtype=np.int64), np.zeros((0, PARTS)), np.zeros(0), reason)


def enclose(system: SmoothSystem, start: Vector, units: Vector) -> ZeroBox:
    """Find a box around a zero near `start`; `units` are the sizes of the unknowns, all positive."""
    with digits():
        centre = [arb(v) for v in start.tolist()]
        C, step = None, np.full(start.size, np.inf)
        for count in range(STEPS):
            if count < 4 or C is None:
                J, _ = system.jacobian(centre)
                C = _inverse(J * units[None, :])
                if C is None:
                    return _none("the system of the active set is singular")
            # Newton's step in doubles, for a residual of many digits: each gains what the inverse has
            g, exponent = scaled(system.residual(centre))
            if not np.isfinite(g).all():
                return _none("the system is not defined near the answer")
            taken = np.ldexp(C @ g, exponent)
            if np.abs(taken).max(initial=0.0) > 1e8:
                return _none("Newton's method leaves the answer: no zero of the active set's system is near it")
            centre = [(x - arb(d * u)).mid() for x, d, u in zip(centre, taken.tolist(), units.tolist(), strict=True)]
            before, step = step, np.abs(taken)
            if step.max(initial=0.0) < SMALL or (count > 6 and step.max() > before.max()):
                break
        assert C is not None
        return _tested(system, centre, C, units)


def _none(reason: str) -> ZeroBox:
    return ZeroBox(np.zeros((0, PARTS)), np.zeros(0), reason)


def _tested(system: SmoothSystem, near: Sequence[Any], C: Dense, units: Vector) -> ZeroBox:
    """Apply Krawczyk's test, in units of the unknowns; the centre is rounded to sums of doubles first."""
    parts = sums_of_doubles(near)
    centre = balls(parts, np.zeros(len(near)))
    shift = _upper_product(C, system.residual(centre))
    if not np.isfinite(shift).all():
        return _none("the system is not defined near the answer")
    radius = 2.0 * shift + SMALL
    box = ZeroBox(parts, radius * units * _OUT)
    J, spread = system.jacobian(box.x)
    if not (np.isfinite(J).all() and np.isfinite(spread).all()):
        return _none("the system is not smooth near the answer")
    E = defect(C, J * units[None, :], (spread + np.abs(J) * 2 * _UNIT) * units[None, :] * _OUT)
    reached = shift + (E @ radius) * _OUT + _LEAST
    if all(arb(a) < arb(b) for a, b in zip((reached * _OUT).tolist(), radius.tolist(), strict=True)):
        return box
    return _none(f"Krawczyk's test fails: the defect of the inverse is {np.abs(E).sum(axis=1).max():.2g}")


def defect(C: Dense, J: Dense, spread: Dense) -> Dense:
    """Bound |I − C·A| for all A with |A − J| ≤ spread, rounding included."""
    n = C.shape[0]
    size = np.abs(C)
    rounding = (n + 2) * _UNIT * _OUT
    product = np.abs(np.eye(n) - C @ J) * (1 + 4 * _UNIT)
    return (product + rounding * (size @ np.abs(J)) + size @ spread + 2 * _UNIT * np.eye(n)) * _OUT + _LEAST


def scaled(balls: Sequence[Any]) -> tuple[Vector, int]:
    """Centres of balls as doubles times one power of two."""
    mids = [ball.mid() for ball in balls]
    if not all(ball.is_finite() for ball in balls):
        return np.full(len(mids), np.nan), 0
    exponents = [int(m.abs_upper().man_exp()[1]) + int(m.abs_upper().man_exp()[0]).bit_length() for m in mids if m != 0]
    top = max(exponents, default=0)
    unit = arb(2) ** -top
    return np.array([float(m * unit) for m in mids]), top


def _upper_product(C: Dense, g: Sequence[Any]) -> Vector:
    """Upper bounds, in doubles, of |C·g| for balls g."""
    if not all(ball.is_finite() for ball in g):
        return np.full(len(g), np.nan)
    sizes = np.array([up(ball) for ball in g])
    centres, exponent = scaled(g)
    spread = np.array([up(ball.rad()) for ball in g])
    # |C·g| ≤ |fl(C·centre)| + rounding·|C||g| + |C|·radius, with the rounding of each centre to a double
    product = np.abs(np.ldexp(C @ centres, exponent))
    rounding = (len(g) + 4) * _UNIT * _OUT
    return (product + rounding * (np.abs(C) @ sizes) + np.abs(C) @ spread) * _OUT + _LEAST


def up(ball: Any) -> float:
    """Return a double not below |ball|."""
    return float(ball.abs_upper()) * (1 + 4 * _UNIT) + 5e-324


def _inverse(J: Dense) -> Dense | None:
    if not np.isfinite(J).all():
        return None
    try:
        C = np.linalg.inv(J)
    except np.linalg.LinAlgError:
        return None
    return np.asarray(C, dtype=np.float64) if np.isfinite(C).all() else None
