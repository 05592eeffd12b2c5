"""Four of the norms that PATH prints of an answer to a mixed complementarity problem, ℓ ≤ z ≤ u beside F(z).

Ferris and Munson name them (PATH 4.7, solution log). The functions are in Billups, Dirkse and Ferris, A comparison of
large scale mixed complementarity problem solvers (1997), and in Ferris, Kanzow and Munson, Feasible descent algorithms
for mixed complementarity problems (1999). That complementarity is divided by 1 + |bound| is in neither: so PATH 5.2.01
prints it of problems with one unknown. Its fifth norm is the gradient of the Fischer function's merit: 0 at answers
that are stationary there and solve nothing, so that it measures no answer.

PATH moves a point into its bounds before it measures. So do we, and no norm is then less than the largest violation of
a bound. All are in the ∞-norm, and change with the units of z and of F.
"""

from __future__ import annotations

from collections.abc import Callable
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


def path_norms(problem: Any, point: Any) -> dict[str, float]:
    """Return the norms of complementarity, the normal map, the minimum map and the Fischer function.

    Complementarity is (z − ℓ)F⁺/(1 + |ℓ|) and (u − z)F⁻/(1 + |u|), |F| where there is no bound on that side. The normal
    map is the distance of −F(z) to the normal cone of the box at z: an answer off its bound by any amount has all of F
    there. The Fischer function is φ(z − ℓ, −φ(u − z, −F)), φ(a, b) = a + b − √(a² + b²), φ(∞, b) = b. What is fixed
    is no unknown.
    """
    given = np.concatenate([np.zeros(0), *point.arrays().values()])
    lb, ub = (np.broadcast_to(bound, given.shape) for bound in BOUNDS[problem.node](problem))
    lb, ub = np.where(lb <= -INFINITE, -np.inf, lb), np.where(ub >= INFINITE, np.inf, ub)
    z = np.minimum(np.maximum(given, lb), ub)
    F = _map(problem, z)
    bound = np.where(F > 0, lb, ub)
    room = np.divide(np.abs(z - bound), 1.0 + np.abs(bound), out=np.ones_like(z), where=np.isfinite(bound))
    held = np.where(z == lb, np.minimum(F, 0.0), F)
    found = {
        "path_complementarity": room * F,
        "path_normal_map": np.where(z == ub, np.maximum(held, 0.0), held),
        "path_minimum_map": np.maximum(np.minimum(F, z - lb), z - ub),
        "path_fischer": _fischer(z - lb, -_fischer(ub - z, -F)),
    }
    return {name: max(max_abs(np.where(lb == ub, 0.0, x)), max_abs(given - z)) for name, x in found.items()}


def _map(P: Any, z: Vector) -> Vector:
    """Return F(z)."""
    if P.node == "mlcp":
        u, v = z[: P.a.size], z[P.a.size :]
        return np.concatenate([P.A @ u + P.C @ v + P.a, P.D @ u + P.B @ v + P.b])
    return P.M @ z + P.q if hasattr(P, "M") else P.F(z)


def _fischer(a: Vector, b: Vector) -> Vector:
    """Return φ(a, b) without cancellation, b where a is infinite."""
    finite = np.where(np.isfinite(a), a, 1.0)
    size, total = np.hypot(finite, b), finite + b
    stable = np.divide(2.0 * finite * b, total + size, out=total - size, where=total > 0)
    return np.where(np.isfinite(a), stable, b)
