"""The five norms that PATH prints of an answer to a mixed complementarity problem, ℓ ≤ z ≤ u beside F(z).

Ferris and Munson name them (PATH 4.7, solution log). The functions are in Billups, Dirkse and Ferris, A comparison of
large scale mixed complementarity problem solvers (1997), and in Ferris, Kanzow and Munson, Feasible descent algorithms
for mixed complementarity problems (1999). That complementarity is divided by 1 + |bound| is in neither: so PATH 5.2.01
prints it of problems with one unknown.

PATH moves a point into its bounds before it measures. So do we, and no norm is then less than the largest violation of
a bound. All are in the ∞-norm, and change with the units of z and of F.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from cpbench.formulations.node_table import NodeTable
from cpbench.foundation.matrices import Vector, max_abs
from cpbench.verification.sets import INFINITE

Bounds: TypeAlias = tuple[Any, Any]
BOUNDS: NodeTable[Callable[[Any], Bounds]] = NodeTable(
    "bounds beside F", "verify --all-measures shows no norms of PATH"
)
"""Bounds of the unknowns, by formulation: those that are mixed complementarity problems without any conversion."""
BOUNDS.enter(lambda problem: (0.0, np.inf), "lcp", "ncp")
BOUNDS.enter(lambda problem: (problem.lb, problem.ub), "relay", "micp")
BOUNDS.enter(lambda problem: (-np.inf, np.inf), "equation")
BOUNDS.enter(lambda problem: (np.repeat([-np.inf, 0.0], [problem.a.size, problem.b.size]), np.inf), "mlcp")


@dataclass(frozen=True, eq=False)
class _Mixed:
    """A mixed complementarity problem at a point within its bounds; `pulled` is w ↦ F′(z)ᵀw."""

    z: Vector
    F: Vector
    lb: Vector
    ub: Vector
    pulled: Callable[[Vector], Vector]


def path_norms(problem: Any, point: Any) -> dict[str, float]:
    """Complementarity, normal map, minimum map, Fischer function, and the gradient of ½‖Fischer function‖²."""
    given = np.concatenate([np.zeros(0), *point.arrays().values()])
    lb, ub = (np.broadcast_to(bound, given.shape) for bound in BOUNDS[problem.node](problem))
    lb, ub = np.where(lb <= -INFINITE, -np.inf, lb), np.where(ub >= INFINITE, np.inf, ub)
    z = np.minimum(np.maximum(given, lb), ub)
    mixed = _evaluated(problem, z, lb, ub)
    beyond = max_abs(given - z)
    fischer, gradient = _fischer(mixed)
    found = {
        "path_complementarity": max_abs(_complementarity(mixed)),
        "path_normal_map": max_abs(_normal_map(mixed)),
        "path_minimum_map": max_abs(np.maximum(np.minimum(mixed.F, z - lb), z - ub)),
        "path_fischer": max_abs(fischer),
        "path_fischer_gradient": max_abs(gradient),
    }
    return {name: max(value, beyond) for name, value in found.items()}


def _evaluated(problem: Any, z: Vector, lb: Vector, ub: Vector) -> _Mixed:
    if problem.node == "mlcp":
        P, n = problem, problem.a.size
        u, v = z[:n], z[n:]
        F = np.concatenate([P.A @ u + P.C @ v + P.a, P.D @ u + P.B @ v + P.b])
        return _Mixed(
            z, F, lb, ub, lambda w: np.concatenate([P.A.T @ w[:n] + P.D.T @ w[n:], P.C.T @ w[:n] + P.B.T @ w[n:]])
        )
    if hasattr(problem, "M"):
        return _Mixed(z, problem.M @ z + problem.q, lb, ub, lambda w: problem.M.T @ w)
    return _Mixed(z, problem.F(z), lb, ub, lambda w: problem.F.jacobian(z).T @ w)


def _complementarity(at: _Mixed) -> Vector:
    """Return (z − ℓ)F⁺/(1 + |ℓ|) and (u − z)F⁻/(1 + |u|); |F| where there is no bound on that side."""
    bound = np.where(at.F > 0, at.lb, at.ub)
    some = np.isfinite(bound)
    room = np.divide(np.abs(at.z - bound), 1.0 + np.abs(bound), out=np.ones_like(at.z), where=some)
    return np.where(at.lb == at.ub, 0.0, room * at.F)


def _normal_map(at: _Mixed) -> Vector:
    """Return the distance of −F(z) to the normal cone of the box at z, by components.

    It is the least of F(π(x)) + x − π(x) over the x with π(x) = z, π the projection on the box. An answer that is off
    its bound by any amount has all of F here, however small the amount.
    """
    held = np.where(at.z == at.lb, np.minimum(at.F, 0.0), at.F)
    return np.where(at.lb == at.ub, 0.0, np.where(at.z == at.ub, np.maximum(held, 0.0), held))


def _fischer(at: _Mixed) -> tuple[Vector, Vector]:
    """Return Φ with Φᵢ = φ(z − ℓ, −φ(u − z, −F)), φ(a, b) = a + b − √(a² + b²), and the gradient of ½‖Φ‖².

    Where a bound is infinite its φ is left out. Where Φᵢ has no derivative it is 0, and adds nothing to the gradient.
    """
    below, above = np.isfinite(at.lb), np.isfinite(at.ub)
    upper, by_room, by_push = _phi(np.where(above, at.ub - at.z, 1.0), -at.F)
    inner, inner_z, inner_F = (np.where(above, x, y) for x, y in ((-upper, at.F), (by_room, 0.0), (by_push, 1.0)))
    lower, by_gap, by_inner = _phi(np.where(below, at.z - at.lb, 1.0), inner)
    outer = np.where(below, lower, inner)
    by_gap, by_inner = np.where(below, by_gap, 0.0), np.where(below, by_inner, 1.0)
    gradient = (by_gap + by_inner * inner_z) * outer + at.pulled(by_inner * inner_F * outer)
    return outer, np.where(at.lb == at.ub, 0.0, gradient)  # what is fixed is no unknown


def _phi(a: Vector, b: Vector) -> tuple[Vector, Vector, Vector]:
    """Return φ(a, b) without cancellation, and its derivatives by a and by b; those are 0 at (0, 0)."""
    size, total = np.hypot(a, b), a + b
    stable = np.divide(2.0 * a * b, total + size, out=np.zeros_like(size), where=total + size > 0)
    value = np.where(total > 0, stable, total - size)
    some = size > 0
    by_a = np.where(some, 1.0 - np.divide(a, size, out=np.zeros_like(size), where=some), 0.0)
    by_b = np.where(some, 1.0 - np.divide(b, size, out=np.zeros_like(size), where=some), 0.0)
    return value, by_a, by_b
