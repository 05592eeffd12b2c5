"""Polygons in place of the two disks of rolling friction, shared by the facet edges of `rfc`.

With vertices D of a polygon for the force and D_r for the moment, x = (r_N, β, λ, γ, κ) a contact, r_T = Dβ, m = D_rγ:

    0 ≤ r_N ⟂ u_N ≥ 0,   0 ≤ β ⟂ λe + Dᵀu_T ≥ 0,   0 ≤ λ ⟂ μ r_N − eᵀβ ≥ 0,
                         0 ≤ γ ⟂ κe + D_rᵀω ≥ 0,   0 ≤ κ ⟂ μ_r r_N − eᵀγ ≥ 0.

In the plane (rows N, T, M) D = D_r = [1, −1] are the intervals themselves.
"""

from __future__ import annotations

import numpy as np

from cpbench.conversions import facets
from cpbench.conversions.congruence import Congruence
from cpbench.conversions.operators import ContactOperator
from cpbench.formulations.base import Trace
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.lcp import LCP, LCPPoint
from cpbench.formulations.rfc import RollingFrictionContact
from cpbench.matrices import Dense, Vector


def to_lcp(problem: RollingFrictionContact, D: Dense) -> tuple[LCP, Trace]:
    """Build the LCP with the vertices D, shape (k, ν), for forces and moments; trace: `W`, `q`, `mu`, `mu_r`."""
    form = congruence(D)
    M = form.assemble(problem.W, facets.coefficients(problem.mu, problem.mu_r))
    q = (problem.q.reshape(-1, form.d) @ form.left).ravel()
    return LCP(M=M, q=q), {"W": problem.W, "q": problem.q, "mu": problem.mu, "mu_r": problem.mu_r}


def operator(problem: RollingFrictionContact, D: Dense) -> ContactOperator:
    """Return M of `to_lcp`, never assembled."""
    return congruence(D).operator(problem.W, facets.coefficients(problem.mu, problem.mu_r))


def congruence(D: Dense) -> Congruence:
    """Return M of the LCP with the vertices D, shape (k, ν), its coefficients at a contact 1, μ and μ_r."""
    k, count = D.shape
    width = 1 + 2 * (count + 1)
    embed = np.zeros((1 + 2 * k, width))
    embed[0, 0] = 1.0
    own, *bounds = np.zeros((3, width, width))
    for part, bound in enumerate(bounds):
        first = 1 + part * (count + 1)
        forces, multiplier = slice(first, first + count), first + count
        embed[1 + part * k : 1 + (part + 1) * k, forces] = D
        own[forces, multiplier], own[multiplier, forces] = 1.0, -1.0
        bound[multiplier, 0] = 1.0
    return Congruence(embed, embed, np.stack([own, *bounds]))


def from_lcp(point: LCPPoint, D: Dense) -> FCPoint:
    """Return r = Ex."""
    count = D.shape[1]
    x = point.z.reshape(-1, 1 + 2 * (count + 1))
    return FCPoint(r=np.column_stack([x[:, 0], x[:, 1 : 1 + count] @ D.T, x[:, 2 + count : -1] @ D.T]).ravel())


def push(point: FCPoint, trace: Trace, D: Dense) -> LCPPoint:
    """Return x of an answer: forces and moments projected on their polygons, λ and κ the least that the velocities
    allow.
    """
    k = D.shape[0]
    normal, tangential, u = facets.split(point, trace, 1 + 2 * k)
    columns: list[Dense | Vector] = [normal]
    for part, coefficient in ((slice(0, k), trace["mu"]), (slice(k, 2 * k), trace["mu_r"])):
        bound = coefficient * normal
        columns.append(_coordinates(tangential[:, part], D, bound))
        columns.append(np.maximum((-u[:, 1:][:, part] @ D).max(axis=1, initial=0.0), 0.0))
    return LCPPoint(z=np.column_stack(columns).ravel())


def _coordinates(x: Dense, D: Dense, bound: Vector) -> Dense:
    if D.shape[0] == 1:
        return np.minimum(np.maximum(x @ D, 0.0), bound[:, None])
    return facets.coordinates(x, D, bound)
