"""How far the numbers of a problem may change, each by a share t of itself, before a proof about it fails.

The statement proved at t is about every problem whose entries differ from those of the file by at most t times their
own size, |δa_ij| ≤ t|a_ij| and |δb_i| ≤ t|b_i|, bounds included: an interval linear system (Oettli and Prager, Numer.
Math. 6, 1964; Rohn, in Fiedler et al., Linear Optimization Problems with Inexact Data, 2006). Entries that are 0 stay
0. Where unknowns have no bound, x₁ − x₂ = 1 and x₁ − x₂ = 0 have a solution of size 1/t at every t > 0; the statement
is therefore that no such problem has a solution with |x_j| ≤ R_j. R is REACH times the largest side or bound of the
problem, in units in which rows and columns have a mean of one (`reach`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from decimal import ROUND_DOWN, Context, Decimal
from fractions import Fraction
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from cpbench.foundation import matrices
from cpbench.foundation.matrices import Vector
from cpbench.proofs.exact_linear import Exact, dot, rationals
from cpbench.proofs.polyhedra import Objective, Polyhedron
from cpbench.verification.equilibration import equilibrate_apart

REACH = 10.0
"""Times the size that sides and bounds set: solutions beyond are not excluded of problems near the one asked. Those of
60 of 63 programs by Maros and Mészáros (1999) are within."""
LEAST = 2.0**-200
"""The least share that is looked for."""
_Numbers: TypeAlias = NDArray[Any]
_ZERO = Fraction(0)


@dataclass(frozen=True, eq=False)
class FarkasMultipliers:
    """Multipliers y = (λ of Gx ≥ h, μ of Ex = f) of conditions P that add up to 0 ≥ γ > 0, exactly.

    With ν = −Gᵀλ − Eᵀμ and τ = |G|ᵀλ + |E|ᵀ|μ|, a solution x of a problem within t of P has
    hᵀλ + fᵀμ − t(|h|ᵀλ + |f|ᵀ|μ|) ≤ Σ_j (−ν_j x_j + tτ_j|x_j|). The right side is convex in x_j, hence largest at an
    end of the interval that the bounds of that problem, its rows of one unknown, and R leave.
    """

    P: Polyhedron
    y: Sequence[Fraction]
    R: Vector

    def survives(self, t: Fraction) -> bool:
        """Return whether no problem within t has a solution with |x_j| ≤ R_j, in rational arithmetic."""
        return self._terms is not None and self._rest(t, *self._terms) > 0

    def margin(self) -> float:
        """Return the largest t that the multipliers survive, to two digits, rounded down; 0 where they contradict
        nothing."""
        if self._terms is None:
            return 0.0
        doubles = [part.astype(np.float64) for part in self._terms]
        with np.errstate(all="ignore"):
            return _largest(lambda t: float(self._rest(t, *doubles)), self.survives)

    @cached_property
    def _terms(self) -> tuple[_Numbers, ...] | None:
        """γ with |h|ᵀλ + |f|ᵀ|μ|, ν, τ, where γ has x, and ends of each x_j by bounds and by rows, as rationals; None
        where there is no contradiction."""
        P, m = self.P, self.P.h.size
        combined = P.combined(self.y)
        if combined is None or combined[0] <= 0 or combined[1] != 0:
            return None
        sizes = [abs(v) for v in self.y]
        nu, tau = [_ZERO] * P.lb.size, [_ZERO] * P.lb.size
        for matrix, part, size in zip(P.exact, (self.y[:m], self.y[m:]), (sizes[:m], sizes[m:]), strict=True):
            nu = [a - b for a, b in zip(nu, matrix.transposed_times(part), strict=True)]
            tau = [a + b for a, b in zip(tau, matrix.absolute().transposed_times(size), strict=True)]
        sides = [Fraction(abs(v)) if v > -math.inf else _ZERO for v in (*P.h.tolist(), *P.f.tolist())]
        far = self.R
        held = [v if a > 0 else w if a < 0 else 0.0 for a, v, w in zip(nu, P.lb.tolist(), P.ub.tolist(), strict=True)]
        ends = (np.clip(end, -far, far) for end in (P.lb, P.ub, *_by_rows(P)))
        return (
            np.array([combined[0], dot(sizes, sides)], dtype=object),
            np.array(nu, dtype=object),
            np.array(tau, dtype=object),
            *(np.array(rationals(part), dtype=object) for part in (np.array(held), far, *ends)),
        )

    def _rest(self, t: Any, first: Any, nu: Any, tau: Any, held: Any, far: Any, *ends: Any) -> Any:
        """Return what is left of γ at t, in the arithmetic of the arguments."""
        low, high, row_low, row_high = ends
        wide, narrow = (1 + t) / (1 - t), (1 - t) / (1 + t)
        low = np.maximum(np.maximum(low - t * abs(low), row_low * np.where(row_low < 0, wide, narrow)), -far)
        high = np.minimum(np.minimum(high + t * abs(high), row_high * np.where(row_high > 0, wide, narrow)), far)
        if (low > high).any():  # no x at all
            return first[0]
        most = np.maximum(*(t * tau * abs(x) - nu * (x - held) for x in (low, high)))
        return first[0] - t * first[1] - most.sum()


def _by_rows(P: Polyhedron) -> tuple[Vector, Vector]:
    """Return the bounds that rows of one unknown are, rounded outwards."""
    low, high = np.full(P.lb.size, -np.inf), np.full(P.lb.size, np.inf)
    for matrix, side, equal in ((P.G, P.h, False), (P.E, P.f, True)):
        rows: Any = matrices.sparse(matrix)
        single = np.flatnonzero((np.diff(rows.indptr) == 1) & np.isfinite(side))
        place, entry = rows.indices[rows.indptr[single]], rows.data[rows.indptr[single]]
        there = entry != 0.0
        place, bound, up = place[there], side[single][there] / entry[there], entry[there] > 0.0
        below, above = (up, ~up) if not equal else (np.ones_like(up), np.ones_like(up))
        np.maximum.at(low, place[below], np.nextafter(bound[below], -np.inf))
        np.minimum.at(high, place[above], np.nextafter(bound[above], np.inf))
    return low, high


def reach(P: Polyhedron) -> Vector:
    """Return R, shape (n,): REACH times the largest side or bound of every connected part, in units in
    which rows and columns have a mean of one."""
    blocks = [(P.G, P.h), (P.E, P.f), *([] if P.further is None else [P.further])]
    rows: Any = sp.vstack([sp.csr_array(matrix) for matrix, _ in blocks], format="csr")
    m, n = rows.shape
    _, part = connected_components(sp.block_array([[None, rows], [rows.T, None]]) if m else sp.csr_array((n, n)))
    row, column = equilibrate_apart(abs(rows), part[:m])
    low, high = (np.where(np.isfinite(side), np.abs(side), 0.0) for side in (P.lb, P.ub))
    sides = [np.where(np.isfinite(side), np.abs(side), 0.0) for _, side in blocks]
    size = np.zeros(part.size)
    np.maximum.at(size, part, np.concatenate([*sides, np.maximum(low, high)]) * np.concatenate([row, 1.0 / column]))
    return REACH * size[part[m:]] * column


def optimality(P: Polyhedron, goal: Objective) -> tuple[Polyhedron, Vector]:
    """Return the equalities of a stationary point of ½xᵀQx + pᵀx over P, of (x, λ, μ, and the multipliers of lower and
    of upper bounds), and R.

    These are Qx + p = Gᵀλ + Eᵀμ + z_l − z_u with the signs of the multipliers: a ray along which the objective falls
    contradicts them. p sets the size of the multipliers.
    """
    n = P.lb.size
    rows, low, high = (np.flatnonzero(np.isfinite(side)) for side in (P.h, P.lb, P.ub))
    unit = sp.eye_array(n, format="csr")
    G, E = matrices.sparse(P.G)[rows], matrices.sparse(P.E)
    lb = np.concatenate([np.zeros(rows.size), np.full(P.f.size, -np.inf), np.zeros(low.size + high.size)])
    priced: Any = sp.hstack([-G.T, -E.T, -unit[:, low], unit[:, high]], format="csr")
    equalities: Any = sp.hstack([matrices.sparse(goal.Q), priced], format="csr")
    prices = _equalities(priced, -goal.p, lb)
    whole = _equalities(equalities, -goal.p, np.concatenate([np.full(n, -np.inf), lb]))
    return whole, np.concatenate([reach(P), reach(prices)])


def _equalities(E: Any, f: Vector, lb: Vector) -> Polyhedron:
    return Polyhedron(sp.csr_array((0, lb.size)), np.zeros(0), E, f, lb, np.full(lb.size, np.inf))


@dataclass(frozen=True, eq=False)
class FallingRay:
    """A ray d of P along which the objective falls for ever, from a feasible point x.

    The statement proved at t is that every problem within t has dᵀQd < 0; or, where Qd = 0, that none has a stationary
    point with x and multipliers up to R (`optimality`). Where dᵀQd = 0 and Qd is not, rounding decides. That x is
    feasible, and that d never leaves, is proved of the file's own numbers: near a problem whose equations depend on
    each other, infeasible ones may be.
    """

    P: Polyhedron
    goal: Objective
    ray: Sequence[Fraction]

    @cached_property
    def contradiction(self) -> FarkasMultipliers | None:
        """What the ray says of the conditions of optimality; None where it curves there."""
        P, far = optimality(self.P, self.goal)
        combined = P.combined(self.ray)
        return FarkasMultipliers(P, self.ray, far) if combined is not None and combined[1] == 0 else None

    @cached_property
    def _curvature(self) -> tuple[Fraction, Fraction]:
        """dᵀQd, and the sum of the sizes of its terms."""
        Q, sizes = Exact.of(self.goal.Q), [abs(v) for v in self.ray]
        return dot(self.ray, Q.times(self.ray)), dot(sizes, Q.absolute().times(sizes))

    def survives(self, t: Fraction) -> bool:
        """Return whether the statement holds at t, in rational arithmetic."""
        curvature, size = self._curvature
        return curvature + t * size < 0 or (self.contradiction is not None and self.contradiction.survives(t))

    def margin(self) -> float:
        """Return the largest t that the ray survives, to two digits, rounded down; 0 where rounding decides."""
        if self.contradiction is not None:
            return self.contradiction.margin()
        curvature, size = map(float, self._curvature)
        return _largest(lambda t: -curvature - t * size, self.survives)


def _largest(rest: Callable[[float], float], survives: Callable[[Fraction], bool]) -> float:
    """Return the largest t ≤ 1/2 with `rest`(t) > 0, which falls, to two digits; 0 where it does not survive."""
    low, high = LEAST, 0.5
    if rest(high) > 0.0:
        low = high
    while high / low > 1.001:
        middle = math.sqrt(low * high)
        low, high = (middle, high) if rest(middle) > 0.0 else (low, middle)
    digits = Context(prec=2, rounding=ROUND_DOWN)
    for t in (low, 0.9 * low):
        share = float(digits.plus(Decimal(t)))
        if survives(Fraction(share)):
            return share
    return 0.0
