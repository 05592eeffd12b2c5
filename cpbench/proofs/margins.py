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
from dataclasses import replace
from decimal import ROUND_DOWN, Context, Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.foundation import matrices
from cpbench.foundation.matrices import Vector
from cpbench.proofs.exact_linear import Exact, dot
from cpbench.proofs.part_sizes import Sizes
from cpbench.proofs.polyhedra import Objective, Polyhedron

_ZERO = Fraction(0)


def contradiction(P: Polyhedron, y: Sequence[Fraction]) -> Fraction:
    """Return the least t at which conditions that y = (λ of Gx ≥ h, μ of Ex = f) adds up to 0 ≥ γ > 0, exactly, need
    not contradict each other; 0 where they do not now."""
    gamma, excess, change = P.combined(y) or (_ZERO, _ZERO, _ZERO)
    return gamma / change if gamma > 0 and not excess else _ZERO


def optimality(P: Polyhedron, goal: Objective) -> Polyhedron:
    """Return the equalities of a stationary point of ½xᵀQx + pᵀx over P, of (x, λ, μ, and the multipliers of lower and
    of upper bounds).

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
    return replace(whole, known_sizes=Sizes(prices.rows, *(np.concatenate(pair) for pair in zip(*ends, strict=True))))


def _equalities(E: Any, f: Vector, lb: Vector) -> Polyhedron:
    return Polyhedron(sp.csr_array((0, lb.size)), np.zeros(0), E, f, lb, np.full(lb.size, np.inf))


def falling(P: Polyhedron, goal: Objective, optimal: Polyhedron, ray: Sequence[Fraction]) -> Fraction:
    """Return the least t at which the objective need not fall for ever along a ray d from a feasible point; 0 where it
    does not now, where the ray leaves P, or where rounding decides (dᵀQd = 0, and Qd is not).

    The statement proved at t is that no problem within t has a stationary point within reach (`optimal`), or, where
    that is not so, that all have dᵀQd < 0. That the point is feasible, and that a curved d never leaves, is proved of
    the file's own numbers: near a problem whose equations depend on each other, infeasible ones may be.
    """
    flat = contradiction(optimal, ray)
    if flat > 0 or not P.recession.contains(ray):
        return flat
    Q, sizes = Exact.of(goal.Q), [abs(v) for v in ray]
    curvature, terms = dot(ray, Q.times(ray)), dot(sizes, Q.absolute().times(sizes))
    return -curvature / terms if curvature < 0 else _ZERO


def rounded_down(x: Fraction) -> float:
    """Return two digits of a positive number, less than it."""
    less = x * Fraction(9999, 10000)
    return float(Context(prec=2, rounding=ROUND_DOWN).divide(Decimal(less.numerator), Decimal(less.denominator)))
