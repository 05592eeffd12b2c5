"""Conversions of fc where its cone is a polyhedron: in the plane, without friction, and by facets."""

from __future__ import annotations

import math

import numpy as np

from cpbench.conversions import facets as polygon
from cpbench.conversions.base import Conversion, Size, edge
from cpbench.conversions.congruence import Congruence
from cpbench.conversions.facets import FacetKnobs, InscribedEdge, PolygonEdge
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.linear import LCP, MLCP, LCPPoint, MLCPPoint
from cpbench.formulations.local_contact import FrictionContact
from cpbench.foundation.matrices import Dense
from cpbench.foundation.text import counted


@edge("fc-lcp-2d", equation="(47)-(48)", kind=Kind.EQUIVALENT, cost=2.0)
class FCtoLCP2D(PolygonEdge):
    """Frictional contact → LCP in two dimensions, where Coulomb's cone is a polyhedron ((47)-(48) with D = [1, −1]).

    Source  u = Wr + q, contact law with r = (r_N, r_T).
    Target  x = (r_N, β₁, β₂, λ) a contact, r_T = β₁ − β₂:
            0 ≤ r_N ⟂ u_N ≥ 0,  0 ≤ β ⟂ λ + (u_T, −u_T) ≥ 0,  0 ≤ λ ⟂ μ r_N − β₁ − β₂ ≥ 0.
    Lift    r = (r_N, β₁ − β₂).        Push  β = (max(r_T, 0), max(−r_T, 0)) within μ r_N,  λ = |u_T|.
    Kind    equivalent. Siconos' smaller form, three rows a contact, is not copositive where this one is, so Lemke's
            method may end on a ray there.

    Trace: `W`, `q`, `mu`, for the multipliers of `push`.
    """

    def obstacle(self, problem: FrictionContact) -> str | None:
        if problem.dimension == 2:
            return None
        return (
            f"the problem is {problem.dimension}-dimensional, where the cone has no facets; "
            "use fc-lcp-inner or fc-lcp-outer, which approximate it"
        )


@edge("fc-lcp-frictionless", equation="(40), local", kind=Kind.EQUIVALENT, cost=1.0)
class FCtoLCPFrictionless(Conversion):
    """Frictionless contact → LCP of the normal reactions.

    Source  u = Wr + q,  μ = 0: r_T = 0,  0 ≤ r_N ⟂ u_N ≥ 0.
    Target  M = W_NN,  q = q_N,  z = r_N.
    Lift    r = (r_N, 0).        Push  r_N.
    Kind    equivalent, in two and three dimensions.

    Trace: `d` (rows of a contact).
    """

    def obstacle(self, problem: FrictionContact) -> str | None:
        rubbing = np.flatnonzero(problem.mu)
        if not rubbing.size:
            return None
        c = int(rubbing[0])
        return f"friction at {counted(rubbing.size, 'contact')}, the first is {c} with μ = {problem.mu[c]:g}"

    def apply(self, problem: FrictionContact) -> tuple[LCP, Trace]:
        self.require(problem)
        d = problem.dimension
        return LCP(M=problem.W[::d, ::d], q=problem.q[::d]), {"d": d}

    def lift(self, point: LCPPoint, trace: Trace) -> FCPoint:
        r = np.zeros(point.z.size * trace["d"])
        r[:: trace["d"]] = point.z
        return FCPoint(r=r)

    def push(self, point: FCPoint, trace: Trace) -> LCPPoint:
        return LCPPoint(z=point.r[:: trace["d"]])


@edge("fc-lcp-inner", equation="(47)-(48)", kind=Kind.APPROXIMATE, cost=4.0)
class FCtoLCPInner(InscribedEdge):
    """Frictional contact → LCP by an inscribed polygon, inner facets (equations (47)-(48)).

    Source  u = Wr + q, Coulomb's law with the disk of radius μ r_N.
    Target  x = (r_N, β ∈ ℝ^ν, λ) a contact, r_T = Σ β_i d_i, d_i at angle + 2πi/ν:
            0 ≤ r_N ⟂ u_N ≥ 0,  0 ≤ β ⟂ λe + Dᵀu_T ≥ 0,  0 ≤ λ ⟂ μ r_N − eᵀβ ≥ 0.
    Lift    r = (r_N, Dβ).        Push  r_T projected on the polygon, β on two vertices, λ = max_i(−d_iᵀu_T).
    Kind    approximate: radius too small by up to 1 − cos(π/ν), sliding direction off by up to 180°/ν whatever the
            speed. The error is not monotone in ν: with few facets a direction may be exact by luck.

    `facets` vertices on the circle, the first at `angle` [rad]. Trace: `W`, `q`, `mu`, for `push`.
    """


