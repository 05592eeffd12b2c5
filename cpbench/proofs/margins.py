"""How far the numbers of a problem may change before a proof about it fails.

A proof at t is one of every problem whose entries differ from those of the file by at most t of themselves, and whose
sides and bounds by at most t of themselves and t of the size of their part (`part_sizes`). So what is rounding beside
the sides around it decides nothing, however exact the sum: 0·z ≥ 7e-18 is no contradiction beside a side of 100.

Entries that are 0 stay 0. Where unknowns have no bound, x₁ − x₂ = 1 and x₁ − x₂ = 0 have a solution of size 1/t nearby:
the statement is therefore that no such problem has one within reach. It is about an interval linear system
(Oettli and Prager, Numer. Math. 6, 1964; Rohn, in Fiedler et al., Linear Optimization Problems with Inexact Data,
2006), and t bounds the distance to feasible problems (Renegar, Math. Program. 70, 1995).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import ROUND_DOWN, Context, Decimal
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.foundation import matrices
from cpbench.foundation.matrices import Vector
from cpbench.proofs.exact_linear import Exact, dot, rationals
from cpbench.proofs.part_sizes import Sizes
from cpbench.proofs.polyhedra import Objective, Polyhedron

_ZERO = Fraction(0)


@dataclass(frozen=True, eq=False)
class FarkasMultipliers:
    """Multipliers y = (λ of Gx ≥ h, μ of Ex = f) of conditions that add up to 0 ≥ γ > 0, exactly.

    With ν = −Gᵀλ − Eᵀμ, b the sides and bounds that go with (y, ν), s their sizes and R the reach, a solution within R
    of a problem within t ≤ 1 says γ ≤ t(Σ|y_i|(|b_i| + s_i) + Σ|ν_j|(|b_j| + s_j) + (|λ|ᵀ|G| + |μ|ᵀ|E|)R).
    """

    P: Polyhedron
    y: Sequence[Fraction]
    size: Sizes

    @cached_property
    def margin(self) -> Fraction:
        """The least t at which the conditions need not contradict each other; 0 where they do not now."""
        combined = self.P.combined(self.y)
        if combined is None or combined.gamma <= 0 or combined.excess:
            return _ZERO
        weights, m = [abs(v) for v in self.y], self.P.h.size
        rows, unknowns, far = (rationals(part) for part in (self.size.rows, self.size.unknowns, self.size.reach))
        change = combined.terms + dot(weights, rows) + dot([abs(v) for v in combined.nu], unknowns)
        for matrix, part in zip(self.P.exact, (weights[:m], weights[m:]), strict=True):
            change += dot(part, matrix.absolute().times(far))
        return combined.gamma / change


def optimality(P: Polyhedron, goal: Objective) -> tuple[Polyhedron, Sizes]:
    """Return the equalities of a stationary point of ½xᵀQx + pᵀx over P, of (x, λ, μ, and the multipliers of lower and
    of upper bounds), and sizes.

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
    prices = _equalities(priced, -goal.p, lb).sizes
    whole = _equalities(equalities, -goal.p, np.concatenate([np.full(n, -np.inf), lb]))
    ends = ((own.unknowns, own.reach) for own in (P.sizes, prices))
    return whole, Sizes(prices.rows, *(np.concatenate(pair) for pair in zip(*ends, strict=True)))


def _equalities(E: Any, f: Vector, lb: Vector) -> Polyhedron:
    return Polyhedron(sp.csr_array((0, lb.size)), np.zeros(0), E, f, lb, np.full(lb.size, np.inf))


@dataclass(frozen=True, eq=False)
class FallingRay:
    """A ray d of P along which the objective falls for ever, from a feasible point x.

    The statement proved at t is that every problem within t has dᵀQd < 0; or, where Qd = 0, that none has a stationary
    point with x and multipliers within reach (`optimality`). Where dᵀQd = 0 and Qd is not, rounding decides. That x is
    feasible, and that d never leaves, is proved of the file's own numbers: near a problem whose equations depend on
    each other, infeasible ones may be.
    """

    P: Polyhedron
    goal: Objective
    ray: Sequence[Fraction]

    @cached_property
    def contradiction(self) -> FarkasMultipliers | None:
        """What the ray says of the conditions of optimality; None where it curves there."""
        P, size = optimality(self.P, self.goal)
        combined = P.combined(self.ray)
        return None if combined is None or combined.excess else FarkasMultipliers(P, self.ray, size)

    @cached_property
    def margin(self) -> Fraction:
        """The least t at which the objective need not fall along the ray; 0 where rounding decides."""
        if self.contradiction is not None:
            return self.contradiction.margin
        Q, sizes = Exact.of(self.goal.Q), [abs(v) for v in self.ray]
        curvature, terms = dot(self.ray, Q.times(self.ray)), dot(sizes, Q.absolute().times(sizes))
        return -curvature / terms if curvature < 0 else _ZERO


def rounded_down(x: Fraction) -> float:
    """Return two digits of a positive number, less than it."""
    less = x * Fraction(9999, 10000)
    return float(Context(prec=2, rounding=ROUND_DOWN).divide(Decimal(less.numerator), Decimal(less.denominator)))
