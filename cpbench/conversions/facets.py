"""Polygons in place of friction disks, shared by the facet edges of `fc` and `rfc`.

With vertices D = [d_1 … d_ν] of a polygon, a reaction is r_T = Dβ, β ≥ 0, eᵀβ ≤ μ r_N, and the law of a contact is
(47)-(48), in unknowns x = (r_N, β, λ), with rolling friction x = (r_N, β, λ, γ, κ) and a moment m = Dγ:

    0 ≤ r_N ⟂ u_N ≥ 0,   0 ≤ β ⟂ λe + Dᵀu_T ≥ 0,   0 ≤ λ ⟂ μ r_N − eᵀβ ≥ 0,
                         0 ≤ γ ⟂ κe + Dᵀω ≥ 0,     0 ≤ κ ⟂ μ_r r_N − eᵀγ ≥ 0,

an LCP with M = EᵀWE + K, q = Eᵀq, where r = Ex and K holds e, μ, μ_r and −eᵀ. The unknowns of a contact are
consecutive. In the plane D = [1, −1] is the interval itself, so that nothing is approximated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from cpbench.conversions.base import Conversion, Size
from cpbench.conversions.congruence import Congruence
from cpbench.formulations.base import Trace
from cpbench.formulations.contact import FCPoint, LocalContact
from cpbench.formulations.linear import LCP, LCPPoint
from cpbench.formulations.local_contact import FrictionContact, RollingFrictionContact
from cpbench.foundation.matrices import Dense, Vector

INTERVAL = np.array([[1.0, -1.0]])
"""The two directions of the plane."""


@dataclass(frozen=True)
class FacetKnobs:
    """The knobs of an edge with a polygon of `facets` vertices or sides, the first at `angle` [rad], for each disk."""

    facets: int = 8
    angle: float = 0.0

    def obstacle(self, problem: Any) -> str | None:
        return obstacle(problem, self.facets, self.angle)


class PolygonEdge(Conversion):
    """Base of the edges to this LCP. Trace: `W`, `q`, `mu`, with rolling friction `mu_r`, for `push`."""

    target: ClassVar[str] = "lcp"

    @property
    def vertices(self) -> Dense:
        """D, shape (k, ν): in the plane k = 1 and D = [1, −1], else k = 2."""
        return INTERVAL

    def apply(self, problem: LocalContact) -> tuple[LCP, Trace]:
        self.require(problem)
        bounds = _friction(problem)
        form = congruence(self.vertices, len(bounds))
        M = form.assemble(problem.W, coefficients(*bounds.values()))
        q = (problem.q.reshape(-1, form.d) @ form.left).ravel()
        return LCP(M=M, q=q), {"W": problem.W, "q": problem.q, **bounds}

    def predict(self, problem: LocalContact) -> Size:
        return congruence(self.vertices, len(_friction(problem))).size(problem.W)

    def lift(self, point: LCPPoint, trace: Trace) -> FCPoint:
        # no problem is at hand here: the trace tells rolling friction, which has a second disk, from friction alone
        D, disks = self.vertices, 2 if "mu_r" in trace else 1
        k, count = D.shape
        x = point.z.reshape(-1, 1 + disks * (count + 1))
        weights = x[:, 1:].reshape(len(x), disks, count + 1)[:, :, :-1]
        return FCPoint(r=np.column_stack([x[:, 0], (weights @ D.T).reshape(len(x), disks * k)]).ravel())

    def push(self, point: FCPoint, trace: Trace) -> LCPPoint:
        """Project forces and moments on their polygons; λ and κ are the least that the velocities allow."""
        D, disks = self.vertices, [trace[name] for name in ("mu", "mu_r") if name in trace]
        k = D.shape[0]
        normal, tangential, velocity = split(point, trace, 1 + k * len(disks))
        columns: list[Dense | Vector] = [normal]
        for disk, coefficient in enumerate(disks):
            disk_forces = slice(k * disk, k * (disk + 1))
            columns.append(coordinates(tangential[:, disk_forces], D, coefficient * normal))
            columns.append(np.maximum((-velocity[:, 1:][:, disk_forces] @ D).max(axis=1, initial=0.0), 0.0))
        return LCPPoint(z=np.column_stack(columns).ravel())


class InscribedEdge(FacetKnobs, PolygonEdge):
    """Base of the edges by inscribed polygons, whose vertices are on the circle."""

    @property
    def vertices(self) -> Dense:
        """d_i as columns, shape (2, ν)."""
        return directions(self.facets, self.angle)


def _friction(problem: LocalContact) -> dict[str, Vector]:
    """Return the coefficients of the disks of a contact by name, shape (nc,) each."""
    rolling = {"mu_r": problem.mu_r} if isinstance(problem, RollingFrictionContact) else {}
    return {"mu": problem.mu, **rolling}


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


def congruence(D: Dense, disks: int = 1) -> Congruence:
    """Return M of the LCP with the vertices D, shape (k, ν); coefficients at a contact: 1, μ and, of 2 disks, μ_r."""
    k, count = D.shape
    width = 1 + disks * (count + 1)
    embed = np.zeros((1 + disks * k, width))
    embed[0, 0] = 1.0
    block, *bounds = np.zeros((1 + disks, width, width))
    for disk, bound in enumerate(bounds):
        first = 1 + disk * (count + 1)
        forces, multiplier = slice(first, first + count), first + count
        embed[1 + disk * k : 1 + (disk + 1) * k, forces] = D
        block[forces, multiplier], block[multiplier, forces] = 1.0, -1.0
        bound[multiplier, 0] = 1.0
    return Congruence(embed, embed, np.stack([block, *bounds]))


def coefficients(*bounds: Vector) -> Dense:
    """Return 1 and the friction coefficients of every contact, as columns."""
    return np.column_stack([np.ones(bounds[0].size), *bounds])


def split(point: FCPoint, trace: Trace, d: int) -> tuple[Vector, Dense, Dense]:
    """Return r_N ≥ 0, r_T and u of every contact."""
    u = trace["W"] @ point.r + trace["q"]
    R = point.r.reshape(-1, d)
    return np.maximum(R[:, 0], 0.0), R[:, 1:], u.reshape(-1, d)


def coordinates(x: Dense, D: Dense, bound: Vector | None = None) -> Dense:
    """Return β ≥ 0 of every row of x with Dβ = x, on the two neighbouring vertices that enclose it; shape (nc, ν).

    With `bound`, x is first projected on the polygon with vertices bound·D: then eᵀβ ≤ bound.
    """
    if D.shape[0] == 1:
        return np.clip(x @ D, 0.0, np.inf if bound is None else bound[:, None])
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
