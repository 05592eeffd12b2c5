"""How far the numbers of a problem may change before a proof about it fails.

A proof at t is one of every problem whose entries differ from those of the file by at most t of themselves, and whose
sides and bounds by at most t of themselves and t of the size of their part (`Sizes`). So what is rounding beside
the sides around it decides nothing, however exact the sum: 0·z ≥ 7e-18 is no contradiction beside a side of 100. What
doubles round in these sums is taken off: far less than a tolerance, so that nothing need be exact.

Entries that are 0 stay 0. Where unknowns have no bound, x₁ − x₂ = 1 and x₁ − x₂ = 0 have a solution of size 1/t nearby:
the statement is therefore that no such problem has one within reach. It is about an interval linear system
(Oettli and Prager, Numer. Math. 6, 1964; Rohn, in Fiedler et al., Linear Optimization Problems with Inexact Data,
2006), and t bounds the distance to feasible problems (Renegar, Math. Program. 70, 1995).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.foundation import matrices
from cpbench.foundation.matrices import Vector
from cpbench.proofs.polyhedra import Objective, Polyhedron, Sizes

EPS = float(np.finfo(np.float64).eps)


def contradiction(P: Polyhedron, y: Vector) -> float:
    """Return the least t at which the conditions that y = (λ of Gx ≥ h, μ of Ex = f) adds up need not contradict each
    other; 0 where they do not now, to rounding, or where λ has the wrong signs.

    With ν = −Gᵀλ − Eᵀμ every x within has 0 ≥ hᵀλ + fᵀμ + νᵀx. A bound that goes with the sign of ν_j replaces x_j,
    which adds up to γ; where none does, ν_j has to be 0 to rounding. In problems within t γ changes by δ·t at most:
    with b the sides and bounds that go with (y, ν) and s their sizes, δ = Σ|y_i|(|b_i| + s_i) + Σ|ν_j|(|b_j| + s_j)
    + (|λ|ᵀ|G| + |μ|ᵀ|E|)R.
    """
    m = P.h.size
    if y.shape != (m + P.f.size,) or not np.isfinite(y).all() or (y[:m] < 0.0).any() or y[:m][np.isneginf(P.h)].any():
        return 0.0
    used, sides = np.abs(y), np.where(y != 0.0, np.concatenate([P.h, P.f]), 0.0)
    with np.errstate(all="ignore"):
        nu = -(P.G.T @ y[:m]) - P.E.T @ y[m:]
        terms = abs(P.G).T @ used[:m] + abs(P.E).T @ used[m:]
        bound = np.where(nu > 0.0, P.lb, P.ub)
        bounded, rounding = np.isfinite(bound), (y.size + nu.size) * EPS
        if (np.abs(nu) > (np.count_nonzero(y) + 2) * EPS * terms)[~bounded].any():
            return 0.0
        bound, nu = np.where(bounded, bound, 0.0), np.where(bounded, nu, 0.0)
        gamma = sides @ y + bound @ nu - rounding * (np.abs(sides) @ used + np.abs(bound) @ terms)
        room = np.abs(bound) + P.sizes.unknowns
        change = used @ (np.abs(sides) + P.sizes.rows) + np.abs(nu) @ room + terms @ P.sizes.reach
        margin = gamma / change
    return float(margin) if np.isfinite(margin) and margin > 0.0 else 0.0


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
    ends = ((sizes.unknowns, sizes.reach) for sizes in (P.sizes, prices))
    return replace(whole, known_sizes=Sizes(prices.rows, *(np.concatenate(pair) for pair in zip(*ends, strict=True))))


def _equalities(E: Any, f: Vector, lb: Vector) -> Polyhedron:
    return Polyhedron(sp.csr_array((0, lb.size)), np.zeros(0), E, f, lb, np.full(lb.size, np.inf))


def falling(P: Polyhedron, goal: Objective, optimal: Polyhedron, ray: Vector) -> float:
    """Return the least t at which the objective need not fall for ever along a ray d from a feasible point; 0 where it
    does not now, where the ray leaves P, or where rounding decides (dᵀQd = 0, and Qd is not).

    The statement at t is that no problem within t has a stationary point within reach (`optimal`), or, where that is
    not so, that all have dᵀQd < 0. That the point is feasible, and that a curved d never leaves, is so of the file's
    own numbers: near a problem whose equations depend on each other, infeasible ones may be.
    """
    flat = contradiction(optimal, ray)
    if flat > 0.0 or not P.recession.contains(ray):
        return flat
    terms = float(np.abs(ray) @ (abs(goal.Q) @ np.abs(ray)))
    curvature = float(ray @ (goal.Q @ ray)) + 2 * ray.size * EPS * terms
    return -curvature / terms if curvature < 0.0 else 0.0
