"""Polygons in place of Coulomb's disk, shared by the facet edges of `fc`.

With vertices D = [d_1 … d_ν] of a polygon, a reaction is r_T = Dβ, β ≥ 0, eᵀβ ≤ μ r_N, and the law of a contact is
(47)-(48), in unknowns x = (r_N, β, λ):

    0 ≤ r_N ⟂ u_N ≥ 0,   0 ≤ β ⟂ λe + Dᵀu_T ≥ 0,   0 ≤ λ ⟂ μ r_N − eᵀβ ≥ 0,

an LCP with M = EᵀWE + K, q = Eᵀq, where r = Ex and K holds e, μ and −eᵀ. The unknowns of a contact are consecutive.
In two dimensions D = [1, −1] is the disk itself.
"""

from __future__ import annotations

import math

import numpy as np

from cpbench.conversions.base import Size
from cpbench.conversions.congruence import Congruence
from cpbench.conversions.operators import ContactOperator
from cpbench.formulations.base import Trace
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.fc import FrictionContact
from cpbench.formulations.lcp import LCP, LCPPoint
from cpbench.matrices import Dense, Vector


def directions(facets: int, angle: float) -> Dense:
    """Return unit vectors at angle + 2πi/ν [rad], shape (2, ν), ν even; to every one its opposite, exactly."""
    share = facets // 4 if facets % 4 == 0 else facets // 2
    theta = angle + 2.0 * math.pi / facets * np.arange(share)
    first = np.stack([np.cos(theta), np.sin(theta)])
    if facets % 4 == 0:  # quarter turns copied, not computed: cos(π/2) = 0 keeps M as sparse as it is
        first = np.hstack([first, np.stack([-first[1], first[0]])])
    return np.hstack([first, -first])


def obstacle(problem: FrictionContact, facets: int, angle: float) -> str | None:
    """Return why a polygon of `facets` sides cannot stand for the disk of this problem, else None."""
    wrong = wrong_knobs(facets, angle)
    if wrong is None and problem.dimension != 3:
        return f"the problem is {problem.dimension}-dimensional, where Coulomb's law is an LCP exactly; use fc-lcp-2d"
    return wrong


def wrong_knobs(facets: int, angle: float) -> str | None:
    """Return why there is no such polygon, else None."""
    if facets < 4 or facets % 2:
        return f"facets = {facets}: directions come in opposite pairs, use an even number of at least 4"
    if not math.isfinite(angle):
        return f"angle = {angle} is no angle, use a number of radians"
    return None


def congruence(D: Dense) -> Congruence:
    """Return M of (47)-(48) with the vertices D, shape (d − 1, ν), its coefficients at a contact 1 and μ."""
    d, count = D.shape[0] + 1, D.shape[1]
    embed = np.zeros((d, count + 2))
    embed[0, 0] = 1.0
    embed[1:, 1:-1] = D
    coupling, friction = np.zeros((count + 2, count + 2)), np.zeros((count + 2, count + 2))
    coupling[1:-1, -1], coupling[-1, 1:-1] = 1.0, -1.0
    friction[-1, 0] = 1.0
    return Congruence(embed, embed, np.stack([coupling, friction]))


def to_lcp(problem: FrictionContact, D: Dense) -> tuple[LCP, Trace]:
    """Return the LCP of (47)-(48) with the vertices D, shape (d − 1, ν), and the trace of its `push`: W, q, mu."""
    form = congruence(D)
    M = form.assemble(problem.W, coefficients(problem.mu))
    q = (problem.q.reshape(-1, form.d) @ form.left).ravel()
    return LCP(M=M, q=q), {"W": problem.W, "q": problem.q, "mu": problem.mu}


def operator(problem: FrictionContact, D: Dense) -> ContactOperator:
    """Return M of `to_lcp`, never assembled."""
    return congruence(D).operator(problem.W, coefficients(problem.mu))


def predict(problem: FrictionContact, D: Dense) -> Size:
    """Bound the size of what `to_lcp` will make."""
    return congruence(D).size(problem.W)


def coefficients(*bounds: Vector) -> Dense:
    """Return 1 and the friction coefficients of every contact, as columns."""
    return np.column_stack([np.ones(bounds[0].size), *bounds])


def from_lcp(point: LCPPoint, D: Dense) -> FCPoint:
    """Return r = Ex."""
    x = point.z.reshape(-1, D.shape[1] + 2)
    return FCPoint(r=np.column_stack([x[:, 0], x[:, 1:-1] @ D.T]).ravel())


def into_lcp(beta: Dense, D: Dense, normal: Vector, velocity: Dense) -> LCPPoint:
    """Return x = (r_N, β, λ) with the least λ that the velocities u_T allow, max_i(−d_iᵀu_T), and at least 0."""
    lam = np.maximum((-velocity[:, 1:] @ D).max(axis=1, initial=0.0), 0.0)
    return LCPPoint(z=np.column_stack([normal, beta, lam]).ravel())


def push(point: FCPoint, trace: Trace, D: Dense) -> LCPPoint:
    """Return x of a three-dimensional answer: r_T projected on the polygon with vertices μ r_N D, then `into_lcp`."""
    normal, r_T, velocity = split(point, trace, 3)
    return into_lcp(coordinates(r_T, D, trace["mu"] * normal), D, normal, velocity)


def split(point: FCPoint, trace: Trace, d: int) -> tuple[Vector, Dense, Dense]:
    """Return r_N ≥ 0, r_T and u of every contact."""
    u = trace["W"] @ point.r + trace["q"]
    R = point.r.reshape(-1, d)
    return np.maximum(R[:, 0], 0.0), R[:, 1:], u.reshape(-1, d)


def coordinates(x: Dense, D: Dense, bound: Vector | None = None) -> Dense:
    """Return β ≥ 0 of every row of x with Dβ = x, on the two neighbouring vertices that enclose it; shape (nc, ν).

    With `bound`, x is first projected on the polygon with vertices bound·D: then eᵀβ ≤ bound.
    """
    count = D.shape[1]
    step = 2.0 * math.pi / count
    turned = np.arctan2(x[:, 1], x[:, 0]) - math.atan2(D[1, 0], D[0, 0])
    low = np.floor(turned / step).astype(np.int64) % count
    high = (low + 1) % count
    # Cramer's rule in the basis (d_low, d_high); rounding may leave a tiny negative coordinate at a vertex
    det = D[0, low] * D[1, high] - D[1, low] * D[0, high]
    first = np.maximum((x[:, 0] * D[1, high] - x[:, 1] * D[0, high]) / det, 0.0)
    second = np.maximum((x[:, 1] * D[0, low] - x[:, 0] * D[1, low]) / det, 0.0)
    if bound is not None:
        # the normal of the side is d_low + d_high: going back to it takes the same amount off both coordinates
        excess = 0.5 * np.maximum(first + second - bound, 0.0)
        outside = excess > 0.0
        first = np.where(outside, np.clip(first - excess, 0.0, bound), first)
        second = np.where(outside, np.clip(second - excess, 0.0, bound), second)
    beta = np.zeros((x.shape[0], count))
    every = np.arange(x.shape[0])
    beta[every, low] = first
    beta[every, high] = second
    return beta