@edge("fc-lcp-outer", equation="(42)-(48)", kind=Kind.APPROXIMATE, cost=4.0)
class FCtoLCPOuter(FacetKnobs, PolygonEdge):
    """Frictional contact → LCP by a circumscribed polygon, outer facets given by their vertices ((42)-(48)).

    Source  u = Wr + q, Coulomb's law with the disk of radius μ r_N.
    Target  that of fc-lcp-inner with the vertices d_i of the polygon whose sides touch the circle at angle + 2πi/ν:
            d_i at angle + (2i + 1)π/ν, of length 1/cos(π/ν).
    Lift    r = (r_N, Dβ).        Push  as fc-lcp-inner.
    Kind    approximate: the same solutions r as fc-mlcp-outer, without W_TT nonsingular; radius too large by up to
            1/cos(π/ν) − 1, sliding direction off by up to 180°/ν.

    `facets` sides, the first touching the circle at `angle` [rad]. Trace: `W`, `q`, `mu`, for `push`.
    """

    @property
    def vertices(self) -> Dense:
        """d_i as columns, shape (2, ν)."""
        half = math.pi / self.facets
        return polygon.directions(self.facets, self.angle + half) / math.cos(half)


@edge("fc-mlcp-outer", equation="(42)-(46)", kind=Kind.APPROXIMATE, cost=4.0)
class FCtoMLCPOuter(FacetKnobs, Conversion):
    """Frictional contact → MLCP by a circumscribed polygon, outer facets given by their sides (equations (42)-(46)).

    Source  u = Wr + q, Coulomb's law with the disk of radius μ r_N.
    Target  r_T free; v = (r_N, κ ∈ ℝ^ν) a contact; the sides have the normals c_i at angle + 2πi/ν, C = [c_1 … c_ν]:
            u_T + Cκ = 0,  0 ≤ r_N ⟂ u_N ≥ 0,  0 ≤ κ ⟂ μ r_N e − Cᵀr_T ≥ 0.
    Lift    r = (r_N, r_T).        Push  r_T projected on the polygon, κ on the two normals that enclose −u_T.
    Kind    approximate: radius too large by up to 1/cos(π/ν) − 1, sliding direction off by up to 180°/ν.

    `facets` sides, the first touching the circle at `angle` [rad]. Trace: `W`, `q`, `mu`, for `push`.
    """

    @property
    def normals(self) -> Dense:
        """c_i as columns, shape (2, ν)."""
        return polygon.directions(self.facets, self.angle)

    def apply(self, problem: FrictionContact) -> tuple[MLCP, Trace]:
        self.require(problem)
        W, q, mu = problem.W, problem.q, problem.mu
        every = polygon.coefficients(mu)
        A, B, C, D = (form.assemble(W, every) for form in self.congruences.values())
        u = q.reshape(-1, 3)
        b = np.zeros((problem.nc, self.facets + 1))
        b[:, 0] = u[:, 0]
        return MLCP(A=A, B=B, C=C, D=D, a=u[:, 1:].ravel(), b=b.ravel()), {"W": W, "q": q, "mu": mu}

    def predict(self, problem: FrictionContact) -> Size:
        parts = [form.size(problem.W) for form in self.congruences.values()]
        return Size(
            rows=problem.nc * (self.facets + 3),
            entries=sum(part.entries for part in parts),
            bytes=sum(part.bytes for part in parts),
        )

    @property
    def congruences(self) -> dict[str, Congruence]:
        """A, B, C and D, their coefficients at a contact 1 and μ."""
        tangential = np.eye(3)[:, 1:]  # r = tangential r_T + normal v
        normal = np.zeros((3, self.facets + 1))
        normal[0, 0] = 1.0
        sides = np.hstack([np.zeros((2, 1)), self.normals])
        friction = np.zeros((self.facets + 1, self.facets + 1))
        friction[1:, 0] = 1.0
        return {
            "A": Congruence(tangential, tangential, np.zeros((2, 2, 2))),
            "B": Congruence(normal, normal, np.stack([0.0 * friction, friction])),
            "C": Congruence(tangential, normal, np.stack([sides, 0.0 * sides])),
            "D": Congruence(normal, tangential, np.stack([-sides.T, 0.0 * sides.T])),
        }

    def lift(self, point: MLCPPoint, trace: Trace) -> FCPoint:
        normal = point.v.reshape(-1, self.facets + 1)[:, 0]
        return FCPoint(r=np.column_stack([normal, point.u.reshape(-1, 2)]).ravel())

    def push(self, point: FCPoint, trace: Trace) -> MLCPPoint:
        normal, r_T, velocity = polygon.split(point, trace, 3)
        half = math.pi / self.facets
        vertices = polygon.directions(self.facets, self.angle + half) / math.cos(half)
        inside = polygon.coordinates(r_T, vertices, trace["mu"] * normal) @ vertices.T
        kappa = polygon.coordinates(-velocity[:, 1:], self.normals)
        return MLCPPoint(u=inside.ravel(), v=np.column_stack([normal, kappa]).ravel())
