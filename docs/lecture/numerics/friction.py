"""The direct formulation (49) of friction in numbers, and the conditions (16) and (43)-(46) at an answer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench import LCP, FCPoint, FrictionContact, NonlinearFrictionContact, make
from cpbench.foundation.matrices import Dense, Vector, max_abs, norm
from lecture.numerics.round_trips import answer


@dataclass(frozen=True)
class DirectLaw:
    """Residuals of (49) at one contact.

    Attributes
    ----------
    printed : ‖r_T ξ + ‖r_T‖ u_T‖. mended : ‖r_T ξ + μ r_N u_T‖. sigma : μ r_N − ‖r_T‖. product : σξ.
    """

    printed: float
    mended: float
    sigma: float
    product: float


def direct_law(r: Vector, u: Vector, mu: float, xi: float | None = None) -> DirectLaw:
    """(49) at a reaction and a velocity; ξ is ‖u_T‖ unless it is an unknown of its own.

    >>> direct_law(np.array([1.0, 0, 0]), np.array([0.0, 1, 0]), 0.5, xi=0.0)
    DirectLaw(printed=0.0, mended=0.5, sigma=0.5, product=0.0)
    """
    r_T, u_T = r[1:], u[1:]
    xi = norm(u_T) if xi is None else xi
    sigma = float(mu * r[0] - norm(r_T))
    return DirectLaw(norm(r_T * xi + norm(r_T) * u_T), norm(r_T * xi + mu * r[0] * u_T), sigma, sigma * xi)


@dataclass(frozen=True, eq=False)
class OuterLaw:
    """(46) at the answer of the outer polygon.

    Attributes
    ----------
    normals : (2, ν) c_i. kappa : (ν,). sigma : (ν,) μ r_N − c_iᵀr_T. velocity : (2,) u_T.
    mismatch : ‖u_T + Σκ_i c_i‖. printed : ‖u_T − Σκ_i c_i‖, the sign of the lecture.
    """

    normals: Dense
    kappa: Vector
    sigma: Vector
    velocity: Vector
    mismatch: float
    printed: float


def outer_law(problem: FrictionContact, r: Vector, v: Vector, facets: int) -> OuterLaw:
    """The law of one contact whose mixed LCP has the answer v = (r_N, κ)."""
    normals = make("fc-lcp-inner", {"facets": facets}).vertices  # type: ignore[attr-defined]
    u_T = (problem.W @ r + problem.q)[1:]
    kappa = v[1:]
    push = normals @ kappa
    return OuterLaw(normals, kappa, problem.mu[0] * r[0] - normals.T @ r[1:], u_T, norm(u_T + push), norm(u_T - push))


@dataclass(frozen=True, eq=False)
class FrozenStep:
    """One step of a fixed point: what was frozen, the reaction that came out, its error on the law itself."""

    frozen: Vector
    r: Vector
    error: float


def fixed_point(problem: FrictionContact, edge: str, most: int = 25, enough: float = 1e-13) -> list[FrozenStep]:
    """Freeze, solve the convex program, thaw: `fc-coneqp` freezes μ‖u_T‖, `fc-coneqp-tresca` μ r_N.

    The first step freezes 0, or what the edge takes where nothing is given.
    """
    knob = {"fc-coneqp": "slip", "fc-coneqp-tresca": "threshold"}[edge]
    held: tuple[float, ...] = ()
    path: list[FrozenStep] = []
    while not path or (path[-1].error > enough and len(path) < most):
        conversion = make(edge, {knob: held})
        program, trace = conversion.apply(problem)
        r = conversion.lift(answer(program).point, trace).r
        path.append(FrozenStep(np.array(held), r, problem.residuals(FCPoint(r=r)).error))
        u = (problem.W @ r + problem.q).reshape(problem.nc, -1)
        normal = r.reshape(problem.nc, -1)[:, 0]
        slide = np.linalg.norm(u[:, 1:], axis=1) if knob == "slip" else np.maximum(normal, 0.0)
        held = tuple((problem.mu * slide).tolist())
    return path


def newton_steps(problem: NonlinearFrictionContact, most: int = 12, enough: float = 1e-13) -> list[FrozenStep]:
    """Linearise the dynamics, solve the contact problem, linearise where it ends; first where nothing touches."""
    at, path = problem.free_motion, []
    while not path or (path[-1].error > enough and len(path) < most):
        conversion = make("nfc-gfc", {"velocity": tuple(at.tolist())})
        linear, trace = conversion.apply(problem)
        point = conversion.lift(answer(linear).point, trace)
        path.append(FrozenStep(at, point.r, problem.residuals(point).error))
        at = point.v
    return path


@dataclass(frozen=True)
class InnerProductConditions:
    """(16) at z with the multiplier μ of Mz + q ≥ 0: the largest violation of each of its lines."""

    sign: float
    product: float
    objective: float


def inner_product_conditions(lcp: LCP, z: Vector, multiplier: Vector) -> InnerProductConditions:
    """0 ≤ z ⟂ (M + Mᵀ)z + q − Mᵀμ ≥ 0, 0 ≤ μ ⟂ Mz + q ≥ 0, and the value zᵀ(Mz + q) of (15)."""
    w = lcp.M @ z + lcp.q
    gradient = w + lcp.M.T @ (z - multiplier)
    below = np.concatenate([gradient, multiplier, w, z])
    products = np.array([z @ gradient, multiplier @ w])
    return InnerProductConditions(max_abs(np.minimum(below, 0.0)), max_abs(products), float(z @ w))
